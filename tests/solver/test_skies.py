"""CIE skies against tabulated integrals and point values, levels, sun and ground."""

import math

import numpy as np
import pytest
from patchlight.solver import skies
from patchlight.solver.kernels.sky_luminance import sky_luminances
from patchlight.solver.model import CIESky, Ground, Sun
from patchlight.solver.model.sky import direction

#: Horizontal illuminance over zenith luminance [sr] for the sun at 15, 30, 45, 60, 75 degrees, by
#: a 400 x 1440 Gauss-Legendre rule over zenith angle and azimuth: another rule than the solver's.
RATIOS = {
    1: (2.4495, 2.4495, 2.4495, 2.4495, 2.4495),
    2: (2.6615, 2.5566, 2.3635, 2.0860, 1.7464),
    3: (2.7700, 2.7700, 2.7700, 2.7700, 2.7700),
    4: (3.0298, 2.8901, 2.6467, 2.3154, 1.9268),
    5: (math.pi,) * 5,
    6: (3.4558, 3.2778, 2.9775, 2.5842, 2.1385),
    7: (3.9021, 3.6730, 3.1431, 2.4212, 1.6713),
    8: (4.4211, 4.1231, 3.3387, 2.3284, 1.4030),
    9: (4.8652, 4.5528, 4.0587, 3.4593, 2.8266),
    10: (5.5937, 5.1449, 4.2534, 3.1703, 2.1391),
    11: (6.4517, 5.8176, 4.4854, 2.9891, 1.7468),
    12: (7.2048, 6.3941, 4.8485, 3.1906, 1.8505),
    13: (8.0729, 6.9952, 4.9827, 3.0259, 1.6309),
    14: (9.1176, 7.7081, 5.3753, 3.2170, 1.7195),
    15: (10.338, 8.1160, 5.2711, 3.0159, 1.5926),
}
#: L / L_z for the sun at 40 degrees, at (zenith angle, azimuth from the sun) = (45, 0), (60, 90),
#: (80, 180), (90, 0) degrees.
POINTS = {
    1: (0.83258, 0.66516, 0.35864, 0.33486),
    2: (1.59958, 0.53473, 0.23838, 0.37935),
    3: (0.90670, 0.81785, 0.67657, 0.66923),
    4: (1.74197, 0.65748, 0.44971, 0.75815),
    5: (1.00000, 1.00000, 1.00000, 1.00000),
    6: (1.92122, 0.80391, 0.66469, 1.13288),
    7: (3.28310, 0.72699, 0.65587, 1.22694),
    8: (4.95917, 0.65535, 0.60647, 1.31776),
    9: (2.45502, 1.26773, 1.50501, 2.67788),
    10: (4.19529, 1.14643, 1.48504, 2.90021),
    11: (6.33705, 1.03345, 1.37318, 3.11490),
    12: (6.59159, 1.13122, 1.86386, 4.81196),
    13: (8.33663, 1.02154, 1.42819, 5.10591),
    14: (8.60676, 1.10117, 1.92984, 10.03833),
    15: (9.45691, 0.95153, 1.17763, 10.55230),
}


def sky(number, altitude=40.0, azimuth=200.0, **level):
    return CIESky(number, sun_altitude_deg=altitude, sun_azimuth_deg=azimuth, **level)


@pytest.mark.parametrize("number", RATIOS)
def test_integrals(number):
    for altitude, expected in zip((15, 30, 45, 60, 75), RATIOS[number], strict=False):
        half_digit = 0.5e-3 if expected > 10.0 else 0.5e-4
        found = skies.diffuse_to_zenith_ratio(sky(number, float(altitude)))
        assert abs(found - expected) <= 1.01 * half_digit


@pytest.mark.parametrize("number", POINTS)
def test_point_values(number):
    places = ((45, 0), (60, 90), (80, 180), (90, 0))
    directions = [direction(90.0 - z, 200.0 + azimuth) for z, azimuth in places]
    found = skies.relative_luminance(sky(number), directions)
    assert found == pytest.approx(POINTS[number], abs=0.51e-5)
    assert skies.relative_luminance(sky(number), [0.0, 0.0, 2.0]) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("altitude", [0.0, 0.5, 20.0, 89.9, 90.0])
@pytest.mark.parametrize("number", [2, 8, 9, 12, 15])
def test_integral_has_converged(number, altitude, monkeypatch):
    here = skies.diffuse_to_zenith_ratio(sky(number, altitude))
    monkeypatch.setattr(skies, "_ORDER", 300)
    assert here == pytest.approx(skies.diffuse_to_zenith_ratio(sky(number, altitude)), rel=1e-8)


@pytest.mark.parametrize("number", range(1, 17))
def test_levels(number):
    asked = sky(number, diffuse_illuminance_lx=12345.0)
    # Hemisphere by another rule: plain midpoints in projected polar coordinates.
    n = 400
    radius = np.sqrt((np.arange(n) + 0.5) / n)
    azimuth = 2 * np.pi * (np.arange(n) + 0.5) / n
    r, q = np.meshgrid(radius, azimuth)
    d = np.stack([r * np.sin(q), r * np.cos(q), np.sqrt(1 - r * r)], axis=-1)
    assert math.pi * skies.luminance(asked, d).mean() == pytest.approx(12345.0, rel=1e-3)
    assert skies.horizontal_illuminance(asked) == 12345.0
    zenith = skies.zenith_luminance(asked)
    assert skies.luminance(asked, [0.0, 0.0, 1.0]) == pytest.approx(zenith, rel=1e-14)
    again = sky(number, zenith_luminance_cd_m2=zenith)
    assert skies.horizontal_illuminance(again) == pytest.approx(12345.0, rel=1e-14)
    assert skies.horizontal_illuminance(sky(number)) == 10000.0  # the default level


def test_traditional_overcast():
    overcast = CIESky(16, zenith_luminance_cd_m2=9000.0)
    assert skies.horizontal_illuminance(overcast) == pytest.approx(7000.0 * math.pi, rel=1e-14)
    assert skies.luminance(overcast, [[1.0, 0.0, 0.0]]).tolist() == [3000.0]
    assert skies.luminance(overcast, direction(30.0, 77.0)) == pytest.approx(6000.0)


@pytest.mark.parametrize("number", range(1, 17))
def test_kernel_is_the_same_sky(number):
    rng = np.random.default_rng(number)
    d = rng.normal(size=(500, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    one = sky(number, diffuse_illuminance_lx=2e4)
    out = np.empty(len(d))
    sky_luminances(skies.sky_parameters(one), *skies.sun_direction(one), d, out)
    assert out == pytest.approx(skies.luminance(one, d), rel=1e-12)
    # Below the horizon too, and exactly on it.
    assert np.isfinite(out).all() and (out > 0.0).all()
    flat = np.array([[0.6, 0.8, 0.0], [0.6, 0.8, -0.0], [0.6, 0.8, 1e-320]])
    sky_luminances(skies.sky_parameters(one), *skies.sun_direction(one), flat, out[:3])
    assert out[:3] == pytest.approx(out[0], rel=1e-14)
    assert out[0] == pytest.approx(skies.luminance(one, flat[0]), rel=1e-12)


def test_sun_towards_east_brightens_the_east():
    east, west = direction(30.0, 90.0), direction(30.0, 270.0)
    one = CIESky(12, sun_altitude_deg=30.0, sun_azimuth_deg=90.0)
    assert skies.luminance(one, east) > 10.0 * skies.luminance(one, west)


def test_sun_on_the_ground():
    high = Sun(30.0, 180.0, normal_illuminance_lx=80000.0)
    assert skies.sun_horizontal_illuminance(high) == pytest.approx(40000.0)
    radius = math.radians(16 / 60)
    solid_angle_cosine = math.pi * math.sin(radius) ** 2
    assert skies.sun_luminance(high) * solid_angle_cosine == pytest.approx(80000.0)


@pytest.mark.parametrize("altitude_radii", [-0.9, -0.3, 0.0, 0.4, 0.99, 1.0])
def test_rising_sun_is_cut_by_the_horizon(altitude_radii):
    radius_deg = 5.0  # large, so that curvature counts
    sun = Sun(altitude_radii * radius_deg, 0.0, 1000.0, angular_radius_arcmin=60 * radius_deg)
    radius = math.radians(radius_deg)
    n = 1500
    # Equal pieces of sin² of the angle from the centre: equal shares of E_n.
    angle = np.arcsin(np.sqrt((np.arange(n) + 0.5) / n) * math.sin(radius))
    psi = 2 * np.pi * (np.arange(n) + 0.5) / n
    a = math.radians(sun.altitude_deg)
    z = np.cos(angle)[:, None] * math.sin(a) + np.sin(angle)[:, None] * math.cos(a) * np.cos(psi)
    expected = (np.maximum(z, 0.0) / np.cos(angle)[:, None]).mean() * 1000.0
    assert skies.sun_horizontal_illuminance(sun) == pytest.approx(expected, abs=2e-3)
    assert skies.sun_horizontal_illuminance(Sun(-1.0, 0.0, 1000.0)) == 0.0


def test_ground():
    overcast, sun = CIESky(16, diffuse_illuminance_lx=9000.0), Sun(30.0, 0.0, 2000.0)
    assert skies.ground_luminance(Ground(0.2), overcast, sun) == pytest.approx(2000.0 / math.pi)
    assert skies.ground_luminance(Ground(None), overcast, sun) == 0.0
    assert skies.ground_luminance(None, overcast, sun) == 0.0
    assert skies.ground_luminance(Ground(0.5), None, sun) == pytest.approx(500.0 / math.pi)
