"""Rational bicubic Bézier patches, stored as a structure of arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GeometryError, InputError
from . import bezier, shapes
from .arrays import FloatArray, IntArray, check_finite, check_shape, frozen


@dataclass(frozen=True, slots=True, eq=False)
class PatchSet:
    """Curved patches; row p of every array is the same patch.

    Attributes
    ----------
    control_points : (p, 4, 4, 4) array
        Homogeneous nets ``[p, i, j] = (w x, w y, w z, w)`` [m], i along u, j along v, all w > 0.
        The +normal is ∂u × ∂v: the active side of a one-sided patch.
    face_index : (p,) int array
        Row of the face (of the model or scene) the patch belongs to.
    part_index : (p,) int array
        Row of the part the patch belongs to.
    edge_index : (p, 4) int array
        B-rep edge on the sides v=0, u=1, v=1, u=0; −1 inside a face or where unknown.

    Raises
    ------
    GeometryError
        If there is no patch, a value is not finite or a weight is not positive.
    """

    control_points: FloatArray
    face_index: IntArray = field(default=None)  # type: ignore[arg-type, assignment]
    part_index: IntArray = field(default=None)  # type: ignore[arg-type, assignment]
    edge_index: IntArray = field(default=None)  # type: ignore[arg-type, assignment]

    def __post_init__(self) -> None:
        nets = frozen(self.control_points)
        check_shape("PatchSet.control_points", nets, (None, 4, 4, 4))
        n = len(nets)
        defaults = {
            "face_index": np.arange(n),
            "part_index": np.zeros(n, dtype=np.int64),
            "edge_index": np.full((n, 4), -1),
        }
        object.__setattr__(self, "control_points", nets)
        for name, default in defaults.items():
            given = getattr(self, name)
            array = frozen(default if given is None else given, np.int64)
            check_shape(f"PatchSet.{name}", array, (n, 4) if name == "edge_index" else (n,))
            object.__setattr__(self, name, array)
        bad = np.flatnonzero(~np.isfinite(nets).all(axis=(1, 2, 3)))
        if bad.size:
            raise GeometryError(f"patch {bad[0]}: a control point is not finite")
        bad = np.flatnonzero(~(nets[..., 3] > 0.0).all(axis=(1, 2)))
        if bad.size:
            weight = float(nets[bad[0], ..., 3].min())
            raise GeometryError(f"patch {bad[0]}: weight {weight:g}, but weights must be positive")

    def __repr__(self) -> str:
        return f"<PatchSet: {len(self)} patch{'' if len(self) == 1 else 'es'}>"

    def __len__(self) -> int:
        return len(self.control_points)

    @classmethod
    def empty(cls) -> PatchSet:
        """A set without patches."""
        return cls(np.zeros((0, 4, 4, 4)))

    @classmethod
    def from_bezier(cls, control_points: ArrayLike, weights: ArrayLike | None = None) -> PatchSet:
        """Patches from Euclidean nets (p, 4, 4, 3) [m] and weights (p, 4, 4), default 1."""
        points = np.asarray(control_points, dtype=np.float64)
        check_shape("control_points", points, (None, 4, 4, 3))
        if not np.isfinite(points).all():
            check_finite("control_points", points)
        w = np.ones(points.shape[:3]) if weights is None else np.asarray(weights, dtype=np.float64)
        check_shape("weights", w, points.shape[:3])
        if not (w > 0.0).all():
            raise GeometryError(f"weights: smallest is {w.min():g}, but all must be positive")
        return cls(np.concatenate([points * w[..., None], w[..., None]], axis=-1))

    @classmethod
    def from_bilinear(cls, corners: ArrayLike) -> PatchSet:
        """Bilinear patches from corners (p, 4, 3) [m], counter-clockwise about the +normal.

        Corners 0 … 3 are at (u, v) = (0, 0), (1, 0), (1, 1), (0, 1).
        """
        return cls(shapes.bilinear(np.asarray(corners, dtype=np.float64)))

    @classmethod
    def sphere(cls, center: ArrayLike, radius: float, *, inward: bool = False) -> PatchSet:
        """Exact sphere; +normal outward unless ``inward``."""
        return cls(shapes.sphere(center, radius))._flipped_if(inward)

    @classmethod
    def disk(cls, center: ArrayLike, radius: float, normal: ArrayLike) -> PatchSet:
        """Exact flat disc with the +normal ``normal``."""
        return cls(shapes.disk(center, radius, normal))

    @classmethod
    def cylinder(
        cls, start: ArrayLike, end: ArrayLike, radius: float, *, inward: bool = False
    ) -> PatchSet:
        """Exact lateral surface of a cylinder from axis point ``start`` to ``end``."""
        return cls(shapes.cone(start, end, radius, radius))._flipped_if(inward)

    @classmethod
    def cone(
        cls,
        start: ArrayLike,
        end: ArrayLike,
        start_radius: float,
        end_radius: float,
        *,
        inward: bool = False,
    ) -> PatchSet:
        """Exact lateral surface of a (truncated) cone; one radius may be zero."""
        return cls(shapes.cone(start, end, start_radius, end_radius))._flipped_if(inward)

    @classmethod
    def torus(
        cls,
        center: ArrayLike,
        axis: ArrayLike,
        major_radius: float,
        minor_radius: float,
        *,
        inward: bool = False,
    ) -> PatchSet:
        """Exact torus."""
        nets = shapes.torus(center, axis, major_radius, minor_radius)
        return cls(nets)._flipped_if(inward)

    @classmethod
    def box(
        cls, size: ArrayLike, center: ArrayLike = (0.0, 0.0, 0.0), *, inward: bool = False
    ) -> PatchSet:
        """Six faces of a box of ``size`` (3,) [m] about ``center``."""
        return cls(shapes.box(size, center))._flipped_if(inward)

    @classmethod
    def concatenated(cls, *sets: PatchSet) -> PatchSet:
        """All patches of ``sets`` in order; indices are kept as they are."""
        return cls(
            np.concatenate([s.control_points for s in sets]),
            np.concatenate([s.face_index for s in sets]),
            np.concatenate([s.part_index for s in sets]),
            np.concatenate([s.edge_index for s in sets]),
        )

    def _flipped_if(self, flip: bool) -> PatchSet:
        return self.flipped() if flip else self

    def flipped(self) -> PatchSet:
        """The same surfaces with the +normal reversed (u runs backwards)."""
        return PatchSet(
            self.control_points[:, ::-1],
            self.face_index,
            self.part_index,
            self.edge_index[:, [0, 3, 2, 1]],
        )

    def take(self, rows: ArrayLike) -> PatchSet:
        """The patches ``rows`` (indices or mask)."""
        rows = np.asarray(rows)
        return PatchSet(
            self.control_points[rows],
            self.face_index[rows],
            self.part_index[rows],
            self.edge_index[rows],
        )

    def moved(self, placement: ArrayLike) -> PatchSet:
        """Transformed by an offset (3,) or an affine matrix (4, 4) [m].

        A mirroring matrix turns the nets around, so that +normals stay on the same side of the
        material.
        """
        m = affine(placement)
        nets = self.control_points @ m.T
        moved = PatchSet(nets, self.face_index, self.part_index, self.edge_index)
        return moved._flipped_if(float(np.linalg.det(m[:3, :3])) < 0.0)

    def refined(self) -> PatchSet:
        """Every patch halved in u and v; the surface is unchanged."""
        nets = self.control_points
        quarters = [
            bezier.sub_net(nets, u, u + 0.5, v, v + 0.5) for u in (0.0, 0.5) for v in (0.0, 0.5)
        ]
        order = np.tile(np.arange(len(self)), 4)
        return PatchSet(np.concatenate(quarters), self.face_index[order], self.part_index[order])

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> FloatArray:
        """Points (p, ..., 3) of every patch at parameters u, v (...,). [m]"""
        bu, bv = bezier.bernstein(u), bezier.bernstein(v)
        h = np.einsum("...i,...j,pijk->p...k", bu, bv, self.control_points, optimize=True)
        return np.asarray(h[..., :3] / h[..., 3:])

    def normals(self, u: ArrayLike, v: ArrayLike) -> FloatArray:
        """Unit +normals (p, ..., 3); NaN where a patch is degenerate."""
        places = np.broadcast_arrays(np.asarray(u, np.float64), np.asarray(v, np.float64))
        _, su, sv = bezier.surface_points(self.control_points, *(a.ravel() for a in places))
        n = np.cross(su, sv)
        length = np.linalg.norm(n, axis=-1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            n = np.where(length > 0.0, n / length, np.nan)
        return n.reshape((len(self), *places[0].shape, 3))

    def areas(self) -> FloatArray:
        """Areas (p,). [m²]"""
        return bezier.areas(self.control_points)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (3,) of the box of all control points. [m]"""
        points = self.control_points[..., :3] / self.control_points[..., 3:]
        return points.min(axis=(0, 1, 2)), points.max(axis=(0, 1, 2))


def affine(placement: ArrayLike) -> FloatArray:
    """(4, 4) matrix from an offset (3,) or a matrix (4, 4); `InputError` when singular."""
    array = np.asarray(placement, dtype=np.float64)
    if array.shape == (3,):
        m = np.eye(4)
        m[:3, 3] = array
    else:
        check_shape("placement", array, (4, 4))
        m = array
    check_finite("placement", m)
    if np.linalg.det(m[:3, :3]) == 0.0:
        raise InputError("placement: the matrix is singular")
    return m
