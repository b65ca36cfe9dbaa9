"""Weather made up for tests."""

import numpy as np
from patchlight.solver.model import Site, Weather
from patchlight.solver.model.arrays import frozen


def weather(latitude=48.0, longitude=9.0, zone=1.0, first="2001-06-20", days=1, step=60, **given):
    """Weather with the same radiation in all steps, unless ``given``."""
    n = days * 1440 // step
    starts = np.datetime64(first, "m") + step * np.arange(n)
    values = {
        "direct_normal_w_m2": np.full(n, 500.0),
        "diffuse_horizontal_w_m2": np.full(n, 100.0),
        "dew_point_c": np.full(n, np.nan),
        **given,
    }
    return Weather(
        site=Site(latitude, longitude),
        place="nowhere",
        utc_offset_h=zone,
        step_minutes=step,
        starts=frozen(starts, "datetime64[m]"),
        direct_normal_lx=None,
        diffuse_horizontal_lx=None,
        albedo=frozen(np.full(n, 0.2)),
        source="made by a test",
        sha256="0" * 64,
        **{name: frozen(array) for name, array in values.items()},
    )
