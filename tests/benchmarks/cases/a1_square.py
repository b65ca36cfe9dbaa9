"""A square source over grids close to it and farther away."""

import numpy as np
import truths
from case import Body, Case, RadianceSetting, accuracies, samples
from shapes import Rectangle

SOURCE = Rectangle((-1.0, -1.0, 0.0), (0.0, 2.0, 0.0), (2.0, 0.0, 0.0))  # facing down


def _case(name: str, depths: tuple[float, ...], **more) -> Case:
    t = np.linspace(-3.0, 3.0, 41)
    x, y = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    points = np.concatenate([np.stack([x, y, np.full_like(x, -d)], axis=1) for d in depths])
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return Case(
        name=name,
        title=f"square source 2 x 2, grids 6 x 6 at depths {', '.join(map(str, depths))} m",
        bodies=(Body(SOURCE, radiance=1.0),),
        points=points,
        normals=normals,
        truth=lambda: truths.polygon(points, normals, SOURCE.corners()),
        how="closed form (Lambert's polygon formula)",
        patchlight=accuracies(1e-2, 1e-4, 1e-6),
        **more,
    )


NEAR = _case(
    "A1_near",
    (0.05, 0.2),
    radiance=(
        RadianceSetting((4, 4), "-ab 0 -ds 0.2"),
        RadianceSetting((8, 8), "-ab 0 -ds 0.2"),
        RadianceSetting((8, 8), "-ab 0 -ds 0.1"),
        RadianceSetting((16, 16), "-ab 0 -ds 0.05"),
        RadianceSetting((32, 32), "-ab 0 -ds 0.05"),
    ),
    mitsuba=samples(256, 1024, 4096, 16384, 65536, direct="mis"),
)
FAR = _case(
    "A1_far",
    (0.5, 1.0, 2.0, 3.0),
    radiance=(
        RadianceSetting((1, 1), "-ab 0 -ds 0.2"),
        RadianceSetting((1, 1), "-ab 0 -ds 0.02"),
        RadianceSetting((2, 2), "-ab 0 -ds 0.1"),
        RadianceSetting((16, 16), "-ab 0 -ds 0"),
        RadianceSetting((4, 4), "-ab 0 -ds 0.02"),
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384),
)
