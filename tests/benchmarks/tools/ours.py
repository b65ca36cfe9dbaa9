"""Patchlight in this process: the whole simulation where anything reflects, else straight light.

Straight light of sources is form factors alone; that of sky and sun what a simulation finds of them
at its sensors, without its elements.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from case import Body, Case, OurSetting
from patchlight.solver import point_form_factors
from patchlight.solver.model import (
    BLACK,
    CIESky,
    Luminaire,
    Material,
    PatchSet,
    SceneData,
    Sensors,
    Sun,
)
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.scene import ScenePart
from patchlight.solver.prepared import forget
from tools import Run


class Ours:
    """Straight light where nothing reflects, unless a setting asks for a whole simulation."""

    name = "patchlight"

    def version(self) -> str:
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("patchlight")
        except PackageNotFoundError:
            return "checkout"

    def __init__(self) -> None:
        self._lit: dict[str, Lit] = {}
        self._scenes: dict[str, SceneData] = {}  # loaded, as those of the other tools are

    def settings(self, case: Case) -> tuple[OurSetting, ...]:
        if case.reflects:
            return case.patchlight
        straight = [setting for setting in case.patchlight if not setting.whole]
        return (*case.patchlight, OurSetting(straight[-1].accuracy, new=True))

    def prepare(self, case: Case, setting: OurSetting) -> float:
        """Make the patches, and compile the kernels on a few sensors; CPU seconds."""
        import dataclasses

        start = time.process_time()
        if case.reflects or case.has_sky:
            self._scenes[case.name] = scene_data(case)
        else:
            self._lit[case.name] = Lit.of(case)
        few = slice(None, None, max(1, len(case.points) // 4))
        small = dataclasses.replace(case, points=case.points[few], normals=case.normals[few])
        rough = OurSetting(max(setting.accuracy, 0.1), whole=setting.whole)
        if small.name in self._scenes:
            _simulated(small, scene_data(small), rough)
        else:
            self.run(small, rough)
        return time.process_time() - start

    def run(self, case: Case, setting: OurSetting) -> Run:
        if setting.new:
            forget()
        start = time.process_time()
        if case.name in self._scenes:
            values = _simulated(case, self._scenes[case.name], setting)
        else:
            values = self._lit[case.name].irradiance(case, setting.accuracy)
        return Run(values, time.process_time() - start)


class Lit(NamedTuple):
    """Sources with their radiance (n,), and what hides them."""

    patches: PatchSet
    radiance: FloatArray
    blockers: PatchSet | None

    @classmethod
    def of(cls, case: Case) -> Lit:
        lit = [body for body in case.bodies if body.radiance > 0.0]
        dark = [body.shape.patches() for body in case.bodies if body.radiance == 0.0]
        sources = [body.shape.patches() for body in lit]
        return cls(
            PatchSet.concatenated(*sources),
            np.repeat([body.radiance for body in lit], [len(s) for s in sources]),
            PatchSet.concatenated(*dark) if dark else None,
        )

    def irradiance(self, case: Case, accuracy: float) -> FloatArray:
        found = point_form_factors(
            case.points, case.normals, self.patches, self.blockers, accuracy=accuracy
        )
        return np.asarray(np.pi * found.value @ self.radiance)


def scene_data(case: Case) -> SceneData:
    """The case as the solver's scene: 1 W/m² stands for 1 lx."""
    bodies = [body for body in case.bodies if not body.sky]
    zenith = [body.radiance for body in case.bodies if body.sky]
    sets = [body.shape.patches() for body in bodies]
    rows = np.repeat(np.arange(len(sets)), [len(s) for s in sets])
    numbers = {key: k for k, key in enumerate(dict.fromkeys(map(_part, enumerate(bodies))))}
    part = np.array([numbers[_part(item)] for item in enumerate(bodies)])
    joined = PatchSet.concatenated(*sets)
    patches = PatchSet(joined.control_points, np.full(len(joined), -1), part[rows])
    levels = sorted({body.reflectance for body in bodies} - {0.0})
    material = np.array([levels.index(b.reflectance) if b.reflectance else BLACK for b in bodies])
    lamps, lamp = [], np.full(len(sets), -1)
    for k, (body, own) in enumerate(zip(bodies, sets, strict=True)):
        if body.radiance > 0.0:
            area = float(own.areas().sum())
            lamp[k] = len(lamps)
            flux = np.pi * body.radiance * area
            lamps.append(Luminaire(f"lamp{k}", "lamps", flux, area, np.ones(3), 4000.0))
    two_sided = np.array([body.two_sided for body in bodies])[rows]
    back = np.full(len(joined), -1)
    return SceneData(
        patches=patches,
        two_sided=two_sided,
        closed=np.array([body.solid >= 0 for body in bodies])[rows],
        material_index=np.stack(
            [material[rows], np.where(two_sided, material[rows], BLACK)], axis=1
        ),
        luminaire_index=np.stack([lamp[rows], back], axis=1),
        parts=tuple(
            ScenePart(f"part{k}", "case", "patches" if key[0] < 0 else "solid")
            for key, k in numbers.items()
        ),
        faces=(),
        materials=tuple(Material(level) for level in levels),
        luminaires=tuple(lamps),
        sky=_sky(case, zenith[0]) if zenith and case.disc is None else None,
        sun=_sun(case),
        ground=None,
        sensors=(Sensors("sensors", case.points, case.normals),),
    )


def _sky(case: Case, zenith: float) -> CIESky:
    if case.sun is None:
        return CIESky(16, zenith_luminance_cd_m2=zenith)
    altitude, azimuth = case.sun
    return CIESky(
        12, sun_altitude_deg=altitude, sun_azimuth_deg=azimuth, zenith_luminance_cd_m2=zenith
    )


def _part(item: tuple[int, Body]) -> tuple[int, int]:
    k, body = item
    return (body.solid, 0) if body.solid >= 0 else (-1, k)


def _sun(case: Case) -> Sun | None:
    if case.disc is None:
        return None
    disc = case.disc
    return Sun(disc.altitude, disc.azimuth, 1.0, angular_radius_arcmin=60.0 * disc.radius)


def _simulated(case: Case, scene: SceneData, setting: OurSetting) -> FloatArray:
    if not (case.reflects or setting.whole):
        return _daylight(scene, setting.accuracy)
    from patchlight.pipeline import simulate

    result = simulate(scene, accuracy=setting.accuracy, cache=False)
    return result.sensors["sensors"].illuminance_lx


def _daylight(scene: SceneData, accuracy: float) -> FloatArray:
    """Straight light of sky and sun at the sensors, as a simulation finds it, and no other. [lx]"""
    from patchlight.solver.model.result import luminous
    from patchlight.solver.simulation import Options, Simulation
    from patchlight.solver.stages import Stages
    from patchlight.solver.surfaces import Receivers

    simulation = Simulation(scene, accuracy, "auto", Stages(), Options())
    solver, _ = simulation.start()
    light = solver.outside(Receivers.of_sensors(scene.sensors[0]), simulation.budget)
    return np.asarray(luminous(sum(light.direct.values())))
