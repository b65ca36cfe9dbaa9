"""Skies and levels of Radiance's gensky: its tables, its printed output, and the kernel."""

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from patchlight.solver import skies
from patchlight.solver.errors import InputError
from patchlight.solver.gensky import (
    CLEAR,
    estimated_sun_illuminance,
    estimated_zenith_luminance,
)
from patchlight.solver.kernels.sky_luminance import sky_luminances
from patchlight.solver.model import CIESky
from patchlight.solver.model.sky import direction

ALTITUDES = (15.0, 30.0, 45.0, 60.0, 75.0)
#: Zenith luminance [cd/m²] and horizontal illuminance over it [sr] by a 400 x 1440 rule over the
#: zenith angle and azimuth, for the sun at these altitudes.
ZENITH = {
    "clear": (798.3, 1281.4, 1941.2, 3084.1, 6206.5),
    "overcast": (2348.8, 4423.0, 6204.1, 7570.8, 8430.0),
    "intermediate": (1573.6, 2852.2, 4072.7, 5327.4, 7318.2),
}
RATIOS = {
    "clear": (7.2012, 6.3908, 4.8459, 3.1888, 1.8494),
    "intermediate": (3.8127, 4.1229, 3.6355, 2.5046, 1.3357),
}
#: What gensky divides luminances by, to print them as radiances, and that of the sun.
EFFICACY, EFFICACY_OF_SUN = 203.0, 208.0
OPTIONS = {"clear": "-s", "intermediate": "-i", "overcast": "-c", "uniform": "-u"}


def sky(kind, altitude, azimuth=180.0, **level):
    return CIESky(kind, sun_altitude_deg=altitude, sun_azimuth_deg=azimuth, **level)


@pytest.mark.parametrize("kind", ZENITH)
def test_zenith_luminances(kind):
    found = [estimated_zenith_luminance(sky(kind, a, estimated=True)) for a in ALTITUDES]
    assert found == pytest.approx(ZENITH[kind], abs=0.051)


@pytest.mark.parametrize("kind", RATIOS)
def test_integrals(kind):
    """To the printed digits, over the zenith luminance as the program has it."""
    estimates = [sky(kind, a, estimated=True) for a in ALTITUDES]
    found = [skies.horizontal_illuminance(s) / estimated_zenith_luminance(s) for s in estimates]
    assert found == pytest.approx(RATIOS[kind], abs=0.51e-4)
    # Its rounded normalisation is off by this; skies of a given level have their own.
    for s in estimates:
        own = skies.diffuse_to_zenith_ratio(sky(kind, s.sun_altitude_deg))
        assert own == pytest.approx(
            skies.horizontal_illuminance(s) / skies.zenith_luminance(s), rel=1e-12
        )
        assert skies.zenith_luminance(s) == pytest.approx(estimated_zenith_luminance(s), rel=6e-4)


@pytest.mark.parametrize("altitude", [0.0, 20.0, 89.9, 90.0])
def test_integral_has_converged(altitude, monkeypatch):
    for kind in RATIOS:
        here = skies.diffuse_to_zenith_ratio(sky(kind, altitude))
        monkeypatch.setattr(skies, "_ORDER", 300)
        assert here == pytest.approx(skies.diffuse_to_zenith_ratio(sky(kind, altitude)), rel=1e-6)
        monkeypatch.undo()


def of_skybright(kind, printed, d, s):
    """Radiance in unit directions by the formulas of skybright.cal without its smooth horizon."""
    z, chi, eta = d[..., 2], np.arccos(np.clip(d @ s, -1, 1)), np.arccos(d[..., 2])
    if kind in ("overcast", "uniform"):
        return printed[1] * ((1 + 2 * z) / 3 if kind == "overcast" else np.ones_like(z))
    if kind == "clear":
        level = 0.91 + 10 * np.exp(-3 * chi) + 0.45 * np.cos(chi) ** 2
        return printed[1] * level * (1 - np.exp(-0.32 / z)) / printed[3]
    zt = math.acos(s[2])
    level = (1.35 * np.sin(5.631 - 3.59 * eta) + 3.12) * math.sin(4.396 - 2.6 * zt) + 6.37 - eta
    falling = np.exp(chi * -0.563 * ((2.629 - eta) * (1.562 - zt) + 0.812))
    return printed[1] * level / 2.326 * falling / printed[3]


def gensky(*options):
    """Numbers of the sky that the program prints, and of its sun where there is one."""
    pyradiance = pytest.importorskip("pyradiance")
    program = Path(pyradiance.__file__).parent / "bin" / "gensky"
    done = subprocess.run([program, *options], capture_output=True, text=True, check=True)
    lines = [line.split() for line in done.stdout.splitlines()]
    numbers = [[float(w) for w in line] for line in lines if len(line) >= 4 and line[0].isdigit()]
    return numbers


@pytest.mark.parametrize("kind", OPTIONS)
@pytest.mark.parametrize("altitude", [3.0, 40.0, 62.0, 86.0])
def test_what_the_program_prints(kind, altitude):
    """Four digits are printed: 5e-4 at worst, twice where its normalisation is printed, too."""
    azimuth = 30.0  # of gensky: from south to west
    printed = gensky("-ang", f"{altitude}", f"{azimuth}", OPTIONS[kind])[-1][1:]
    mine = sky(kind, altitude, 180.0 + azimuth, estimated=True)
    assert estimated_zenith_luminance(mine) == pytest.approx(EFFICACY * printed[1], rel=6e-4)
    rng = np.random.default_rng(3)
    d = rng.normal(size=(200, 3))
    d[:, 2] = np.abs(d[:, 2]) + 0.02  # gensky cuts the gradation at 0.01
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    s = np.array(direction(altitude, 180.0 + azimuth))
    expected = EFFICACY * of_skybright(kind, printed, d, s)
    np.testing.assert_allclose(skies.luminance(mine, d), expected, rtol=1.01e-3)


@pytest.mark.parametrize(("kind", "option"), [("clear", "+s"), ("intermediate", "+i")])
@pytest.mark.parametrize("altitude", [4.0, 15.0, 60.0])
def test_the_sun_that_the_program_prints(kind, option, altitude):
    radiance = gensky("-ang", f"{altitude}", "0", option)[0][1]
    found = estimated_sun_illuminance(sky(kind, altitude, estimated=True))
    # A disc of 6e-5 sr; four digits.
    assert found == pytest.approx(EFFICACY_OF_SUN * 6e-5 * radiance, rel=6e-4)


@pytest.mark.parametrize(
    ("altitude", "lux"), [(15.0, 52.1e3), (30.0, 76.8e3), (60.0, 88.0e3), (90.0, 90.0e3)]
)
def test_illuminance_of_the_sun(altitude, lux):
    assert estimated_sun_illuminance(sky("clear", altitude)) == pytest.approx(lux, abs=50.0)
    assert estimated_sun_illuminance(CIESky("overcast", sun_altitude_deg=altitude)) == 0.0


@pytest.mark.parametrize("kind", [1, 5, 12, 16])
def test_estimates_of_standard_skies(kind):
    """Their own form, which is 1 at the zenith."""
    one = sky(kind, 50.0, estimated=True)
    assert skies.zenith_luminance(one) == pytest.approx(estimated_zenith_luminance(one), rel=1e-14)


def test_turbidity():
    """(1.376 T − 1.81) tan γ + 0.38 kcd/m², half of it in the intermediate sky."""
    for kind, share in (("clear", 1.0), (12, 1.0), ("intermediate", 0.5)):
        low, high = (
            estimated_zenith_luminance(sky(kind, 45.0, estimated=True, turbidity=t))
            for t in (2.0, 5.0)
        )
        assert high - low == pytest.approx(share * 1376.0 * 3.0, rel=1e-12)
    # Higher suns than 87° are taken for that.
    top = [estimated_zenith_luminance(sky("clear", a, estimated=True)) for a in (87.0, 90.0)]
    assert top[1] == top[0]


def test_clear_sky_is_type_12_nearly():
    """Kittler's formula in the form of CIE S 011: 10 / 0.9998 in place of 10."""
    assert CLEAR[2] == pytest.approx(10.0, rel=2e-4) and CLEAR[4] == pytest.approx(0.45, rel=2e-4)
    d = [direction(a, b) for a in (5, 30, 80) for b in (0, 90, 200)]
    one, other = (skies.relative_luminance(sky(kind, 35.0), d) for kind in ("clear", 12))
    np.testing.assert_allclose(one, other, rtol=2e-3)


@pytest.mark.parametrize("kind", ["clear", "intermediate"])
@pytest.mark.parametrize("altitude", [0.0, 35.0, 90.0])
def test_kernel_is_the_same_sky(kind, altitude):
    rng = np.random.default_rng(5)
    d = rng.normal(size=(500, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    one, out = sky(kind, altitude, 200.0, diffuse_illuminance_lx=2e4), np.empty(len(d))
    sky_luminances(skies.sky_parameters(one), *skies.sun_direction(one), d, out)
    assert out == pytest.approx(skies.luminance(one, d), rel=1e-12)
    assert skies.horizontal_illuminance(one) == 2e4


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"type": "hazy"}, "'hazy': must be 1 to 16 or one of overcast, uniform, clear"),
        ({"type": "intermediate"}, "type intermediate brightens towards the sun"),
        ({"type": 7, "estimated": True}, "level of type 7 is not known"),
        ({"type": 16, "estimated": True, "sun_altitude_deg": None}, "give it"),
        ({"type": 16, "estimated": True, "turbidity": 3.0}, "turbidity: only the estimated"),
        ({"type": 12, "turbidity": 3.0}, "turbidity: only the estimated"),
        ({"type": 12, "estimated": True, "turbidity": 0.2}, "turbidity = 0.2: must lie between"),
        ({"type": 12, "estimated": 1}, "estimated = 1: must be True or False"),
        ({"type": 12, "estimated": True, "zenith_luminance_cd_m2": 9.0}, "give one of"),
        ({"sun_altitude_deg": "30"}, "sun_altitude_deg = '30': must be a number"),
        ({"sun_altitude_deg": np.ones(1)}, "sun_altitude_deg = array.*: must be a number"),
        ({"cct_k": None}, "cct_k = None: must be a number"),
    ],
)
def test_what_cannot_be(given, said):
    values = {"sun_altitude_deg": 40.0, "sun_azimuth_deg": 180.0, **given}
    if given.get("type") == "intermediate":
        values = given
    with pytest.raises(InputError, match=said):
        CIESky(**values)


def test_numbers_of_numpy_are_kept_as_numbers():
    """Arrays without dimensions have no hash, which what is kept of skies goes by."""
    one = CIESky(
        np.int64(12), np.array(40.0), np.float32(180.0), diffuse_illuminance_lx=np.array(9e3)
    )
    assert one == CIESky(12, 40.0, 180.0, diffuse_illuminance_lx=9e3) and hash(one)
    assert type(one.type) is int and type(one.sun_altitude_deg) is float
    assert skies.sky_parameters(one)[0] == 0.0
