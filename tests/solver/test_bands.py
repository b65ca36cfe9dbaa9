"""Bands of light: the table against its sources, and what reflectances become."""

import colour
import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.model import Material
from patchlight.solver.model import bands as b
from patchlight.solver.model.colorimetry import chromaticity, melanopic_der
from patchlight.solver.spectra import (
    cct_color,
    daylight_basis,
    spectrum_bands,
    temperature_and_distance,
)
from scipy.interpolate import CubicSpline

NM = np.arange(380.0, 781.0)
#: Maximum luminous efficacy. [lm/W]
K_M = 683.002


def at_every_nm(data, column=0):
    """Values of a colour-science table at 380 to 780 nm."""
    values = np.asarray(data.values)
    values = values if values.ndim == 1 else values[:, column]
    return np.interp(NM, np.asarray(data.wavelengths), values)


def trapezoid(values):
    return 0.5 * (values[..., 1:] + values[..., :-1]).sum(axis=-1)


def illuminant(name):
    """Twenty bands of a CIE illuminant."""
    table = colour.SDS_ILLUMINANTS[name]
    pairs = zip(np.asarray(table.wavelengths), np.asarray(table.values), strict=True)
    return spectrum_bands(tuple((float(x), float(y)) for x, y in pairs))


def test_observer_is_that_of_the_smoothest_spectrum_with_given_means():
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    for band in range(b.SPECTRAL):
        power = np.concatenate([[0.0], np.cumsum(20.0 * (np.arange(b.SPECTRAL) == band))])
        spectrum = CubicSpline(b.ENDS_NM, power)(NM, 1)
        found = [trapezoid(at_every_nm(observer, k) * spectrum) for k in range(3)]
        # Six digits are kept.
        assert b.OBSERVER[band] == pytest.approx(found, rel=1e-5, abs=1e-9)


def test_melanopic_action_is_that_of_the_standard():
    """CIE S 026: D65 has 1.3262 mW/lm; the printed ratio of A is 0.496, and it peaks at 490 nm."""
    of_d65 = (b.MELANOPIC @ b.D65) / (K_M * b.OBSERVER[:, 1] @ b.D65)
    # Power of D65 has corners every 10 nm, which 20 nm do not show.
    assert 1e3 * of_d65 == pytest.approx(1.3262, rel=2e-4)
    assert melanopic_der(illuminant("A")) == pytest.approx(0.496, abs=5e-4)
    assert melanopic_der(illuminant("D65")) == pytest.approx(1.0, abs=1e-6)
    assert b.ENDS_NM[np.argmax(b.MELANOPIC)] == 480.0


def test_no_weight_of_light_and_action_is_negative():
    assert (b.OBSERVER[:, :2] > 0.0).all() and (b.MELANOPIC > 0.0).all()
    # The blue end of the observer is 0 from 650 nm on: what is left there is below 1e-7 of all.
    assert b.OBSERVER[:, 2].min() > -1e-7 * b.OBSERVER[:, 2].sum()


@pytest.mark.parametrize(
    ("name", "cct", "duv", "ratio"),
    [
        ("A", 0.001, 1e-5, 1e-3),
        ("D65", 0.001, 5e-5, 1e-3),
        ("LED-B1", 0.004, 2e-4, 3e-3),
        ("LED-B5", 0.004, 4e-4, 3e-3),
        ("FL11", 0.05, 1e-3, 0.05),
    ],
)
def test_twenty_bands_keep_the_colour_of_illuminants(name, cct, duv, ratio):
    """Of the spectrum at every nm, to what the module says of each kind of light."""
    power = at_every_nm(colour.SDS_ILLUMINANTS[name])
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    xyz = np.array([trapezoid(at_every_nm(observer, k) * power) for k in range(3)])
    known = temperature_and_distance(xyz[:2] / xyz.sum())
    found = temperature_and_distance(chromaticity(illuminant(name)))
    assert found[0] == pytest.approx(known[0], rel=cct)
    assert found[1] == pytest.approx(known[1], abs=duv)
    # Melanopic action at every 20 nm, [2] of the module: enough to see that bands do not shift it.
    rough = np.array([9.18e-4, 0.0114, 0.1372, 0.4016, 0.7080, 0.9656, 0.9660, 0.6996, 0.3517,
                      0.1185, 0.0269, 5.07e-3, 9.5e-4, 1.9e-4])  # fmt: skip
    action = np.exp(CubicSpline(np.arange(380.0, 641.0, 20.0), np.log(rough))(NM))
    action[NM > 640.0] = 0.0
    d65 = at_every_nm(colour.SDS_ILLUMINANTS["D65"])
    y = at_every_nm(observer, 1)
    of_d65 = trapezoid(action * d65) / trapezoid(y * d65)
    assert melanopic_der(illuminant(name)) == pytest.approx(
        trapezoid(action * power) / trapezoid(y * power) / of_d65, rel=ratio + 2e-3
    )


@pytest.mark.parametrize("cct_k", [2000.0, 2700.0, 3999.0, 4000.0, 6500.0, 10000.0])
def test_white_light_keeps_its_temperature(cct_k):
    light = cct_color(cct_k, 20)
    assert light.sum() == pytest.approx(1.0, abs=1e-14) and (light > 0.0).all()
    # 0.08 % by the bands, and what constants of the daylight locus are off, a few kelvin.
    assert temperature_and_distance(chromaticity(light))[0] == pytest.approx(cct_k, rel=1.5e-3)
    rgb = b.in_primaries(light)
    assert rgb == pytest.approx(cct_color(cct_k, 3), abs=3e-3)


def test_dark_and_saturated_light_have_no_temperature():
    light = np.zeros((2, 20))
    light[1, 12] = 1.0
    cct, duv = temperature_and_distance(chromaticity(light))
    assert np.isnan(cct).all() and np.isnan(duv).all()


def test_daylight_basis_mixes_to_daylight_in_any_bands():
    from patchlight.solver.sky_color import daylight_locus, daylight_weights

    mixed = np.concatenate([[1.0], daylight_weights(daylight_locus(7500.0))])
    for bands in (3, 20):
        light = mixed @ daylight_basis(bands)
        level = light.sum() if bands == 20 else light @ b.LUMINANCE_WEIGHTS
        # In three bands sRGB is told to four digits, and by another rule over wavelength.
        close = 1e-12 if bands == 20 else 3e-3
        assert light / level == pytest.approx(cct_color(7500.0, bands), abs=close)


def test_spectra_of_primaries_keep_what_was_given():
    rng = np.random.default_rng(3)
    rgb = np.concatenate([np.eye(3), rng.random((20, 3))])
    found = b.spectral_reflectance(rgb)
    assert (found >= 0.0).all() and (found <= rgb.max(axis=1)[:, None] + 1e-12).all()
    assert b.spectral_reflectance([1.0, 1.0, 1.0]) == pytest.approx(np.ones(20), abs=1e-12)
    # Five digits of the table.
    assert b.primary_reflectance(found) == pytest.approx(rgb, abs=2e-5)
    luminous = found @ b.luminous_shares(b.D65)
    assert luminous == pytest.approx(rgb @ b.LUMINANCE_WEIGHTS, abs=2e-4)


def test_band_means_of_straight_lines_are_exact():
    middle = 0.5 * (b.ENDS_NM[1:] + b.ENDS_NM[:-1])
    assert b.band_means([300.0, 800.0], [0.0, 1.0]) == pytest.approx((middle - 300.0) / 500.0)
    ends = b.band_means([405.0, 690.0], [0.2, 0.2])
    assert ends[[0, 1, 2, -5, -1]] == pytest.approx([0.0, 0.15, 0.2, 0.1, 0.0])
    held = b.band_means([405.0, 690.0], [0.2, 0.4], held=True)
    assert held[[0, -1]] == pytest.approx([0.2, 0.4])


def test_materials_take_reflectances_over_wavelength():
    red = Material([(400, 0.1), (580, 0.1), (600, 0.8), (700, 0.8)])
    found = red.scattered_in(20)
    assert found[[0, 9, 10, 11, -1]] == pytest.approx([0.1, 0.1, 0.45, 0.8, 0.8])
    r, g, blue = red.scattered_in(3)
    # Off 0.1 in blue and green by what sharp edges lose in three primaries.
    assert r > 0.7 and (g, blue) == pytest.approx((0.1, 0.1), abs=0.02)
    assert not red.is_grey and red.luminous_reflectance == pytest.approx(
        found @ b.luminous_shares(b.D65), abs=2e-4
    )
    same = Material(((400.0, 0.3), (700.0, 0.3)))
    assert same.reflectance == 0.3 and same.is_grey


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([(400, 0.5)], r"Material.reflectance: shape \(1, 2\): expected two or more pairs"),
        ([(500, 0.5), (400, 0.5)], "wavelength 400 nm follows 500 nm"),
        ([(400, 0.5), (500, 1.2)], "reflectance 1.2 at 500 nm: must not exceed 1"),
        ([(400, -0.5), (500, 0.2)], "reflectance -0.5 at 400 nm: must be >= 0"),
        ([(400, np.nan), (500, 0.2)], "Material.reflectance"),
        ([0.1, 0.2], "expected a number, a linear .r, g, b. triple or pairs"),
    ],
)
def test_bad_reflectances_are_refused(value, message):
    with pytest.raises(InputError, match=message):
        Material(value)


@pytest.mark.parametrize("edge", [440.0, 490.0, 540.0, 560.0, 580.0, 620.0])
@pytest.mark.parametrize("rising", [False, True])
def test_primaries_of_saturated_surfaces_keep_their_luminance(edge, rising):
    """What is outside the gamut of sRGB moves into it, and not the light that is reflected."""
    low, high = (0.03, 0.9) if rising else (0.9, 0.03)
    steep = Material([(400, low), (edge - 1, low), (edge + 1, high), (700, high)])
    rgb, told = steep.bands, steep.scattered_in(20) @ b.luminous_shares(b.D65)
    # More than any wavelength has would not be absorbed between walls.
    assert (rgb >= 0.0).all() and (rgb <= 0.9).all()
    assert steep.luminous_reflectance == pytest.approx(told, rel=1e-3)


def test_primaries_that_are_full_hold_no_more():
    deep = Material([(400, 0.0), (639, 0.0), (641, 1.0), (700, 1.0)])
    assert deep.bands.max() <= 1.0
    assert b.primary_reflectance(np.ones(20), (0.2, 1.0, 1.0)) == pytest.approx([0.2, 1.0, 1.0])
    assert b.primary_reflectance(np.zeros(20)) == pytest.approx(np.zeros(3))
    # Room for the whole in green alone.
    half = b.primary_reflectance(np.full(20, 0.5), (0.2, 1.0, 0.5))
    weights = np.array(b.LUMINANCE_WEIGHTS)
    assert half[0] == 0.2 and half[2] == 0.5
    assert half @ weights == pytest.approx(0.5, rel=1e-6)


def test_shares_of_one_surface_are_added_by_wavelength():
    with pytest.raises(InputError, match=r"reflectance \+ specular \+ mirror = 1.1"):
        Material([(400, 0.5), (500, 0.9)], specular=0.2)
    Material((0.6, 0.3, 0.2), specular=(0.4, 0.7, 0.8))
    # 1 in no band; in three the mirror keeps its share and the rest makes room.
    steep = [(400, 0.03), (559, 0.03), (561, 0.9), (700, 0.9)]
    for mirror in (0.1, [(400, 0.05), (700, 0.1)]):
        material = Material(steep, mirror=mirror)
        whole = material.scattered_bands + material.mirror_bands
        assert (whole <= 1.0 + 1e-12).all() and material.bands[0] == pytest.approx(0.9)
        level = material.scattered_in(20) @ b.luminous_shares(b.D65)
        assert material.luminous_reflectance == pytest.approx(level, rel=1e-3)
        assert material.luminous_mirror > 0.05
    with pytest.raises(InputError, match=r"reflectance \+ specular \+ mirror = 1.1"):
        Material(0.5, specular=(0.6, 0.2, 0.2), mirror=[(400, 0.0), (500, 0.01)])
