"""Daylight coefficients of the sensors of a scene: what any sky and sun make of light there.

The scene is solved once, under a sky of luminance 1 cd/m² and the ground that belongs to it. That
gives mesh, form factors, light of the ground, and what an even sky makes of light at every sensor,
direct and after reflections, to the accuracy of a simulation. By direction that is parted:

* direct light of the sky by the directions open to each sensor (`open_sky`),
* indirect light of sky and sun by beams (`beams`), scaled for each sensor to what the even sky
  makes,
* direct light of the sun not at all: its disc is looked for at each of its places (`sun_light`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .beams import Beams
from .dome_grid import DomeGrid, dome_grid
from .errors import InputError
from .field import FieldSolver
from .model.arrays import FloatArray, IntArray
from .model.optics import LUMINANCE_WEIGHTS
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import CIESky, Ground
from .open_sky import OpenSky
from .simulation import Options, Simulation, Solved
from .solved_field import Field
from .spectra import cct_to_rgb
from .stages import Stages
from .sun_light import SunLight

#: Colour of sky and sun: as `PerezSky` and `Sun` have them. [K]
SKY_CCT_K, SUN_CCT_K = 6500.0, 5500.0
#: Cells that luminances are told at, by which beams come that make light of the sky, and of the
#: sun, as `dome_grid` has them, and points for each unknown; the finer for accuracies below `FINE`.
SKY_PARTS, BEAM_PARTS, SUN_PARTS, POINTS = (4, 8), (3, 4), (6, 8), (16, 36)
FINE = 0.01
#: Suns of the year for which indirect light is told by themselves, to know the error of the others.
CHECKED = 48


@dataclass(frozen=True, slots=True, eq=False)
class Coefficients:
    """What light from outside makes at m sensors; row i of every array is the same sensor.

    Attributes
    ----------
    sky_grid, sun_grid : DomeGrid
        Cells of the dome, B and C in number.
    direct, indirect : (m, B) array
        Illuminance by luminance 1 cd/m² at the middles of cells, linear between them. [sr]
    beams : (m, C) array
        Indirect illuminance by the sun, of 1 lx on a plane facing it, from the middles of cells;
        not a number of those that are not next to any sun asked for.
    ground : (m,) array
        Illuminance, direct and indirect, by what the ground makes of 1 lx on it.
    sun : SunLight
        Direct light of the sun.
    scaled : float
        By how much indirect coefficients were scaled, root mean square.
    stages : Stages
        Times, counters and warnings of the solve.
    exact_beams : Beams
        Indirect light of suns by themselves, before it is scaled.
    beam_scale : (m,) array
        What its values are scaled by.
    converged : bool
        Whether the solve under the even sky reached its accuracy.
    """

    sky_grid: DomeGrid
    sun_grid: DomeGrid
    direct: FloatArray
    indirect: FloatArray
    beams: FloatArray
    ground: FloatArray
    sun: SunLight
    scaled: float
    stages: Stages
    exact_beams: Beams
    beam_scale: FloatArray
    converged: bool

    @classmethod
    def of(
        cls,
        scene: SceneData,
        *,
        accuracy: float = 0.02,
        stages: Stages | None = None,
        suns: FloatArray | None = None,
        sky_parts: int | None = None,
        beam_parts: int | None = None,
        sun_parts: int | None = None,
    ) -> Coefficients:
        """Those of all sensors of ``scene``, one grid after the other; see `Coefficients`.

        Parameters
        ----------
        scene : SceneData
            Its sky, sun and lamps do not count. Without a ground it gets ``Ground()``.
        accuracy : float
            As of `simulation.solve`; numbers of cells follow from it where they are not given.
        suns : (k, 3) array, optional
            Unit vectors to all places of the sun that will be asked for; any when not given.
        sky_parts, beam_parts, sun_parts : int, optional
            Numbers of cells as of `dome_grid`.

        Raises
        ------
        InputError
            For scenes without sensors, with mirrors, and with panes that diffuse.
        """
        check_scene(scene)
        stages = Stages() if stages is None else stages
        fine = int(accuracy < FINE)
        sky_grid = dome_grid(sky_parts or SKY_PARTS[fine])
        beam_grid = dome_grid(beam_parts or BEAM_PARTS[fine])
        sun_grid = dome_grid(sun_parts or SUN_PARTS[fine])
        even = replace(
            scene,
            sky=CIESky(5, zenith_luminance_cd_m2=1.0, cct_k=SKY_CCT_K),
            sun=None,
            ground=Ground() if scene.ground is None else scene.ground,
            cameras=(),
            luminaires=(),
            luminaire_index=np.full_like(scene.luminaire_index, -1),
        )
        run = Simulation(even, accuracy, "auto", stages, Options(cache=True))
        solver, kept = run.start()
        solved = run.solved(solver, kept)
        kept.tell()
        converged = run.judge(solved)
        if solver.highlights.any:
            stages.warnings.append(
                "glossy surfaces: through a year they reflect sky and sun as if they were matt"
            )
        # In a cavity of its own nothing hides anything from anything, but its wall the sky.
        sky = OpenSky(even, solver.blockers, trace=solver.trace or solver.in_cavity)
        points = np.concatenate([grid.points for grid in scene.sensors])
        normals = np.concatenate([grid.normals for grid in scene.sensors])
        with stages.run("open sky"):
            exact = _at_sensors(solved, "sky.direct")
            seen = sky.seen(points, normals, sky_grid, exact)
            stages.count({"sky_sectors_by_rays": int(seen.by_rays.sum())})
            stages.figures["open_sky_scaled"] = seen.scaled
            if seen.scaled > accuracy:
                stages.warnings.append(
                    "directions open to the sensors were found to "
                    f"{seen.scaled:.2g} of the light of an even sky (root mean square), accuracy "
                    f"{accuracy:g}: they were scaled to it, but skies with a bright part are off "
                    "by as much"
                )
        with stages.run("beams"):
            weights = _importance(solver, solved)
            field = solved.field
            element, node, side = _nodes_of(field)
            beams = Beams.of(
                field.surfaces.elements,
                element,
                node,
                side,
                weights,
                _under_sky(field),
                sky,
                POINTS[fine],
            )
            m = len(points)
            by_sky = beams.of_sky(m).coefficients(beam_grid.directions)
            by_sun = np.full((m, len(sun_grid)), np.nan)
            cells = np.arange(len(sun_grid))
            if suns is not None:
                cells = np.unique(sun_grid.between(suns)[0])
            of_sun = beams.of_sun(m)
            by_sun[:, cells] = of_sun.coefficients(sun_grid.directions[cells])
        # Of each cell of the sky, beams from its middle: linear between those that were looked at.
        found = beam_grid.interpolated(by_sky, sky_grid.directions) * sky_grid.solid_angle
        told, indirect = found.sum(axis=1), _at_sensors(solved, "sky.indirect")
        scale = np.where(told > 0.0, indirect / np.where(told > 0.0, told, 1.0), 1.0)
        return cls(
            sky_grid=sky_grid,
            sun_grid=sun_grid,
            direct=seen.weights,
            indirect=scale[:, None] * found,
            beams=scale[:, None] * by_sun,
            ground=_ground(solved),
            sun=SunLight(sky, run.budget, points, normals),
            scaled=float(np.sqrt(np.mean((scale - 1.0) ** 2))) if m else 0.0,
            stages=stages,
            exact_beams=of_sun,
            beam_scale=scale,
            converged=converged,
        )

    def sun_indirect(self, suns: FloatArray) -> FloatArray:
        """Indirect illuminance (m, k) by the sun in directions (k, 3), of 1 lx facing it."""
        return self.sun_grid.interpolated(self.beams, suns)

    def sun_error(self, suns: FloatArray) -> float:
        """Error of `sun_indirect`, root mean square, against its own, over ``suns`` (k, 3).

        Found by beams from some of them.
        """
        if not len(suns):
            return 0.0
        some = suns[np.unique(np.linspace(0, len(suns) - 1, CHECKED).astype(int))]
        exact = self.exact_beams.coefficients(some) * self.beam_scale[:, None]
        off = self.sun_indirect(some) - exact
        level = math.sqrt(float(np.mean(exact**2)))
        return math.sqrt(float(np.mean(off**2))) / level if level > 0.0 else 0.0


def check_scene(scene: SceneData) -> None:
    """Raise `InputError` for what daylight coefficients do not know."""
    if not scene.sensors:
        raise InputError("year: the scene has no sensors; give a grid")
    used = {int(i) for i in np.unique(scene.material_index) if i >= 0}
    for i in sorted(used):
        material = scene.materials[i]
        if np.any(material.mirror_bands > 0.0):
            raise InputError(
                f"year: material {material.name or i + 1!r} has mirror = {material.mirror}: "
                "mirrors are not done through a year; give it specular or reflectance instead"
            )
    for glazing in scene.glazings:
        if glazing.glass.diffuse > 0.0:
            raise InputError(
                f"year: glass with diffuse = {glazing.glass.diffuse:g}: panes that scatter are not "
                "done through a year; must be 0"
            )


def _at_sensors(solved: Solved, name: str) -> FloatArray:
    """One component (m,) at the sensors of all grids. [lx]"""
    parts = [
        grid.components.get(name, np.zeros(len(grid.points))) for grid in solved.sensors.values()
    ]
    return np.concatenate(parts)


def _under_sky(field: Field) -> FloatArray:
    """Illuminance (N,) of the unknowns straight from the sky. [lx]"""
    found = field.arriving.components.get("sky.direct")
    return np.zeros(len(field.unknowns)) if found is None else luminous(found)


def _ground(solved: Solved) -> FloatArray:
    """Light (m,) by what the ground makes of 1 lx on it; there are π lx in the solve."""
    both = _at_sensors(solved, "ground.direct") + _at_sensors(solved, "ground.indirect")
    return both / math.pi


def _nodes_of(field: Field) -> tuple[IntArray, IntArray, int]:
    """Element (N,) of each unknown, which of its nodes it is, and how many a direction there are.

    Where light is even on elements, each is an unknown as a whole.
    """
    unknowns, elements = field.unknowns, field.surfaces.elements
    if unknowns.basis is None:
        return unknowns.element, np.zeros(len(unknowns), dtype=np.int64), 1
    element, node = np.nonzero((elements.weights > 0.0) & ~elements.buried)
    return element, node, math.isqrt(elements.weights.shape[1])


def _importance(solver: FieldSolver, solved: Solved) -> FloatArray:
    """What illuminance of each unknown adds to that of each sensor (c, N).

    In scenes with colours there are two rows of sensors, for the colour of sky and of sun.
    """
    field, unknowns = solved.field, solved.field.unknowns
    parts = []
    for seen in solved.seen:
        asked = replace(seen.asked, sources=field.every)
        rows = solver.kept.factors(unknowns, seen.rows, asked)
        parts.append(field.system.importance(rows))
    weights = np.concatenate(parts)  # (m, N, b)
    weights = weights * field.system.reflectance
    if weights.shape[2] == 1:
        return np.ascontiguousarray(weights[..., 0])
    lum = np.array(LUMINANCE_WEIGHTS)
    colors = [lum * cct_to_rgb(cct) for cct in (SKY_CCT_K, SUN_CCT_K)]
    return np.concatenate([weights @ color for color in colors])
