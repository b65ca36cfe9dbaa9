"""Curved surface elements: sub-patches by parameter box, with inset collocation nodes."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .arrays import FloatArray, IntArray, check_shape, frozen


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """Flat list of elements; row i of every array is the same element, n elements, q nodes each.

    Attributes
    ----------
    nets : (n, 4, 4, 4) array
        Homogeneous control nets; +normal towards the lit side.
    patch_index : (n,) int array
        Row of the patch in the scene.
    side : (n,) int array
        0 on the patch's + side, 1 on its − side.
    boxes : (n, 4) array
        u0, u1, v0, v1 of the element in its patch's parameters.
    nodes, normals : (n, q, 3) array
        Collocation nodes [m], inset from corners and edges, and unit normals there.
    weights : (n, q) array
        Area weights of the nodes; each row sums to the element's area. [m²]
    areas : (n,) array
        Areas by quadrature. [m²]
    buried : (n, q) bool array
        Nodes inside another solid or against a coincident face: they get no light.
    """

    nets: FloatArray
    patch_index: IntArray
    side: IntArray
    boxes: FloatArray
    nodes: FloatArray
    normals: FloatArray
    weights: FloatArray
    areas: FloatArray
    buried: IntArray

    def __post_init__(self) -> None:
        n, q = np.shape(self.weights)
        for name, dtype, shape in (
            ("nets", np.float64, (n, 4, 4, 4)),
            ("patch_index", np.int64, (n,)),
            ("side", np.int64, (n,)),
            ("boxes", np.float64, (n, 4)),
            ("nodes", np.float64, (n, q, 3)),
            ("normals", np.float64, (n, q, 3)),
            ("weights", np.float64, (n, q)),
            ("areas", np.float64, (n,)),
            ("buried", np.bool_, (n, q)),
        ):
            array = frozen(getattr(self, name), dtype)
            check_shape(f"Elements.{name}", array, shape)
            object.__setattr__(self, name, array)

    def take(self, rows: IntArray) -> Elements:
        """Some of them."""
        return Elements(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def __len__(self) -> int:
        return len(self.areas)
