"""Colours of skies: published values of the models, and CIE daylight as colour-science has it."""

import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.model import CIESky
from patchlight.solver.model.sky import direction
from patchlight.solver.sky_color import (
    daylight_locus,
    daylight_weights,
    sky_chromaticity,
    sky_temperature,
)
from patchlight.solver.spectra import correlated_temperature, daylight_spectra

UP = np.array([0.0, 0.0, 1.0])


def clear(altitude, zenith=3000.0):
    return CIESky(12, altitude, 0.0, zenith_luminance_cd_m2=zenith)


def test_temperature_by_luminance():
    levels = (1000.0, 2500.0, 5000.0, 10_000.0, 20_000.0)
    found = [float(sky_temperature(clear(40.0, level), UP)) for level in levels]
    assert found == pytest.approx((21182, 14086, 11238, 9348, 8002), abs=0.6)
    # Nothing is bluer than 25 000 K, and overcast skies have one colour.
    assert float(sky_temperature(clear(40.0, 200.0), UP)) == pytest.approx(25_000.0)
    assert float(sky_temperature(CIESky(16), UP)) == 6514.0


@pytest.mark.parametrize(
    ("altitude", "place", "expected"),
    [
        (40.0, (90.0, 0.0), (0.2444, 0.2505)),
        (40.0, (10.0, 0.0), (0.3104, 0.3190)),
        (40.0, (10.0, 180.0), (0.2796, 0.2965)),
        (40.0, (50.0, 180.0), (0.2363, 0.2479)),
        (10.0, (90.0, 0.0), (0.2632, 0.2783)),
        (10.0, (10.0, 0.0), (0.3806, 0.4052)),
    ],
)
def test_preetham(altitude, place, expected):
    """Turbidity 3: the zenith, towards the sun, and away from it."""
    found = sky_chromaticity(clear(altitude), direction(*place), "preetham")
    assert found == pytest.approx(expected, abs=0.51e-4)


@pytest.mark.parametrize("cct", [4000.0, 5003.0, 6504.0, 7000.0, 12_000.0, 25_000.0])
def test_daylight_is_that_of_the_cie(cct):
    import colour

    xy = daylight_locus(cct)
    np.testing.assert_allclose(xy, colour.temperature.CCT_to_xy_CIE_D(cct), atol=1e-9)
    series = colour.sd_CIE_illuminant_D_series(xy, M1_M2_rounding=False)
    wavelength, power = daylight_spectra(daylight_weights(xy))
    expected = np.array([series[w] for w in wavelength])
    np.testing.assert_allclose(power / power[52], expected / expected[52], rtol=1e-9)
    # One candela a square metre, by another sum than that it is scaled with.
    spectrum = colour.SpectralDistribution(dict(zip(wavelength, power, strict=True)))
    assert colour.luminous_flux(spectrum) == pytest.approx(1.0, rel=2e-3)


@pytest.mark.filterwarnings("ignore:Aligning")
def test_colour_of_spectra():
    """Spectra have the chromaticities they are made for, off the locus too."""
    import colour

    sky = clear(40.0)
    d = np.array([direction(a, b) for a in (10.0, 50.0, 90.0) for b in (0.0, 90.0, 180.0)])
    xy = sky_chromaticity(sky, d, "preetham")
    wavelength, power = daylight_spectra(daylight_weights(xy))
    for one, values in zip(xy, power, strict=True):
        spectrum = colour.SpectralDistribution(dict(zip(wavelength, values, strict=True)))
        found = colour.XYZ_to_xy(colour.sd_to_XYZ(spectrum, method="Integration"))
        assert found == pytest.approx(one, abs=1e-3)


def test_constant_and_temperatures():
    sky = CIESky(16, cct_k=7500.0)
    xy = sky_chromaticity(sky, [UP, direction(10.0, 30.0)])
    assert xy.shape == (2, 2) and (xy[0] == xy[1]).all()
    # Along the daylight locus the next Planckian is that temperature to 1 %.
    assert correlated_temperature(xy) == pytest.approx(7500.0, rel=1e-2)


@pytest.mark.parametrize(
    ("model", "more", "said"),
    [
        ("blue", {}, "'blue': must be one of constant, chain, preetham"),
        ("preetham", {}, "the sky has no sun"),
        ("chain", {"turbidity": 3.0}, "does not depend on it"),
        ("preetham", {"turbidity": 9.0}, "turbidity = 9.0: must lie between 2 and 6"),
    ],
)
def test_what_cannot_be(model, more, said):
    with pytest.raises(InputError, match=said):
        sky_chromaticity(CIESky(16), UP, model, **more)
