"""Radiance's ``rtrace``, one process a run; its start-up counts, the octree does not."""

from __future__ import annotations

import numpy as np
from case import Case, Disc, RadianceSetting
from patchlight.solver.model.sky import direction
from radiance_scene import polygon_text
from tools import Missing, Run

#: `rtrace -I` evaluates this far in front of the point given. [m]
AHEAD = 1e-4

#: Luminance of the traditional overcast sky against the zenith's; Dz is the sine of the altitude.
OVERCAST = "if(Dz,(1+2*Dz)/3,0)"
#: The same of CIE type 12 with the sun in the direction (x, y, z).
CLEAR = (
    "if(Dz,(1-exp(-0.32/Dz))*(1+10*(exp(-3*acos(Dx*{x}+Dy*{y}+Dz*{z}))-exp(-1.5*PI))"
    "+0.45*sq(Dx*{x}+Dy*{y}+Dz*{z}))/((1-exp(-0.32))*(1+10*(exp(-3*acos({z}))-exp(-1.5*PI))"
    "+0.45*sq({z}))),0)"
)

#: No cache and no interpolation unless the setting asks for them, and nothing left to chance.
BASE = "-aa 0 -as 0 -av 0 0 0 -dt 0 -dc 1 -dj 0 -dr 0 -st 1 -u+".split()


class RadianceTool:
    """Luminous surfaces are cut into polygons: Radiance parts a source into 64 pieces at most."""

    name = "radiance"

    def __init__(self) -> None:
        self._octrees: dict[tuple[str, tuple[int, int]], str] = {}
        self._radiance = None

    def version(self) -> str:
        try:
            from radiance_run import Radiance

            self._radiance = Radiance()
        except ImportError as error:
            raise Missing(f"{error}; it comes with patchlight[peers]") from error
        return self._radiance.version

    def settings(self, case: Case) -> tuple[RadianceSetting, ...]:
        return case.radiance

    def prepare(self, case: Case, setting: RadianceSetting) -> float:
        """Write the scene and compile its octree, unless that is done; its time is not taken."""
        key = (case.name, setting.cut)
        if key not in self._octrees:
            name = f"{case.name}_{setting.cut[0]}x{setting.cut[1]}"
            self._octrees[key] = self._radiance.octree(name, scene_text(case, setting.cut))
        return 0.0

    def run(self, case: Case, setting: RadianceSetting) -> Run:
        points = case.points - AHEAD * case.normals if setting.shift else case.points
        octree = self._octrees[(case.name, setting.cut)]
        options = [*BASE, *setting.options.split()]
        traced = self._radiance.trace(octree, points, case.normals, options, timeout_s=300.0)
        return Run(traced.irradiance[0, :, 1].copy(), traced.cpu_s)


def scene_text(case: Case, cut: tuple[int, int]) -> str:
    """The case as Radiance text; luminous surfaces are black, as in all cases."""
    lines = []
    for k, body in enumerate(case.bodies):
        primitive = body.shape.radiance()
        if body.radiance > 0.0:
            rings, scale = body.shape.cut(*cut)
            level = f"{body.radiance * scale:.9g}"
            pattern = "void"
            if body.sky:
                lines.append(f"void brightfunc p{k} 2 {_luminance(case)} . 0 0")
                pattern = f"p{k}"
            lines.append(f"{pattern} light m{k} 0 0 3 {level} {level} {level}")
            lines += polygon_text(f"m{k}", f"b{k}", rings)
            continue
        if body.sky:
            continue  # open: the sun's disc shines through it
        rho = f"{body.reflectance:.9g}"
        lines.append(f"void plastic m{k} 0 0 5 {rho} {rho} {rho} 0 0")
        if primitive is None:
            lines += polygon_text(f"m{k}", f"b{k}", body.shape.cut(*cut)[0])
        else:
            kind, numbers = primitive
            text = " ".join(f"{x:.10g}" for x in np.asarray(numbers))
            lines.append(f"m{k} {kind} b{k} 0 0 {len(numbers)} {text}")
    if case.disc is not None:
        lines += _suns(case.disc, cut)
    return "\n".join(lines) + "\n"


def _suns(disc: Disc, cut: tuple[int, int]) -> list[str]:
    """The sun's disc as many small ones in the pattern of a sunflower."""
    count = cut[0] * cut[1]
    toward = np.array(direction(disc.altitude, disc.azimuth))
    across = np.cross(toward, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    upward = np.cross(across, toward)
    # Evenly over the disc projected onto the plane that faces it, which adds up to 1 lx there.
    sine = np.sin(np.radians(disc.radius)) * np.sqrt((np.arange(count) + 0.5) / count)
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    # Radiance takes the solid angle of a source from its angle, rim to rim.
    part = 2.0 * disc.radius / np.sqrt(count)
    level = 1.0 / (2.0 * np.pi * (1.0 - np.cos(0.5 * np.radians(part))) * count)
    lines = [f"void light sun 0 0 3 {level:.12g} {level:.12g} {level:.12g}"]
    for radius, turn in zip(sine, angle, strict=True):
        away = radius * (np.cos(turn) * across + np.sin(turn) * upward)
        x, y, z = away + np.sqrt(1.0 - radius**2) * toward
        lines.append(f"sun source s{len(lines)} 0 0 4 {x:.12g} {y:.12g} {z:.12g} {part:.12g}")
    return lines


def _luminance(case: Case) -> str:
    if case.sun is None:
        return OVERCAST
    x, y, z = direction(*case.sun)
    return CLEAR.format(x=f"({x:.12f})", y=f"({y:.12f})", z=f"({z:.12f})")
