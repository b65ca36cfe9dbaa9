"""A scene solved by the method of Nishita and Nakamae 1993 [1]: radiosity at element corners.

The exitance of an element is bilinear between its corners. Form factors are those of `nn93`, taken
as they come: no row is closed, and nothing is known of their errors.

References
----------
.. [1] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993, sections 4 to 6.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .budget import Budget
from .exchange import Rows, make_sources
from .exchange import products as multiplied
from .field import FieldSolver
from .fineness import Fineness
from .incident import Gathered, Light
from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .memory import check_bytes
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray
from .model.result import luminous
from .model.scene import SceneData
from .model.views import Sensors
from .radiosity import RadiositySystem
from .solved_field import Field
from .surfaces import Receivers, Surfaces
from .topology import writable
from .unknowns import Unknowns
from .vertices import Vertices, between_corners

#: Receivers at a time: shares of all corners are held for each.
BLOCK = 64
#: Form factor, for each unit of accuracy, of a sub-element that is not quartered.
LEAST = 0.1
#: Lamps' light at the corners of an element that differs by more than this share of the scene's
#: mean is reason to quarter it, and how often.
DIFFERENT, ROUNDS = 0.5, 3


@dataclass(frozen=True, slots=True, eq=False)
class Eyes:
    """Where light is looked at: m points, normals, and what is known of the patch they lie on."""

    points: FloatArray
    normals: FloatArray
    on: IntArray
    blind: IntArray
    near: FloatArray

    @classmethod
    def of_vertices(cls, v: Vertices) -> Eyes:
        return cls(v.points, v.normals, v.on, v.blind, v.near)

    @classmethod
    def of_sensors(cls, grid: Sensors) -> Eyes:
        m = len(grid)
        nowhere, none = np.full(m, -1), np.zeros(m, dtype=bool)
        return cls(grid.points, grid.normals, nowhere, none, np.zeros(m))


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What m eyes see of a mesh of n elements with N vertices.

    Attributes
    ----------
    elements, vertices : (m, n) and (m, N) arrays
        Form factors.
    light : Light
        Direct light.
    """

    elements: FloatArray
    vertices: FloatArray
    light: Light


@dataclass(frozen=True, slots=True, eq=False)
class CornerField:
    """A scene solved on one mesh; N vertices.

    Attributes
    ----------
    surfaces : Surfaces
        Optical state of the elements.
    vertices : Vertices
        What the unknowns stand for.
    system : RadiositySystem
        Reflection between them.
    seen : Seen
        What they see.
    sent, indirect : dict of (N, b) arrays
        Reflected exitance [lm/m²] and indirect light [lx] by light group.
    """

    surfaces: Surfaces
    vertices: Vertices
    system: RadiositySystem
    seen: Seen
    sent: dict[str, FloatArray]
    indirect: dict[str, FloatArray]

    def gathered(self, seen: Seen) -> Gathered:
        """All light on what sees the mesh so."""
        indirect = {group: multiplied(seen.vertices, b) for group, b in self.sent.items()}
        return Gathered.of(seen.light, indirect, np.zeros(len(seen.elements)))

    @property
    def illuminance(self) -> FloatArray:
        """Of the vertices (N,). [lx]"""
        parts = [*self.seen.light.direct.values(), *self.indirect.values()]
        nothing = np.zeros((len(self.vertices), self.surfaces.emitted.shape[1]))
        return luminous(np.asarray(sum(parts, nothing)))


class CornerSolver:
    """Solves one scene on meshes of different size.

    Parameters
    ----------
    base : FieldSolver
        Of the scene; knows meshes and light from outside.
    budget : Budget
        Tolerances.
    """

    def __init__(self, base: FieldSolver, budget: Budget) -> None:
        self.base, self.scene, self.stages = base, base.scene, base.stages
        # A corner has its place, however small the element.
        self.budget = replace(budget, small=0.0)
        self._nets = writable(base.blockers.nets)
        self._hiding = hiding(self.scene, base.blockers) & base.trace

    def boxes(self) -> tuple[Boxes, Boxes]:
        """A mesh, and one with twice its size; see `_quartered`."""
        counts, two_sided = self.budget.divisions, self.scene.two_sided
        half = (counts + 1) // 2
        whole = np.where(counts > 1, 2 * half, 1)
        alone = int((counts == 1).all(axis=1).sum())
        if alone:
            self.stages.warnings.append(
                f"method nn93: {alone} patches are one element on both meshes that are compared; "
                "stated errors lack theirs"
            )
        return Boxes.regular(whole, two_sided), Boxes.regular(half, two_sided)

    def solve(self, boxes: Boxes, *, adapt: bool) -> CornerField:
        """Solve on ``boxes``; with ``adapt``, quartered where the light of lamps changes."""
        base = self.base
        with self.stages.run("elements"):
            elements = base.mesher.elements(self.budget, boxes)
            surfaces = Surfaces.of(self.scene, elements, base.bands)
        if adapt:
            with self.stages.run("elements"):
                finer = self._quartered(boxes, surfaces) if base.lamp_groups else boxes
                self.stages.count({"elements_added": len(finer) - len(boxes)})
                finer = base.mesher.balanced(finer, self.budget)
                elements = base.mesher.elements(self.budget, finer)
                surfaces = Surfaces.of(self.scene, elements, base.bands)
        vertices = Vertices.of_elements(self.scene, elements)
        eyes = Eyes.of_vertices(vertices)
        with self.stages.run("form factors") as tell:
            seen = self.look(eyes, surfaces, vertices, tell)
        buried = base.mesher.buried(vertices.points, vertices.normals)
        for values in (seen.elements, seen.vertices, *seen.light.direct.values()):
            values[buried] = 0.0
        with self.stages.run("radiosity"):
            rho = surfaces.reflectance[vertices.element]
            system = RadiositySystem(seen.vertices, rho, accuracy=self.budget.accuracy)
            sent = system.solve(seen.light.direct)
            indirect = {group: multiplied(seen.vertices, b) for group, b in sent.items()}
        self.stages.figures["spectral_radius"] = system.radius
        self.stages.count({"matrix_products": system.products})
        return CornerField(surfaces, vertices, system, seen, sent, indirect)

    def look(
        self,
        eyes: Eyes,
        surfaces: Surfaces,
        vertices: Vertices,
        tell: Callable[[int, int], None] | None = None,
    ) -> Seen:
        """What ``eyes`` see of a mesh, and direct light on them, lamps first."""
        m, groups = len(eyes.points), self.base.lamp_groups
        # Of elements, and of vertices once more as the rows of the system are weighed.
        need = 8 * m * (len(surfaces.areas) + 2 * len(vertices))
        check_bytes(need, f"the method of 1993 with {m} points and {len(vertices)} corners")
        elements = np.empty((m, len(surfaces.areas)))
        corners = np.empty((m, len(vertices)))
        lamps = {group: np.zeros((m, self.base.bands)) for group in groups}
        emitted = {group: self._emitted(surfaces, group) for group in groups}
        for first in range(0, m, BLOCK):
            some = slice(first, min(first + BLOCK, m))
            shares = self._shares(eyes, some, surfaces)
            elements[some], corners[some] = shares.sum(axis=2), vertices.added(shares)
            for group, light in emitted.items():
                lamps[group][some] = np.einsum("mnk,nkb->mb", shares, light, optimize=True)
            if tell is not None:
                tell(some.stop, m)
        share = np.ones(m)
        receivers = Receivers.of_points(eyes.points, eyes.normals, share, eyes.on)
        outside = self.base.outside(receivers, self.budget)
        outside.direct = {**lamps, **outside.direct}
        return Seen(elements, corners, outside)

    def _shares(self, eyes: Eyes, some: slice, surfaces: Surfaces) -> FloatArray:
        """Shares (k, n, 4) of the corners of all elements in the form factors of some eyes."""
        from .kernels.nn93 import nn93_rows

        elements, accuracy = surfaces.elements, self.budget.accuracy
        points = writable(eyes.points[some])
        shares = np.zeros((len(points), len(elements), 4))
        nn93_rows(
            points,
            writable(eyes.normals[some]),
            writable(eyes.on[some], np.int64),
            writable(eyes.blind[some], np.bool_),
            writable(eyes.near[some]),
            writable(elements.nets),
            writable(elements.patch_index, np.int64),
            self._nets,
            self._hiding,
            max(math.sqrt(accuracy), 1e-3),
            LEAST * accuracy,
            shares,
            np.zeros(shares.shape[:2]),
        )
        return shares

    def _emitted(self, surfaces: Surfaces, group: str) -> FloatArray:
        """Exitance (n, 4, b) that a light group emits at the corners of nets. [lm/m²]"""
        own = np.asarray(surfaces.emitted_by(self.scene, group).any(axis=1))
        corners = own[:, None, None] * surfaces.diffuse_at_corners
        turned = surfaces.elements.side[:, None, None] == 1
        return np.where(turned, corners[:, [1, 0, 3, 2]], corners)

    def _quartered(self, boxes: Boxes, surfaces: Surfaces) -> Boxes:
        """``boxes`` quartered where lamps' light differs at the corners [1, section 6]."""
        lamps = surfaces.emitted.any(axis=1)
        shining = replace(
            surfaces,
            elements=surfaces.elements.take(np.flatnonzero(lamps)),
            areas=surfaces.areas[lamps],
        )
        level = luminous(surfaces.emitted[lamps])

        def at_corners(boxes: Boxes) -> tuple[FloatArray, FloatArray]:
            """Light (n, 4) and areas (n,)."""
            elements = elements_on(self.scene.patches, boxes)
            vertices = Vertices.of_elements(self.scene, elements)
            eyes, light = Eyes.of_vertices(vertices), np.empty(len(vertices))
            for first in range(0, len(light), BLOCK):
                some = slice(first, first + BLOCK)
                light[some] = self._shares(eyes, some, shining).sum(axis=2) @ level
            return light[vertices.of], elements.areas

        light, areas = at_corners(boxes)
        mean = float(np.average(light.mean(axis=1), weights=areas))
        differs = np.ptp(light, axis=1)
        for _ in range(ROUNDS):
            order = np.argsort(-differs * areas, kind="stable")
            order = order[differs[order] > DIFFERENT * mean]
            chosen = np.sort(order[: max(0, self.budget.most_elements - len(boxes)) // 3])
            if not len(chosen):
                break
            parts = boxes.take(chosen)
            for axis in (0, 1):
                parts = parts.halved(np.full(len(parts), axis))
            light, size = at_corners(parts)
            kept = np.setdiff1d(np.arange(len(boxes)), chosen)
            boxes, order = boxes.take(kept).joined(parts)
            differs = np.append(differs[kept], np.ptp(light, axis=1))[order]
            areas = np.append(areas[kept], size)[order]
        return boxes

    def as_field(self, found: CornerField) -> Field:
        """The solution at nodes inside the elements, where all that comes after looks for it."""
        surfaces, elements = found.surfaces, found.surfaces.elements
        unknowns = Unknowns.at_nodes(elements)
        _, node = np.nonzero((elements.weights > 0.0) & ~elements.buried)
        share = between_corners(self.budget.nodes)[node]
        corner = found.vertices.of[unknowns.element]

        def inside(values: FloatArray) -> FloatArray:
            return np.einsum("kc,kc...->k...", share, values[corner])

        direct = {name: inside(values) for name, values in found.seen.light.direct.items()}
        variance = inside(found.seen.light.variance)
        nothing = np.zeros(len(unknowns))
        light = Light(direct, variance, nothing, nothing, direct.get("sun"))
        indirect = {group: inside(values) for group, values in found.indirect.items()}
        n = len(elements)
        nets = self.scene.patches.control_points
        sums = inside(found.seen.elements.sum(axis=1))
        sources = make_sources(elements, nets, np.full(n, self.budget.cell_eps))
        return Field(
            surfaces=surfaces,
            sources=sources,
            every=sources,
            lifts=np.zeros(n),
            unknowns=unknowns,
            system=found.system,
            row_sums=unknowns.mean(sums),
            kept=sums,
            sees_out=not self.base.in_cavity,
            lamps_see_out=not self.base.in_cavity,
            hidden=None,
            arriving=Gathered.of(light, indirect, nothing),
            sent={group: inside(values) for group, values in found.sent.items()},
            fineness=Fineness(
                np.full(n, self.budget.cell_eps), np.zeros(n, dtype=bool), np.ones(n)
            ),
        )

    @staticmethod
    def rows(seen: Seen) -> Rows:
        """Form factors of the elements, for the second pass."""
        m, n = seen.elements.shape
        return Rows(seen.elements, np.zeros((m, n), np.float32), {}, np.zeros((m, 5)))


def hiding(scene: SceneData, blockers: Blockers) -> NDArray[np.bool_]:
    """Which patches (p,) may hide anything: not the flat walls of a convex room that holds all."""
    out = np.ones(len(blockers.nets), dtype=bool)
    points = (blockers.nets[..., :3] / blockers.nets[..., 3:]).reshape(-1, 3)
    every = np.concatenate([points, *(grid.points for grid in scene.sensors)])
    level = 1e-9 * float(np.abs(points).max())
    for solid in np.flatnonzero(blockers.hollow):
        own = np.flatnonzero(blockers.solid == solid)
        axes = blockers.cones[own, :3]
        over = every @ axes.T - np.einsum("ki,ki->k", axes, points.reshape(-1, 16, 3)[own, 0])
        if (blockers.flags[own] & PLANAR != 0).all() and (over >= -level).all():
            out[own] = False
    return out
