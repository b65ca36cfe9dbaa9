"""Skies and suns of weather files, all steps at once, against those of single skies."""

import numpy as np
import pytest
from patchlight.solver.dome_grid import dome_grid
from patchlight.solver.errors import InputError
from patchlight.solver.model import PerezSky
from patchlight.solver.perez import sky_illuminance, sun_of
from patchlight.solver.skies import luminance
from patchlight.solver.sky_series import SkySeries, resampled
from patchlight.solver.sun_position import nearness, sun_positions

from .fixtures_weather import weather


def test_each_step_is_the_sky_of_its_own():
    rng = np.random.default_rng(3)
    direct, diffuse = rng.uniform(0, 900, 24), rng.uniform(20, 400, 24)
    given = {"direct_normal_w_m2": direct, "diffuse_horizontal_w_m2": diffuse}
    skies = SkySeries.of(weather(**given))
    up = np.flatnonzero(skies.altitude_deg > 5.0)
    assert len(up) > 10
    grid = dome_grid(4)
    found = skies.luminances(grid, up)
    for k, step in enumerate(up):
        sky = PerezSky(
            direct_normal_w_m2=direct[step],
            diffuse_horizontal_w_m2=diffuse[step],
            sun_altitude_deg=skies.altitude_deg[step],
            sun_azimuth_deg=skies.azimuth_deg[step],
            sun_nearness=float(nearness(np.array(["2001-06-20"], "datetime64[m]"))[0]),
        )
        assert skies.sky_lx[step] == pytest.approx(sky_illuminance(sky))
        assert skies.sun_normal_lx[step] == pytest.approx(sun_of(sky).normal_illuminance_lx)
        # Scaled as linear between the middles, not as it is: less than half a percent apart.
        np.testing.assert_allclose(found[:, k], luminance(sky, grid.directions), rtol=6e-3)
        assert grid.level @ found[:, k] == pytest.approx(skies.sky_lx[step], rel=1e-12)


def test_night_is_dark():
    skies = SkySeries.of(weather(diffuse_horizontal_w_m2=np.zeros(24)))
    below = skies.altitude_deg <= 0.0
    assert below.any()
    assert not skies.sun_normal_lx[below].any()
    assert not skies.sky_lx.any()
    assert not skies.luminances(dome_grid(1), np.arange(24)).any()


def test_double_radiation_doubles_nothing_else():
    """Light goes with radiation where clearness and brightness stay: both are bounded."""
    overcast = np.zeros(24)
    one = SkySeries.of(
        weather(direct_normal_w_m2=overcast, diffuse_horizontal_w_m2=np.full(24, 700.0))
    )
    two = SkySeries.of(
        weather(direct_normal_w_m2=overcast, diffuse_horizontal_w_m2=np.full(24, 1400.0))
    )
    same = one.brightness == two.brightness
    assert same.any()
    np.testing.assert_allclose(two.sky_lx[same], 2.0 * one.sky_lx[same], rtol=1e-12)
    np.testing.assert_array_equal(two.shape[same], one.shape[same])
    grid, steps = dome_grid(1), np.flatnonzero(same)
    np.testing.assert_allclose(
        two.luminances(grid, steps), 2.0 * one.luminances(grid, steps), rtol=1e-12
    )


def test_sun_in_the_middle_of_the_part_of_a_step_it_is_up():
    known = weather(step=60)
    skies = SkySeries.of(known)
    plain = sun_positions(known.site, known.middles_utc)[0]
    moved = np.flatnonzero(np.abs(skies.altitude_deg - plain) > 1e-9)
    assert 1 <= len(moved) <= 2  # it rises in one step and sets in another
    for step in moved:
        times = known.middles_utc[step] + np.arange(-1800, 1800, 10).astype("timedelta64[s]")
        up = sun_positions(known.site, times)[0] > 0.0
        assert up.any()
        assert not up.all()
        middle = sun_positions(known.site, times[up][[up.sum() // 2]])[0]
        # Found to a twelfth of the hour, in which it climbs by a degree.
        assert skies.altitude_deg[step] == pytest.approx(middle[0], abs=0.7)
        assert skies.altitude_deg[step] > 0.0


def test_southern_hemisphere_and_polar_night():
    noon = SkySeries.of(weather(-33.9, 151.2, 10.0, "2001-12-21"))
    high = int(np.argmax(noon.altitude_deg))
    assert noon.altitude_deg[high] == pytest.approx(90.0 - 33.9 + 23.44, abs=1.5)
    assert abs((noon.azimuth_deg[high] + 180.0) % 360.0 - 180.0) < 30.0  # in the north
    polar = SkySeries.of(weather(78.2, 15.6, 1.0, "2001-12-21"))
    assert (polar.altitude_deg < 0.0).all()
    assert not polar.sun_normal_lx.any()
    assert (polar.suns[:, 2] >= 0.0).all()


def test_nearness():
    """Spencer's series: within 1e-3 of the orbit's extremes, 1 / (1 ∓ 0.0167)²."""
    values = nearness(np.arange("2001-01-01", "2002-01-01", dtype="datetime64[D]"))
    assert values.max() == pytest.approx(1 / (1 - 0.0167) ** 2, abs=1e-3)
    assert values.min() == pytest.approx(1 / (1 + 0.0167) ** 2, abs=1e-3)
    assert int(values.argmax()) < 8 and abs(int(values.argmin()) - 184) < 6
    found = nearness(np.array(["2001-01-03", "2001-07-04", "2001-04-04"], "datetime64[m]"))
    np.testing.assert_allclose(found, [1.0350, 0.9666, 1.0], atol=1.5e-3)


def test_shorter_steps_keep_the_radiation():
    whole = weather(direct_normal_w_m2=np.arange(24.0))
    parts = resampled(whole, 15)
    assert len(parts) == 96
    assert parts.step_minutes == 15
    np.testing.assert_array_equal(parts.starts[:5] - parts.starts[0], [0, 15, 30, 45, 60])
    np.testing.assert_array_equal(
        parts.direct_normal_w_m2.reshape(24, 4).mean(axis=1), whole.direct_normal_w_m2
    )
    middle = parts.middles_utc[:4].astype(np.int64).mean()
    assert middle == whole.middles_utc[0].astype(np.int64)
    assert resampled(whole, 60) is whole


@pytest.mark.parametrize("step", [0, 7, 120, 30.0, True])
def test_steps_that_part_nothing(step):
    with pytest.raises(InputError, match="step_minutes"):
        resampled(weather(), step)
