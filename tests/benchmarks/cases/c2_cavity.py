"""A sphere lit by a black disk across a cap of it: the irradiance of the wall is uniform.

The form factor from any point of the wall to the disk is that to the cap, f = (1 − sqrt(1 − a²))/2
of aperture radius a, so that E = π f / (1 − ρ (1 − f)). A little inside the wall the direct part
changes: there E = π F + ρ E_wall (1 − F), with F to the disk from that point.
"""

import math

import numpy as np
import truths
from case import Body, Case, RadianceSetting, accuracies, samples
from patchlight.solver.model.arrays import FloatArray
from shapes import Disk, OpenCavity

APERTURE = 0.2
TOP = math.sqrt(1.0 - APERTURE**2)
#: Distance of the sensors from the wall. [m]
INSET = 1e-4


def _sensors() -> tuple[FloatArray, FloatArray]:
    """Even in height up to shortly below the disk, turning by the golden angle."""
    k = np.arange(199)
    z, turn = -1.0 + 0.0097 * (k + 0.5), math.pi * (3.0 - math.sqrt(5.0)) * (k + 0.5)
    ring = np.sqrt(1.0 - z * z)
    out = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    return (1.0 - INSET) * out, -out


POINTS, NORMALS = _sensors()


def _truth(rho: float) -> FloatArray:
    f = 0.5 * (1.0 - TOP)
    wall = math.pi * f / (1.0 - rho * (1.0 - f))
    direct = truths.disk(POINTS, NORMALS, (0.0, 0.0, TOP), APERTURE, (0.0, 0.0, -1.0))
    return direct + rho * wall * (1.0 - direct / math.pi)


def _case(name: str, rho: float, **more) -> Case:
    return Case(
        name=name,
        title=f"spherical cavity of reflectance {rho}, lit by a disk of radius 0.2 m in its top",
        bodies=(
            Body(Disk((0.0, 0.0, TOP), APERTURE, (0.0, 0.0, -1.0)), radiance=1.0, solid=0),
            Body(OpenCavity((0.0, 0.0, 0.0), 1.0, TOP), reflectance=rho, solid=0),
        ),
        points=POINTS,
        normals=NORMALS,
        truth=lambda: _truth(rho),
        how="closed form",
        patchlight=accuracies(0.5, 0.3, 0.1, 0.05, 0.02),
        **more,
    )


DARK = _case(
    "C2_rho50",
    0.5,
    radiance=tuple(
        RadianceSetting((8, 0), f"-ds 0 -ab 20 -ad {ad} -lr -20 -lw {0.05 / ad:.1e}", False)
        for ad in (8, 32, 128, 512)
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, depth=24),
)
BRIGHT = _case(
    "C2_rho80",
    0.8,
    radiance=tuple(
        RadianceSetting((8, 0), f"-ds 0 -ab 40 -ad {ad} -lr -40 -lw {0.01 / ad:.1e}", False)
        for ad in (8, 32, 128, 512)
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, depth=64),
)
