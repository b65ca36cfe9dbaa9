"""Closed forms that Radiance, set up as for the comparison, must meet before it is believed.

Every check runs the exporter and the options of the comparison.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model import BLACK, CIESky, Ground, Luminaire, Material, PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.scene import ScenePart
from radiance_run import Radiance, direct, indirect
from radiance_scene import Fineness, dome_as_glow, surfaces


@dataclass(frozen=True, slots=True)
class Check:
    """A value, the truth and the noise (one standard deviation) of the value. [lx]"""

    name: str
    value: float
    truth: float
    noise: float
    bound: float

    @property
    def error(self) -> float:
        """Relative error."""
        return self.value / self.truth - 1.0

    @property
    def passed(self) -> bool:
        """Within the bound and three standard deviations."""
        return abs(self.error) <= self.bound + 3.0 * self.noise / self.truth


def run_checks(radiance: Radiance, *, quick: bool = False) -> list[Check]:
    """All checks."""
    checks = [_cavity(radiance, rho, quick) for rho in (0.5, 0.8)]
    checks.append(_half_cylinder(radiance))
    checks.extend(_open_sky(radiance, quick))
    return checks


def _scene(patches: PatchSet, rho: float, lamps: np.ndarray, lamp: Luminaire | None) -> SceneData:
    n = len(patches)
    material = np.full((n, 2), BLACK)
    material[~lamps, 0] = 0
    luminaire = np.full((n, 2), -1)
    luminaire[lamps, 0] = 0
    return SceneData(
        patches=patches,
        two_sided=np.zeros(n, bool),
        closed=np.ones(n, bool),
        material_index=material,
        luminaire_index=luminaire,
        parts=(ScenePart("check", "check", "solid"),),
        faces=(),
        materials=(Material(rho),),
        luminaires=() if lamp is None else (lamp,),
    )


def _lamp(flux: float, area: float) -> Luminaire:
    return Luminaire("check", "lamps", flux, area, np.ones(3), 4000.0)


def _mean(values: FloatArray) -> tuple[float, float]:
    """Mean over sensors and its standard deviation, from repeats (k, n, 3) of a grey scene."""
    means = values[..., 1].mean(axis=1)
    spread = float(means.std(ddof=1)) / math.sqrt(len(means)) if len(means) > 1 else 0.0
    return float(means.mean()), spread


def _cavity(radiance: Radiance, rho: float, quick: bool) -> Check:
    """Sphere of radius 1 lit by a black disc across a cap: E = π L f / (1 − ρ (1 − f)).

    f = (1 − cos θ) / 2 is the cap's share of the sphere; seen from the rest of it, the disc and the
    cap send the same light, and exchange inside a sphere is uniform.
    """
    aperture = 0.2
    height = math.sqrt(1.0 - aperture**2)
    ball = PatchSet.sphere((0, 0, 0), 1.0, inward=True)
    disc = PatchSet.disk((0, 0, height), aperture, (0, 0, -1))
    patches = PatchSet.concatenated(ball, disc)
    lamps = np.arange(len(patches)) >= len(ball)
    area = math.pi * aperture**2
    scene = _scene(patches, rho, lamps, _lamp(math.pi * area, area))
    octree = radiance.octree(
        f"cavity{rho}", surfaces(scene, lit="lamps", fineness=Fineness(24, 8, 2))
    )
    z = np.linspace(-0.9, 0.7, 9)
    turn = 2.4 * np.arange(9)
    ring = np.sqrt(1.0 - z * z)
    outward = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    # In front of the facets, which lie up to 1e-3 inside the sphere.
    traced = radiance.trace(
        octree, 0.998 * outward, -outward, indirect(32 if quick else 256, 0.2), repeats=6
    )
    share = 0.5 * (1.0 - height)
    truth = math.pi * share / (1.0 - rho * (1.0 - share))
    return Check(f"sphere cavity, rho {rho}", *_order(traced.irradiance, truth), 0.004)


def _order(values: FloatArray, truth: float) -> tuple[float, float, float]:
    mean, noise = _mean(values)
    return mean, truth, noise


def _half_cylinder(radiance: Radiance) -> Check:
    """A tube like the demo's lamps, against a quadrature over the exact surface."""
    radius, half = 0.08, 0.6
    tube = PatchSet.cylinder((-half, 0, 1.2), (half, 0, 1.2), radius)
    scene = _scene(
        tube, 0.0, np.ones(len(tube), bool),
        _lamp(math.pi * 4 * math.pi * radius * half, 4 * math.pi * radius * half),
    )  # fmt: skip
    octree = radiance.octree("tube", surfaces(scene, lit="lamps", fineness=Fineness()))
    points = np.array([(x, y, 0.0) for x in (0.0, 0.5, 1.5) for y in (0.0, 0.4, 1.5)])
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    traced = radiance.trace(octree, points, normals, direct())
    truth = np.mean([_tube(p, radius, half) for p in points])
    return Check("tube lamp, direct", *_order(traced.irradiance, float(truth)), 0.002)


def _tube(point: FloatArray, radius: float, half: float) -> float:
    """Irradiance of an upward element under a tube along x with its axis 1.2 above. [lx]"""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    x = half * nodes[:, None]
    # The visible arc is |angle| < acos(r / d) about the direction to the point.
    d = math.hypot(point[1], 1.2)
    limit, towards = math.acos(radius / d), math.atan2(-1.2, point[1])
    q = (towards + limit * nodes)[None, :]
    n = np.stack(np.broadcast_arrays(0.0 * x, np.cos(q), np.sin(q)), axis=-1)
    s = np.stack(np.broadcast_arrays(x, radius * np.cos(q), 1.2 + radius * np.sin(q)), axis=-1)
    v = s - point
    r2 = (v * v).sum(-1)
    cosines = np.maximum(v[..., 2], 0.0) * np.maximum(-(n * v).sum(-1), 0.0) / r2
    return float(
        ((cosines / r2) * weights[:, None] * weights[None, :]).sum() * half * limit * radius
    )


def _open_sky(radiance: Radiance, quick: bool) -> list[Check]:
    """Unobstructed overcast sky and ground: up E, down ρ E, upright E (π/6 + 4/9) / (7π/9)."""
    far = PatchSet.box((0.01, 0.01, 0.01), center=(0, 0, -1e4))
    scene = _scene(far, 0.0, np.zeros(len(far), bool), None)
    scene = _with_sky(scene)
    sky = radiance.octree(
        "open_sky", surfaces(scene, lit=None, fineness=Fineness()), dome_as_glow(scene, "sky")
    )
    ground = radiance.octree(
        "open_ground", surfaces(scene, lit=None, fineness=Fineness()), dome_as_glow(scene, "ground")
    )
    upright = 1e4 * (math.pi / 6.0 + 4.0 / 9.0) / (7.0 * math.pi / 9.0)
    checks = []
    for octree, normal, truth, name in (
        (sky, (0, 0, 1), 1e4, "open sky, upward"),
        (sky, (0, 1, 0), upright, "open sky, upright"),
        (ground, (0, 0, -1), 2e3, "open ground, downward"),
        (ground, (0, 1, 0), 1e3, "open ground, upright"),
    ):
        options = direct(ab=1, ad=4096 if quick else 16384)
        traced = radiance.trace(
            octree, np.zeros((1, 3)), np.array([normal], float), options, repeats=6
        )
        checks.append(Check(name, *_order(_grey(traced.irradiance), truth), 0.002))
    return checks


def _grey(values: FloatArray) -> FloatArray:
    from patchlight.solver.model.result import luminous

    return np.repeat(luminous(values)[..., None], 3, axis=-1)


def _with_sky(scene: SceneData) -> SceneData:
    import dataclasses

    return dataclasses.replace(scene, sky=CIESky(16), ground=Ground(0.2))
