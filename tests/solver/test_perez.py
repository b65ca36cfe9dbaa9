"""All-weather skies from irradiance: coefficients, level, and the light of a scene under one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from patchlight.solver.errors import InputError
from patchlight.solver.model import PerezSky
from patchlight.solver.perez import (
    air_mass,
    brightness,
    clearness,
    efficacies,
    in_form_of_cie,
    shapes,
    sun_of,
)
from patchlight.solver.simulation import solve
from patchlight.solver.skies import horizontal_illuminance, luminance, sky_tone

from .fixtures_light import UP, ceiling, grid, scene, setup

#: What `gendaylit -ang ALTITUDE 0 -W DIRECT DIFFUSE -O 2` of Radiance 6.0a prints or computes on
#: the way: ε, Δ, a … e, illuminances of sky and sun. Without a date it takes the sun's nearness of
#: the day before the year.
NEARNESS = 1.034979
PRINTED = [
    (40, 700, 120, 4.4480, 0.1317,
     (-1.041704, -0.296592, 13.054383, -3.455195, 0.267327), 17915, 69762),
    (40, 0, 200, 1.0000, 0.2195,
     (0.793534, -0.510540, 0.967628, -0.666441, -0.008293), 23509, 0),
    (20, 100, 150, 1.2300, 0.3074,
     (-1.126183, -0.884724, 10.237363, -2.918958, 0.099690), 17901, 8468),
    (60, 850, 90, 9.2166, 0.0734,
     (-0.989814, -0.207278, 22.213997, -6.015554, 1.321415), 12111, 88045),
    (60, 300, 300, 1.8700, 0.2446,
     (-0.871010, -0.655070, 15.200339, -3.204830, 0.267681), 36319, 29183),
    (10, 400, 40, 3.6085, 0.1578,
     (-1.059523, -0.320377, 13.139773, -3.374232, 0.434434), 6442, 28050),
    (40, 350, 150, 2.3792, 0.1646,
     (-1.005403, -0.477853, 13.788334, -3.284768, 0.034342), 21120, 33479),
    (50, 750, 110, 6.0348, 0.1014,
     (-0.970560, -0.210095, 15.500299, -3.924792, 0.637560), 15071, 77502),
    (60, 100, 60, 2.4500, 0.0489,
     (-1.043242, -0.623728, 14.945752, -3.258365, 0.016637), 9871, 9788),
    (75, 50, 350, 1.1402, 0.2559,
     (-0.988369, -1.135854, 8.663312, -2.161449, 0.195233), 40416, 4760),
]  # fmt: skip


@pytest.mark.parametrize("printed", PRINTED)
def test_as_gendaylit_has_it(printed):
    altitude, direct, diffuse, e, d, s, x, y = printed
    zenith, one = np.radians([90.0 - altitude]), np.ones(1)
    epsilon = clearness(direct * one, diffuse * one, zenith)
    delta = brightness(diffuse * one, zenith, NEARNESS * one)
    np.testing.assert_allclose(epsilon, e, atol=6e-5)
    np.testing.assert_allclose(delta, d, atol=6e-5)
    # Printed to six places, of an angle in single precision.
    np.testing.assert_allclose(shapes(epsilon, delta, zenith)[0], s, rtol=3e-5, atol=6e-5)
    of_sky, of_sun = efficacies(epsilon, delta, zenith, 10.97 * one)
    np.testing.assert_allclose([of_sky[0] * diffuse, of_sun[0] * direct], [x, y], rtol=1e-4, atol=1)


def test_air_mass():
    """At the zenith, 60 and 85 degrees from it, and at the horizon, by Kasten 1966."""
    found = air_mass(np.radians([0.0, 60.0, 85.0, 90.0]))
    np.testing.assert_allclose(found, [0.9995, 1.9928, 10.323, 36.51], rtol=2e-4)


WAYS = np.random.default_rng(5).normal(size=(300, 3)) * (1.0, 1.0, 0.7)
WAYS[:, 2] = np.abs(WAYS[:, 2])
WAYS[0] = 0.0, 0.0, 1.0

SKIES = [
    PerezSky(direct_normal_w_m2=a, diffuse_horizontal_w_m2=b, sun_altitude_deg=h, sun_azimuth_deg=z)
    for h, a, b, z in [(40, 700, 120, 200), (40, 0, 200, 90), (10, 400, 40, 270), (90, 900, 80, 0)]
]


@pytest.mark.parametrize("sky", SKIES)
def test_its_light_is_what_the_irradiance_makes(sky):
    """The dome's integral of the published form is proportional, and of the level is the level."""
    x, w = leggauss(400)
    rise, turn = 0.25 * np.pi * (x + 1.0), np.pi * (x + 1.0)
    dz = np.sin(rise)[:, None] + 0.0 * turn
    flat = np.cos(rise)[:, None]
    way = np.stack([flat * np.sin(turn), flat * np.cos(turn), dz], axis=-1)
    part = 0.25 * np.pi * w[:, None] * np.pi * w * dz * flat
    light = luminance(sky, way)
    assert (light > 0.0).all()
    # Gauss meets the cusp at the sun to 1e-3.
    assert (light * part).sum() == pytest.approx(horizontal_illuminance(sky), rel=2e-3)
    zenith = np.radians([90.0 - sky.sun_altitude_deg])
    epsilon = clearness(
        *np.array([[sky.direct_normal_w_m2], [sky.diffuse_horizontal_w_m2]]), zenith
    )
    delta = brightness(np.array([sky.diffuse_horizontal_w_m2]), zenith, np.ones(1))
    a, b, c, d, e = shapes(epsilon, delta, zenith)[0]
    sun = np.radians([sky.sun_azimuth_deg, sky.sun_altitude_deg])
    to_sun = np.array(
        [np.sin(sun[0]) * np.cos(sun[1]), np.cos(sun[0]) * np.cos(sun[1]), np.sin(sun[1])]
    )
    cosine = np.clip(way @ to_sun, -1.0, 1.0)
    published = (1 + a * np.exp(b / dz)) * (1 + c * np.exp(d * np.arccos(cosine)) + e * cosine**2)
    ratio = light / published
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-6)


def test_no_sky_is_darker_than_black():
    """Over all that a sensor may say of itself, however unlikely."""
    rng = np.random.default_rng(3)
    n = 20_000
    zenith, direct = rng.uniform(0.0, 0.5 * np.pi, n), rng.uniform(0.0, 1100.0, n)
    diffuse = rng.uniform(0.1, 1500.0, n)
    epsilon = clearness(direct, diffuse, zenith)
    a, b, c, d, e = in_form_of_cie(
        shapes(epsilon, brightness(diffuse, zenith, np.ones(n)), zenith)
    ).T
    assert (b <= 0.0).all()
    for z in (0.01, 0.1, 0.5, 1.0):
        assert (1.0 + a * np.exp(b / z) >= -1e-12).all()
    reach = 0.5 * np.pi + (0.5 * np.pi - zenith)
    for share in np.linspace(0.0, 1.0, 21):
        chi = share * reach
        glow = np.exp(d * chi) - np.exp(0.5 * np.pi * d)
        assert (1.0 + c * glow + e * np.cos(chi) ** 2 > -1e-9).all()


def test_every_sky_has_luminances():
    """The zenith of some is black: the level must not be told by it."""
    for altitude in (5, 20, 40, 50, 70, 85, 90):
        for direct in (5, 50, 150, 235, 270, 600, 900):
            for diffuse in (5, 20, 50, 75, 115, 400, 1200):
                sky = PerezSky(
                    direct_normal_w_m2=direct,
                    diffuse_horizontal_w_m2=diffuse,
                    sun_altitude_deg=altitude,
                    sun_azimuth_deg=30.0,
                )
                assert np.isfinite(sky_tone(sky)).all(), sky
                light = luminance(sky, WAYS)
                assert np.isfinite(light).all() and (light >= -1e-9 * light.max()).all(), sky
                assert light.max() > 0.0


def test_a_dark_sky_is_dark():
    sky = PerezSky(
        direct_normal_w_m2=0.0, diffuse_horizontal_w_m2=0.0, sun_altitude_deg=5, sun_azimuth_deg=0
    )
    assert horizontal_illuminance(sky) == 0.0 and sun_of(sky).normal_illuminance_lx == 0.0


def test_a_sensor_in_the_open():
    sky = SKIES[0]
    open_field = grid("plane", np.array([(0.0, 0.0, 1.0), (0.4, 0.3, 0.5)]), UP)
    given = scene(setup(ceiling(-1, 1, -1, 1, 0.0).flipped()), sky=sky, sensors=[open_field])
    result = solve(given, accuracy=0.1)
    found = result.sensors["plane"]
    np.testing.assert_allclose(found.illuminance_lx, horizontal_illuminance(sky), rtol=1e-4)
    assert found.daylight_factor is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"direct_normal_w_m2": -1.0}, "direct_normal_w_m2 = -1"),
        ({"diffuse_horizontal_w_m2": 2000.0}, "diffuse_horizontal_w_m2 = 2000"),
        ({"sun_altitude_deg": -3.0}, "sun_altitude_deg = -3"),
        ({"dew_point_c": float("nan")}, "dew_point_c = nan"),
        ({"sun_nearness": 1.2}, "sun_nearness = 1.2"),
        ({"cct_k": 2000.0}, "cct_k = 2000"),
    ],
)
def test_values_out_of_range(change, said):
    given = {
        "direct_normal_w_m2": 700.0,
        "diffuse_horizontal_w_m2": 120.0,
        "sun_altitude_deg": 40.0,
        "sun_azimuth_deg": 0.0,
    }
    with pytest.raises(InputError, match=said):
        PerezSky(**{**given, **change})
