"""The floor under a sensor plane: which flat faces carry it and where it ends."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.model import PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray

from .outlines import flat_normals, joined, plane_polygons, section

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_X, _Y, _O = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3)


@dataclass(slots=True)
class PlanView:
    """The scene in its own axes, with what a search for floors asks of its patches.

    Attributes
    ----------
    data : SceneData
        Patches in scene coordinates. [m]
    upward : (p,) bool array
        Flat and horizontal, with an active side up.
    height : (p,) array
        Height of flat patches. [m]
    size : float
        Diagonal of the scene. [m]
    """

    data: SceneData
    upward: np.ndarray
    height: FloatArray
    size: float

    @classmethod
    def of(cls, data: SceneData, to_scene: FloatArray) -> PlanView:
        """Turn the frozen ``data`` back to scene axes by ``to_scene`` (4, 4)."""
        if not np.array_equal(to_scene, np.eye(4)):
            data = dataclasses.replace(data, patches=data.patches.moved(to_scene))
        patches = data.patches
        low, high = patches.bounds()
        size = float(np.linalg.norm(high - low))
        nets = patches.control_points
        z = nets[..., 2] / nets[..., 3]
        level = np.ptp(z, axis=(1, 2)) <= 1e-6 * size
        upward = np.zeros(len(patches), dtype=bool)
        rows = np.flatnonzero(level)
        nz = flat_normals(patches.take(rows), size)[:, 2]
        upward[rows] = np.where(data.two_sided[rows], np.abs(nz), nz) > 0.5
        return cls(data, upward, z.mean(axis=(1, 2)), size)

    @property
    def patches(self) -> PatchSet:
        """All patches, in scene coordinates. [m]"""
        return self.data.patches

    def outline(self, rows: np.ndarray) -> BaseGeometry:
        """Plan of the patches ``rows``."""
        return joined(plane_polygons(self.patches.take(rows), _O, _X, _Y, self.size), self.size)

    def material_at(self, z: float) -> BaseGeometry:
        """Plan of everything that is inside a solid at height ``z``."""
        import shapely
        from patchlight.solver.containment import inside_solids

        kinds = np.array([part.kind for part in self.data.parts])
        solid = np.flatnonzero(kinds[self.patches.part_index] == "solid")
        regions: list[Any] = []
        for part in np.unique(self.patches.part_index[solid]):
            rows = solid[self.patches.part_index[solid] == part]
            regions += section(self.patches.take(rows), z, self.size)
        if not regions:
            return shapely.Polygon()
        inner = [point_of(region, regions) for region in regions]
        points = np.array([[p.x, p.y, z] for p in inner])
        inside = inside_solids(self.data, points)
        return joined([r for r, yes in zip(regions, inside, strict=True) if yes], self.size)


def point_of(region: BaseGeometry, regions: list[Any]) -> Any:
    """A point in a region, outside of all smaller ones: of a room, not in what stands in it."""
    import shapely

    smaller = [other for other in regions if other.area < region.area]
    rest = region.difference(shapely.union_all(smaller)) if smaller else region
    return (region if rest.is_empty else rest).representative_point()


def floor_outline(view: PlanView, z: float) -> tuple[BaseGeometry | None, float]:
    """Plan and height of the floor that a plane at height ``z`` looks down on.

    Flat faces of one height that touch are one floor, cut where a solid reaches through ``z``
    (walls and columns standing on it). Of all floors below ``z`` the one of which most is visible
    from ``z`` is taken: higher floors hide lower ones, so that the storey of ``z`` is found.
    Furniture below ``z`` leaves the outline as it is.

    Returns
    -------
    plan : shapely geometry or None
        None when there is no flat upward face below ``z``.
    height : float
        Height of the floor. [m]
    """
    import shapely

    tolerance = 1e-6 * view.size
    rows = np.flatnonzero(view.upward & (view.height < z - tolerance))
    if not len(rows):
        return None, 0.0
    material = view.material_at(z)
    order = rows[np.argsort(view.height[rows], kind="stable")]
    gaps = np.diff(view.height[order]) > tolerance
    levels = np.split(order, np.flatnonzero(gaps) + 1)
    covered: BaseGeometry = shapely.Polygon()
    best: tuple[float, Any, float] = (0.0, None, 0.0)
    for level in reversed(levels):  # from the top: what lies higher hides what lies lower
        plan = view.outline(level).difference(material)
        for piece in shapely.get_parts(plan):
            visible = piece.difference(covered).area if piece.area > best[0] else 0.0
            if visible > best[0]:
                best = (visible, piece, float(view.height[level[0]]))
        covered = shapely.union(covered, plan)
    return best[1], best[2]
