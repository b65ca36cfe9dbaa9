"""A scene solved under an even sky, from which daylight coefficients of its sensors are made.

The scene is solved once, under a sky of luminance 1 cd/m² and the ground that belongs to it. That
gives mesh, form factors, light of the ground, and what an even sky makes of light at every sensor,
direct and after reflections, to the accuracy of a simulation. By direction that is parted, for some
sensors at a time, as memory has room:

* direct light of the sky by the directions open to each sensor (`open_sky`),
* indirect light of sky and sun by beams (`beams`), scaled for each sensor to what the even sky
  makes,
* direct light of the sun not at all: its disc is looked for at each of its places (`sun_light`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .beams import Beams
from .coefficients import Coefficients, Melanopic
from .dome_grid import DomeGrid, dome_grid
from .errors import InputError
from .field import FieldSolver
from .memory import available_bytes
from .model.arrays import FloatArray, IntArray
from .model.bands import SPECTRAL
from .model.colorimetry import melanopic_edi
from .model.reached import NOWHERE
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import CIESky, Ground
from .open_sky import OpenSky
from .simulation import Options, Simulation, Solved
from .solved_field import Field
from .spectra import cct_color
from .stages import Stages
from .sun_light import SunLight

#: Colour of sky and sun: as `PerezSky` and `Sun` have them. [K]
SKY_CCT_K, SUN_CCT_K = 6500.0, 5500.0
#: Size of what sensors lie in against that of their grids, and of elements against that, from which
#: on they are coarse: those of a room are half of it at most, whatever the accuracy.
ROOM, COARSE = 1.5, 0.75
#: Cells that luminances are told at, by which beams come that make light of the sky, and of the
#: sun, as `dome_grid` has them, and points for each unknown; the finer for accuracies below `FINE`.
SKY_PARTS, BEAM_PARTS, SUN_PARTS, POINTS = (4, 8), (3, 4), (6, 8), (16, 36)
FINE = 0.01
#: Memory that the sensors done at a time may take. With less the rays of beams are cast more often:
#: they do not know of sensors. Form factors of a mesh for which that matters took more while they
#: were found. [B]
BLOCK_BYTES = 1_000_000_000
#: What a sensor takes for its cells, the finer ones, and for a block of steps; twice that where
#: melanopic values are told beside. [B]
OF_CELLS = 500_000
#: Sensors done at a time, at least and a multiple of it: those of a chunk of a year's file.
SENSORS = 64
#: Name of the run, for what is kept of it.
BESIDE = "year"


@dataclass(frozen=True, slots=True, eq=False)
class DaylitScene:
    """A scene under an even sky, solved; sensors are those of all grids, one after the other.

    Attributes
    ----------
    scene : SceneData
        The scene under that sky.
    run : Simulation
        Its tolerances.
    solver : FieldSolver
        What solved it.
    solved : Solved
        Its light.
    sky : OpenSky
        What is open from anywhere.
    stages : Stages
        Times, counters and warnings.
    """

    scene: SceneData
    run: Simulation
    solver: FieldSolver
    solved: Solved
    sky: OpenSky
    stages: Stages

    @classmethod
    def of(
        cls,
        scene: SceneData,
        *,
        accuracy: float = 0.02,
        stages: Stages | None = None,
        brightest: Mapping[str, float] = NOWHERE,
    ) -> DaylitScene:
        """Solve ``scene``.

        Parameters
        ----------
        scene : SceneData
            Its sky, sun and lamps do not count. Without a ground it gets ``Ground()``.
        accuracy : float
            As of `simulation.solve`; numbers of cells follow from it, too.
        stages : Stages, optional
            Receives times, counters and warnings.
        brightest : mapping
            Means of grids under the even sky in a brighter state of the scene, by name: no more
            than their accuracy is aimed at. [lx]

        Raises
        ------
        InputError
            For scenes without sensors, with mirrors, and with panes that diffuse.
        """
        check_scene(scene)
        stages = Stages() if stages is None else stages
        even = even_scene(scene)
        options = Options(cache=True, beside=BESIDE, brightest=brightest)
        run = Simulation(even, accuracy, "auto", stages, options)
        solver, kept = run.start()
        solved = run.solved(solver, kept)
        kept.tell()
        run.warn(solved)
        if solver.highlights.any:
            stages.warnings.append(
                "glossy surfaces: through a year they reflect sky and sun as if they were matt"
            )
        if (remark := coarse_elements(even, run.budget.size)) is not None:
            stages.warnings.append(remark)
        # In a cavity of its own nothing hides anything from anything, but its wall the sky.
        sky = OpenSky(even, solver.blockers, trace=solver.trace or solver.in_cavity)
        return cls(even, run, solver, solved, sky, stages)

    def __len__(self) -> int:
        return sum(len(grid) for grid in self.scene.sensors)

    def block(self, reserve: int = 0) -> int:
        """Sensors whose coefficients are found at a time, so much of free memory being left. [B]"""
        free = available_bytes()
        room = None if free is None else free - reserve
        return block_of(len(self.solved.field.unknowns), self.solver.bands, room)

    def coefficients(
        self,
        rows: slice | None = None,
        *,
        suns: FloatArray | None = None,
        sky_parts: int | None = None,
        beam_parts: int | None = None,
        sun_parts: int | None = None,
    ) -> Coefficients:
        """Those of some sensors, all of them when not given.

        Parameters
        ----------
        rows : slice, optional
            Of the sensors.
        suns : (k, 3) array, optional
            Unit vectors to all places of the sun that will be asked for; any when not given.
        sky_parts, beam_parts, sun_parts : int, optional
            Numbers of cells as of `dome_grid`; they follow from the accuracy when not given.
        """
        some = np.arange(len(self))[slice(None) if rows is None else rows]
        fine = int(self.run.budget.accuracy < FINE)
        sky_grid = dome_grid(sky_parts or SKY_PARTS[fine])
        beam_grid = dome_grid(beam_parts or BEAM_PARTS[fine])
        sun_grid = dome_grid(sun_parts or SUN_PARTS[fine])
        sensors, m = self.scene.sensors, len(some)
        points = np.concatenate([grid.points for grid in sensors])[some]
        normals = np.concatenate([grid.normals for grid in sensors])[some]
        with self.stages.run("open sky"):
            exact = self._at("sky.direct")[some]
            direct = self._open(points, normals, sky_grid, exact)
        with self.stages.run("weights of surfaces"):
            weights = self._importance(some)
            beams = self._beams(weights, POINTS[fine])
        with self.stages.run("beams of the sky") as tell:
            by_sky = beams.of_sky(m).coefficients(beam_grid.directions, tell)
        with self.stages.run("beams of the sun") as tell:
            of_sun = beams.of_sun(m)
            by_sun = np.full((len(of_sun.weights), len(sun_grid)), np.nan)
            cells = np.arange(len(sun_grid))
            if suns is not None:
                cells = np.unique(sun_grid.between(suns)[0])
            by_sun[:, cells] = of_sun.coefficients(sun_grid.directions[cells], tell)
        # Of each cell of the sky, beams from its middle: linear between those that were looked at.
        found = beam_grid.interpolated(by_sky, sky_grid.directions) * sky_grid.solid_angle
        found, more = found[:m], found[m:]  # what is left is melanopic
        told, indirect = found.sum(axis=1), self._at("sky.indirect")[some]
        scale = np.where(told > 0.0, indirect / np.where(told > 0.0, told, 1.0), 1.0)
        # There are π lx on the ground in the solve.
        ground = self._at("ground.direct") + self._at("ground.indirect")
        melanopic = None
        if self.solver.bands == SPECTRAL:
            on_ground = self._melanopic_ground(some, weights)
            melanopic = Melanopic(
                sky=_melanopic(SKY_CCT_K),
                sun=_melanopic(SUN_CCT_K),
                indirect=scale[:, None] * more,
                beams=scale[:, None] * by_sun[m:],
                ground_by_sky=on_ground[0],
                ground_by_sun=on_ground[1],
            )
        return Coefficients(
            sky_grid=sky_grid,
            sun_grid=sun_grid,
            direct=direct,
            indirect=scale[:, None] * found,
            beams=scale[:, None] * by_sun[:m],
            ground=ground[some] / math.pi,
            sun=SunLight(self.sky, self.run.budget, points, normals),
            exact_beams=of_sun.first(m),
            beam_scale=scale,
            melanopic=melanopic,
        )

    def _melanopic_ground(
        self, some: IntArray, weights: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Melanopic EDI (m,) at some sensors by a ground in the light of sky, or sun, 1 lx. [lx]

        Of what is reflected in the scene, the ``weights`` (4 m, N) of surfaces tell how melanopic
        it is against its illuminance in the light of the sky, which the solve knows.
        """
        ground = self.solved.field.arriving.components.get("ground.direct")
        straight, indirect = (self._at(f"ground.{part}")[some] for part in ("direct", "indirect"))
        if ground is None:
            return np.zeros(len(some)), np.zeros(len(some))
        lux = (weights @ luminous(ground)).reshape(4, len(some))
        ratios = lux[2:] / np.where(lux[0] > 0.0, lux[0], np.inf)
        by_sky, by_sun = (
            (_melanopic(cct) * straight + ratio * indirect) / math.pi
            for cct, ratio in zip((SKY_CCT_K, SUN_CCT_K), ratios, strict=True)
        )
        return by_sky, by_sun

    def _open(
        self, points: FloatArray, normals: FloatArray, grid: DomeGrid, exact: FloatArray
    ) -> FloatArray:
        """Weights of the cells of the sky at points (m, 3), which add up to ``exact`` (m,) lx."""
        seen, accuracy = self.sky.seen(points, normals, grid, exact), self.run.budget.accuracy
        self.stages.count({"sky_sectors_by_rays": int(seen.by_rays.sum())})
        before = self.stages.figures.get("open_sky_scaled", 0.0)
        self.stages.figures["open_sky_scaled"] = max(before, seen.scaled)
        if before <= accuracy < seen.scaled:
            self.stages.warnings.append(
                f"directions open to the sensors were found to {seen.scaled:.2g} of the light of "
                f"an even sky (root mean square), accuracy {accuracy:g}: they were scaled to it, "
                "but skies with a bright part are off by as much"
            )
        return seen.weights

    def even_light(self) -> tuple[FloatArray, FloatArray]:
        """Light (m,) of the even sky at each sensor, and its stated error. [lx]"""
        grids = self.solved.sensors.values()
        light, error = zip(*((grid.illuminance_lx, grid.error_lx) for grid in grids), strict=True)
        return np.concatenate(light), np.concatenate(error)

    def _at(self, name: str) -> FloatArray:
        """One component (m,) at the sensors of all grids. [lx]"""
        parts = [
            grid.components.get(name, np.zeros(len(grid.points)))
            for grid in self.solved.sensors.values()
        ]
        return np.concatenate(parts)

    def _beams(self, weights: FloatArray, points: int) -> Beams:
        """What beams on the surfaces matter, by the ``weights`` of `_importance`."""
        field = self.solved.field
        element, node, side = _nodes_of(field)
        return Beams.of(
            field.surfaces.elements,
            element,
            node,
            side,
            weights,
            _under_sky(field),
            self.sky,
            points,
        )

    def _importance(self, some: IntArray) -> FloatArray:
        """What illuminance of each unknown adds to that of each of some sensors (c, N).

        In scenes with colours there are two rows of sensors, for the colour of sky and of sun; and
        where the spectrum is asked for two more, for what it adds to melanopic EDI.
        """
        field, unknowns = self.solved.field, self.solved.field.unknowns
        parts, first = [], 0
        for seen in self.solved.seen:
            count = len(seen.rows.factors)
            own = some[(some >= first) & (some < first + count)] - first
            first += count
            if not len(own):
                continue
            rows, asked = seen.rows, replace(seen.asked, sources=field.every)
            if len(own) < count:
                rows, asked = rows.take(own), asked.taken(own)
            factors = self.solver.kept.factors(unknowns, rows, asked)
            parts.append(field.system.importance(factors))
        weights = np.concatenate(parts)  # (m, N, b)
        weights *= field.system.reflectance
        if weights.shape[2] == 1:
            return weights[..., 0]
        bands = self.solver.bands
        colors = [cct_color(cct, bands) for cct in (SKY_CCT_K, SUN_CCT_K)]
        told = [luminous(np.eye(bands))]
        if bands == SPECTRAL:
            told.append(melanopic_edi(np.eye(bands)))
        return np.concatenate([weights @ (one * color) for one in told for color in colors])


def block_of(unknowns: int, bands: int, room: int | None = None) -> int:
    """Sensors done at a time, where light is told by so many unknowns; a multiple of `SENSORS`.

    They take `BLOCK_BYTES`, or the ``room`` that there is where that is less. [B]
    """
    most = BLOCK_BYTES if room is None else min(BLOCK_BYTES, room)
    return SENSORS * max(1, most // (SENSORS * bytes_of_sensor(unknowns, bands)))


def bytes_of_sensor(unknowns: int, bands: int) -> int:
    """Memory that a sensor takes while its coefficients are found, and used. [B]

    Weights as they are found, in all bands together and apart, and in the colours of light; and
    what cells and a block of steps take.
    """
    return 8 * unknowns * (2 + 4 * bands) + OF_CELLS * (2 if bands == SPECTRAL else 1)


def even_scene(scene: SceneData) -> SceneData:
    """The scene under a sky of luminance 1 cd/m², its lamps dark."""
    return replace(
        scene,
        sky=CIESky(5, zenith_luminance_cd_m2=1.0, cct_k=SKY_CCT_K),
        sun=None,
        ground=Ground() if scene.ground is None else scene.ground,
        cameras=(),
        luminaires=(),
        luminaire_index=np.full_like(scene.luminaire_index, -1),
        daylight_factors=None,
    )


def coarse_elements(scene: SceneData, size: float) -> str | None:
    """What to say where elements of a ``size`` are coarse for what the sensors lie in. [m]

    An even sky cuts no elements along the patches of the sun, and elements are as large as the
    whole scene has them, which may be its terrain.
    """
    low, high = scene.patches.bounds()
    around = float((high - low).min())
    for grid in scene.sensors:
        around = max(around, ROOM * float(np.ptp(grid.points, axis=0).max()))
    if size <= COARSE * around:
        return None
    x, y, z = high - low
    return (
        f"elements are up to {size:.2g} m long, as the whole scene is {x:.3g} x {y:.3g} x {z:.3g} "
        "m: coarse for what the sensors lie in, where light of the sun that is reflected may be "
        "told some 15 % too low through a year; leave out terrain that is not needed, or ask for a "
        "smaller accuracy"
    )


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


def _melanopic(cct_k: float) -> float:
    """Melanopic EDI of 1 lx of white light. [lx]"""
    return float(melanopic_edi(cct_color(cct_k, SPECTRAL)))


def _under_sky(field: Field) -> FloatArray:
    """Illuminance (N,) of the unknowns straight from the sky. [lx]"""
    found = field.arriving.components.get("sky.direct")
    return np.zeros(len(field.unknowns)) if found is None else luminous(found)


def _nodes_of(field: Field) -> tuple[IntArray, IntArray, int]:
    """Element (N,) of each unknown, which of its nodes it is, and how many a direction there are.

    Where light is even on elements, each is an unknown as a whole.
    """
    unknowns, elements = field.unknowns, field.surfaces.elements
    if unknowns.basis is None:
        return unknowns.element, np.zeros(len(unknowns), dtype=np.int64), 1
    element, node = np.nonzero((elements.weights > 0.0) & ~elements.buried)
    return element, node, math.isqrt(elements.weights.shape[1])
