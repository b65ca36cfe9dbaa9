"""The law of a pane of glass: closed forms, energy, tables."""

import math

import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.glass import GlassLaw, depth_of, slab
from patchlight.solver.kernels.panes import transmittance
from patchlight.solver.model import Glass, Glazing
from patchlight.solver.panes import make_panes

from .fixtures_light import ceiling, scene, setup

ANGLES = np.radians([0, 10, 20, 30, 40, 50, 60, 70, 80])
#: 6 mm of n = 1.52 that absorbs 6.783 /m, to four digits.
CLEAR = [0.8816, 0.8813, 0.8802, 0.8772, 0.8693, 0.8497, 0.8016, 0.6855, 0.4248]


def law(thickness=0.006, **options) -> GlassLaw:
    return GlassLaw.of(Glazing(Glass(**options), thickness))


def test_clear_glass_of_six_millimetres():
    np.testing.assert_allclose(law().transmittance(np.cos(ANGLES)), CLEAR, atol=5.1e-5)
    assert law().transmittance(0.0) == 0.0


def test_normal_incidence_in_closed_form():
    r, t = (0.52 / 2.52) ** 2, math.exp(-6.783 * 0.006)
    found = law()
    assert found.transmittance(1.0) == pytest.approx((1 - r) ** 2 * t / (1 - (r * t) ** 2))
    back = r + r * (1 - r) ** 2 * t**2 / (1 - (r * t) ** 2)
    assert found.reflectance(1.0) == pytest.approx(back, rel=1e-13)


@pytest.mark.parametrize("angle", [0.0, 40.0, 75.0, 88.0])
def test_the_sum_of_all_internal_reflections(angle):
    """Fresnel's sines and tangents, and the beam followed to and fro."""
    n, depth, a = 1.6, 0.07, math.radians(angle)
    b = math.asin(math.sin(a) / n)
    left = math.exp(-depth / math.cos(b))
    if angle:
        faces = [(math.sin(a - b) / math.sin(a + b)) ** 2, (math.tan(a - b) / math.tan(a + b)) ** 2]
    else:
        faces = [((n - 1) / (n + 1)) ** 2] * 2
    through = back = 0.0
    for r in faces:
        beam, side = (1 - r) * left, 1
        back += 0.5 * r
        for _ in range(400):
            if side:
                through += 0.5 * beam * (1 - r)
            else:
                back += 0.5 * beam * (1 - r)
            beam, side = beam * r * left, 1 - side
    # The series leaves less than 1e-12 of the beam after 400 passages, also at 88 degrees.
    assert slab(math.cos(a), n, depth) == pytest.approx((through, back), rel=1e-10)


def test_nothing_is_lost_in_glass_that_absorbs_nothing():
    c = np.linspace(0.0, 1.0, 101)
    through, back = slab(c, 1.52, 0.0)
    np.testing.assert_allclose(through + back, 1.0, rtol=1e-13)
    found = law(absorption_per_m=0.0)
    assert found.diffuse_transmittance + found.diffuse_reflectance == pytest.approx(1.0, abs=1e-12)


def test_air_between_two_planes():
    """Index 1 reflects nothing: only the way through it counts."""
    c = np.array([0.2, 0.6, 1.0])
    through, back = slab(c, 1.0, 0.3)
    np.testing.assert_allclose(through, np.exp(-0.3 / c), rtol=1e-13)
    assert back.max() < 1e-15
    # Twice the exponential integral of order 3, [Abramowitz and Stegun, 5.1.4].
    x = np.linspace(0.0, 1.0, 200_001)[1:]
    integral = 2.0 * np.trapezoid(x * np.exp(-0.3 / x), x)
    found = GlassLaw(1.0, 0.3, np.empty(0), np.empty(0), 0.0)
    assert found.diffuse_transmittance == pytest.approx(integral, abs=1e-9)


@pytest.mark.parametrize("value", [0.05, 0.5, 0.9183])
def test_a_given_transmittance_is_that_at_normal_incidence(value):
    found = law(transmittance=value)
    assert found.transmittance(1.0) == pytest.approx(value, rel=1e-12)
    assert slab(1.0, 1.52, depth_of(value, 1.52))[0] == pytest.approx(value, rel=1e-12)


def test_opaque_glass():
    assert law(transmittance=0.0).transmittance(0.7) == 0.0
    assert law(transmittance=0.0).diffuse_reflectance > 0.05


def test_a_table_is_linear_in_the_angle():
    found = law(transmittance=[(0, 0.8), (60, 0.6), (80, 0.2)])
    at = found.transmittance(np.cos(np.radians([0, 30, 70, 85, 90])))
    np.testing.assert_allclose(at, [0.8, 0.7, 0.4, 0.1, 0.0], atol=1e-12)
    both = at + found.reflectance(np.cos(np.radians([0, 30, 70, 85, 90])))
    assert (both <= 1.0 + 1e-12).all()


@pytest.mark.parametrize(
    "glass",
    [
        Glass(0.006),
        Glass(0.02, n=1.7, absorption_per_m=40.0, diffuse=0.25),
        Glass(transmittance=0.4),
        Glass(transmittance=[(0, 0.8), (60, 0.6), (80, 0.2)], diffuse=0.5),
        Glass(0.006, n=1.0, absorption_per_m=0.0),
    ],
)
def test_kernels_follow_the_same_law(glass):
    import dataclasses

    plain = scene(setup(ceiling(-1, 1, -1, 1, 1.0)))
    glazing = Glazing(glass, glass.thickness_m or 0.0)
    panes = make_panes(dataclasses.replace(plain, glazings=(glazing,), glass_index=np.zeros(1)))
    c = np.concatenate([[0.0, 1e-9], np.linspace(0.001, 1.0, 57)])
    found = [transmittance(panes, 0, x) for x in c]
    expected = (1.0 - glass.diffuse) * GlassLaw.of(glazing).transmittance(c)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"thickness_m": 0.0}, "greater than 0"),
        ({"n": 0.9}, "between 1 and 10"),
        ({"absorption_per_m": -1.0}, "at least 0"),
        ({"diffuse": 1.1}, "between 0 and 1"),
        ({"transmittance": 0.95}, "at most 0.9183"),
        ({"transmittance": [(5, 0.8), (60, 0.6)]}, "begin at 0"),
        ({"transmittance": [(0, 0.8), (0, 0.6)]}, "begin at 0"),
        ({"transmittance": [(0, 1.8)]}, "between 0 and 1"),
        ({"transmittance": "much"}, "must be a number"),
    ],
)
def test_glass_that_cannot_be(options, message):
    with pytest.raises(InputError, match=message):
        Glass(**options)
