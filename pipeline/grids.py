"""Sensor grids: given points, a plane over a floor, or points on faces."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from patchlight.solver.errors import InputError
from patchlight.solver.model import SceneData, Sensors
from patchlight.solver.model.arrays import check_finite, unit_vector

from .frames import transformed_normals, transformed_points

if TYPE_CHECKING:
    from .floors import PlanView
    from .problems import Problems
    from .scene import Scene

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class PlaneRule:
    """Horizontal plane at ``z`` over a floor; see `SensorGrid.on_plane`."""

    z: float
    spacing: float | str
    margin: float
    over: str | None
    bounds: Bounds | None
    normal: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class FaceRule:
    """Points on faces; see `SensorGrid.on_faces`."""

    pattern: str
    spacing: float
    faces: str | None


@dataclass(frozen=True, slots=True, eq=False, init=False)
class SensorGrid:
    """Where illuminance is asked for.

    Parameters
    ----------
    points, normals : (n, 3) arrays
        Positions [m] in scene coordinates and directions the sensors face; one normal (3,) serves
        all. Averages weigh all points alike, but those inside solids, which count in no metric.
    name : str
        Key of the result and name of the file.
    quantity : {"planar"}
        Illuminance on the plane of the sensor.
    spectral : bool
        Whether colour temperature and melanopic values are asked for, too: light is then found in
        20 bands of wavelength.
    """

    name: str
    rule: Sensors | PlaneRule | FaceRule
    spectral: bool

    def __init__(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        *,
        name: str,
        quantity: str = "planar",
        spectral: bool = False,
    ) -> None:
        given = np.atleast_2d(np.asarray(points, dtype=np.float64))
        if not given.size:
            raise InputError(f"sensor grid {name!r}: has no points, at least 1 is needed")
        rule = Sensors(name, given, np.asarray(normals, float), quantity=quantity)
        self._set(name, rule, spectral)

    def _set(self, name: str, rule: Sensors | PlaneRule | FaceRule, spectral: bool) -> None:
        if not isinstance(spectral, bool):
            raise InputError(f"sensors {name!r}: spectral = {spectral!r}: must be True or False")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "rule", rule)
        object.__setattr__(self, "spectral", spectral)

    @classmethod
    def _of(cls, name: str, rule: PlaneRule | FaceRule, spectral: bool) -> SensorGrid:
        grid = object.__new__(cls)
        grid._set(name, rule, spectral)
        return grid

    @classmethod
    def on_plane(
        cls,
        name: str,
        *,
        z: float,
        spacing: float | str = 0.5,
        margin: float = 0.0,
        over: str | None = None,
        bounds: Bounds | None = None,
        normal: ArrayLike = (0.0, 0.0, 1.0),
        quantity: str = "planar",
        spectral: bool = False,
    ) -> SensorGrid:
        """Equal cells on the horizontal plane at height ``z``.

        The measured area is the rectangle ``bounds``, or the plan of the flat upward faces of the
        parts ``over``, or else of the floor of which most is visible from ``z``, shrunk by
        ``margin``. Each side of its box is divided into ceil(extent / spacing) cells along x and y;
        sensors stand at the centres. Centres outside the area or inside a solid are dropped; each
        sensor weighs with the part of its cell inside the area.

        Parameters
        ----------
        z : float
            Height. [m]
        spacing : float or "en12464"
            Largest cell size [m], or p = 0.2 · 5^(log10 d) of EN 12464-1:2021, 4.4, d being the
            longer side of the area (the shorter one when the ratio is 2 or more), p at most 10 m.
        margin : float
            Band left out along the outline. [m]
        over : str, optional
            Part pattern of the floor.
        bounds : (x0, y0, x1, y1), optional
            Rectangle instead of a floor. [m]
        normal : (3,)
            Direction the sensors face.
        spectral : bool
            Whether colour temperature and melanopic values are asked for, too.
        """
        what = f"sensors {name!r}"
        _check_quantity(what, quantity)
        for key, value in (("z", z), ("margin", margin)):
            if not math.isfinite(value):
                raise InputError(f"{what}: {key} = {value}: must be a finite number")
        if margin < 0.0:
            raise InputError(f"{what}: margin = {margin}: must not be negative")
        if spacing != "en12464":
            _check_spacing(what, spacing)
        if bounds is not None:
            if over is not None:
                raise InputError(f"{what}: give over or bounds, not both")
            box = np.asarray(bounds, dtype=np.float64)
            if box.shape != (4,):
                raise InputError(f"{what}: bounds = {bounds}: expected (x0, y0, x1, y1)")
            check_finite(f"{what}: bounds", box)
            if not (box[0] < box[2] and box[1] < box[3]):
                raise InputError(f"{what}: bounds = {bounds}: needs x0 < x1 and y0 < y1")
            bounds = (float(box[0]), float(box[1]), float(box[2]), float(box[3]))
        n = unit_vector(f"{what}: normal", normal)
        direction = (float(n[0]), float(n[1]), float(n[2]))
        rule = PlaneRule(float(z), spacing, float(margin), over, bounds, direction)
        return cls._of(name, rule, spectral)

    @classmethod
    def on_faces(
        cls,
        name: str,
        pattern: str,
        *,
        spacing: float = 0.5,
        faces: str | None = None,
        spectral: bool = False,
    ) -> SensorGrid:
        """Sensors on the active side of faces, looking along their normals.

        Flat faces carry equal cells of at most ``spacing`` [m] as planes do, horizontal and upright
        on walls; curved faces are divided along the parameters of their patches.

        Parameters
        ----------
        pattern, faces : str
            Parts and faces, as for `Scene.assign`.
        spectral : bool
            Whether colour temperature and melanopic values are asked for, too.
        """
        _check_spacing(f"sensors {name!r}", spacing)
        return cls._of(name, FaceRule(pattern, float(spacing), faces), spectral)


def _check_quantity(what: str, quantity: str) -> None:
    if quantity != "planar":
        raise InputError(f"{what}: quantity {quantity!r}: only 'planar' is computed")


def _check_spacing(what: str, spacing: float | str) -> None:
    if isinstance(spacing, str) or not (math.isfinite(spacing) and spacing > 0.0):
        raise InputError(f"{what}: spacing = {spacing!r}: must be a positive number")


def check_pattern(scene: Scene, grid: SensorGrid) -> None:
    """Raise `InputError` where a grid is put over or on faces that ``scene`` does not have."""
    from .assigning import find_faces

    what, rule = f"sensors {grid.name!r}", grid.rule
    if isinstance(rule, PlaneRule) and rule.over is not None:
        find_faces(scene.entries, rule.over, label=f"{what}: over = {rule.over!r}")
    elif isinstance(rule, FaceRule):
        find_faces(scene.entries, rule.pattern, label=what, faces=rule.faces)


def resolved_sensors(
    scene: Scene, data: SceneData, problems: Problems
) -> tuple[tuple[Sensors, ...], tuple[str, ...]]:
    """Sensors of all grids of ``scene`` in world axes, and what to say about them.

    ``data`` is the frozen scene without sensors; grids that fail go to ``problems``.
    """
    from .face_grids import sensors_on_faces
    from .floors import PlanView
    from .plane_grids import sensors_on_plane

    found: list[Sensors] = []
    notes: list[str] = []
    view: PlanView | None = None
    for name, grid in scene.grids.items():
        rule = grid.rule if isinstance(grid, SensorGrid) else grid
        with problems.under():
            if isinstance(rule, Sensors):
                sensors = rule
                if data.closed.any():
                    view = view or PlanView.of(data, scene.north.T)
                    sensors = _without_weight_inside(rule, view)
            else:
                view = view or PlanView.of(data, scene.north.T)
                if isinstance(rule, PlaneRule):
                    sensors, more = sensors_on_plane(name, rule, scene, view)
                else:
                    sensors, more = sensors_on_faces(name, rule, scene, view)
                notes += more
            spectral = grid.spectral
            found.append(_in_world(scene, name, replace(sensors, spectral=spectral)))
    return tuple(found), tuple(notes)


def _without_weight_inside(sensors: Sensors, view: PlanView) -> Sensors:
    """Given points of which those inside solids count in no metric.

    Raises
    ------
    InputError
        If all of them are.
    """
    from .plane_grids import outside_solids

    open_, _ = outside_solids(f"sensors {sensors.name!r}", sensors.points, view)
    if open_.all():
        return sensors
    return dataclasses.replace(sensors, area_m2=np.where(open_, sensors.area_m2, 0.0))


def _in_world(scene: Scene, name: str, sensors: Sensors) -> Sensors:
    return Sensors(
        name,
        transformed_points(scene.north, sensors.points),
        transformed_normals(scene.north, sensors.normals),
        sensors.area_m2,
        sensors.quantity,
        tuple(transformed_points(scene.north, loop) for loop in sensors.outline),
        sensors.spectral,
    )
