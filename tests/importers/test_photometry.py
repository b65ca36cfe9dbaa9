"""Photometric files: webs of known flux, all symmetries, factors, and files that cannot be used."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from patchlight.importers import read_photometry
from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.model import Photometry, Web

from .photometric_files import ies_text, ldt_text

GAMMA = np.arange(0.0, 181.0, 2.5)
DOWN = np.arange(0.0, 91.0, 5.0)


def uneven(c_deg, gamma_deg):
    """An intensity without any symmetry, above zero everywhere."""
    c, gamma = np.radians(c_deg), np.radians(gamma_deg)
    x, y = np.sin(gamma) * np.cos(c), np.sin(gamma) * np.sin(c)
    return 100.0 + 30.0 * x + 20.0 * y + 25.0 * x * y + 10.0 * np.cos(gamma)


def write(tmp_path, text, name="lamp.ies"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8", newline="")
    return path


def exact_flux(intensity, gamma, c):
    """Flux of the bilinear web by Gauss quadrature in each cell: exact to rounding."""
    t, w = np.polynomial.legendre.leggauss(8)
    total = 0.0
    for c0, c1 in zip(c[:-1], c[1:], strict=True):
        for g0, g1 in zip(gamma[:-1], gamma[1:], strict=True):
            y = 0.5 * (1 + t)
            low, high = (0.5 * (intensity(c0, g) + intensity(c1, g)) for g in (g0, g1))
            along = np.radians(g0 + (g1 - g0) * y)
            value = ((low * (1 - y) + high * y) * np.sin(along)) @ (w / 2)
            total += value * math.radians(c1 - c0) * math.radians(g1 - g0)
    return total


class TestIntegral:
    def test_cosine_web_of_one_degree(self):
        gamma = np.arange(0.0, 90.5, 1.0)
        row = 1000.0 / math.pi * np.cos(np.radians(gamma))
        web = Photometry([0.0, 360.0], gamma, [row, row])
        # A chord over h lies below the cosine by h²/12 of it in the mean, 2.5e-5 here.
        assert web.flux_lm == pytest.approx(1000.0 * (1 - math.radians(1) ** 2 / 12), rel=1e-7)

    def test_uniform_web(self):
        web = Photometry([0.0, 90.0, 360.0], [0.0, 70.0, 180.0], np.full((3, 3), 10.0))
        assert web.flux_lm == pytest.approx(40.0 * math.pi, rel=1e-13)
        assert web.downward_fraction == pytest.approx(0.5, abs=1e-13)

    def test_uneven_web_against_quadrature(self):
        c = np.array([0.0, 30.0, 100.0, 210.0, 360.0])
        gamma = np.array([0.0, 20.0, 95.0, 180.0])
        web = Photometry(c, gamma, uneven(c[:, None], gamma[None]))
        assert web.flux_lm == pytest.approx(exact_flux(uneven, gamma, c), rel=1e-12)

    def test_intensity_is_bilinear_and_zero_outside(self):
        web = Photometry([0.0, 180.0, 360.0], [10.0, 80.0], [[2.0, 4.0], [6.0, 8.0], [2.0, 4.0]])
        assert web.intensity(90.0, 45.0) == pytest.approx(5.0)
        assert web.intensity(-90.0, 45.0) == pytest.approx(5.0)
        assert web.intensity([0.0, 0.0], [9.9, 80.1]).tolist() == [0.0, 0.0]

    def test_axes_are_right_handed_about_the_zenith(self):
        web = Web.aimed(Photometry([0, 360], [0, 90], [[1, 0], [1, 0]]), (0, 0, -2), (3, 0, 1))
        assert web.axes.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, -1]]
        with pytest.raises(InputError, match="c0 = .*parallel to aim"):
            Web.aimed(web.photometry, (0, 0, -1), (0, 0, 5))


@pytest.mark.parametrize(
    ("c", "folded"),
    [
        ([0.0], lambda c: 0.0 * c),
        ([0.0, 30.0, 60.0, 90.0], lambda c: min(c % 180, 180 - c % 180)),
        ([0.0, 45.0, 90.0, 180.0], lambda c: min(c, 360 - c)),
        ([90.0, 135.0, 180.0, 270.0], lambda c: c if 90 <= c <= 270 else (180 - c) % 360),
        ([0.0, 90.0, 200.0, 360.0], lambda c: c),
        ([0.0, 90.0, 180.0, 270.0], lambda c: c),
    ],
)
def test_ies_symmetries(tmp_path, c, folded):
    stored = uneven(np.asarray(c)[:, None], DOWN[None])
    web = read_photometry(write(tmp_path, ies_text(stored, DOWN, c)))
    assert web.c_deg[0] == 0.0 and web.c_deg[-1] == 360.0
    for at in (0.0, 20.0, 77.0, 90.0, 131.0, 180.0, 199.0, 250.0, 299.0, 360.0):
        row = [np.interp(folded(at), c, column, period=360.0) for column in stored.T]
        # Ten digits are written.
        np.testing.assert_allclose(web.intensity(at, DOWN), row, rtol=1e-9)


@pytest.mark.parametrize("symmetry", range(5))
def test_ldt_symmetries(tmp_path, symmetry):
    c = np.arange(0.0, 360.0, 15.0)

    def even(c_deg):
        """The unevenness folded as the symmetry says."""
        c = c_deg % 360.0
        if symmetry == 1:
            return 0.0 * c
        if symmetry in (2, 4):
            c = np.minimum(c, 360.0 - c)
        if symmetry == 4:
            c = np.minimum(c, 180.0 - c)
        return np.where((c < 90.0) | (c > 270.0), c, (180.0 - c) % 360.0) if symmetry == 3 else c

    rows = {
        0: c,
        1: c[:1],
        2: np.arange(0.0, 181.0, 15.0),
        3: np.arange(270.0, 451.0, 15.0),
        4: np.arange(0.0, 91.0, 15.0),
    }[symmetry]
    whole = uneven(even(np.append(c, 360.0))[:, None], GAMMA[None])
    stored = uneven(even(rows)[:, None], GAMMA[None])
    flux = Photometry(np.append(c, 360.0), GAMMA, whole)
    given = {"flux": 2500.0, "output": flux.flux_lm / 10.0}
    given["downward"] = 100.0 * flux.downward_fraction
    web = read_photometry(write(tmp_path, ldt_text(stored, GAMMA, c, symmetry, **given), "a.ldt"))
    grid = np.append(c, 360.0)[:, None]
    np.testing.assert_allclose(web.intensity(grid, GAMMA[None]), 2.5 * whole, rtol=1e-9)
    assert web.flux_lm == pytest.approx(2.5 * flux.flux_lm, rel=1e-9)
    assert web.remarks == ()
    assert (web.lamp_flux_lm, web.power_w, web.name) == (2500.0, 17.5, "panel")
    assert web.size_m == (0.3, 0.6, 0.05)


class TestFactors:
    def read(self, tmp_path, **options):
        return read_photometry(
            write(tmp_path, ies_text(uneven(np.zeros((1, 1)), DOWN[None]), DOWN, [0.0], **options))
        )

    def test_all_of_2002(self, tmp_path):
        plain = self.read(tmp_path)
        web = self.read(tmp_path, multiplier=2.0, ballast=0.9, second=3.0, lumens=5000.0)
        assert web.flux_lm == pytest.approx(1.8 * plain.flux_lm, rel=1e-12)
        assert web.lamp_flux_lm == 5000.0 and plain.lamp_flux_lm is None
        assert plain.power_w == 12.5 and plain.name == "disc" and plain.lamp == "one"

    @pytest.mark.parametrize(
        ("header", "factor"),
        [
            ("", 0.5),
            ("IESNA91", 0.5),
            ("IESNA:LM-63-1995", 0.5),
            ("IESNA:LM-63-2002", 1.0),
            ("IES:LM-63-2019", 1.0),
        ],
    )
    def test_ballast_lamp_factor_ends_in_2002(self, tmp_path, header, factor):
        web = self.read(tmp_path, header=header, second=0.5)
        assert web.flux_lm == pytest.approx(factor * self.read(tmp_path).flux_lm, rel=1e-12)
        assert web.format == (header or "IES LM-63-1986") and web.remarks == ()

    def test_feet_and_round_openings(self, tmp_path):
        assert self.read(tmp_path, unit=1, size=(1, 2, 0.5)).size_m == pytest.approx(
            (0.6096, 0.3048, 0.1524)
        )
        round_ = self.read(tmp_path, size=(-0.3, -0.3, 0))
        assert round_.shape == "circle" and round_.size_m == (0.3, 0.3, 0.0)
        assert self.read(tmp_path, size=(0, 0, 0)).shape == "point"

    def test_included_tilt_at_rest(self, tmp_path):
        tilt = "TILT=INCLUDE\r\n1\r\n3\r\n0 45 90\r\n0.8 0.9 1.0"
        web = self.read(tmp_path, tilt=tilt)
        assert web.flux_lm == pytest.approx(0.8 * self.read(tmp_path).flux_lm, rel=1e-12)
        assert "another flux when tilted" in web.remarks[0]

    def test_commas_part_numbers_and_labels_may_hold_anything(self, tmp_path):
        text = ies_text(uneven(np.zeros((1, 1)), DOWN[None]), DOWN, [0.0], keywords=["1 2 3, x"])
        head, body = text.split("TILT=NONE\r\n")
        path = write(tmp_path, head + "TILT=NONE\r\n" + body.replace(" ", ", "))
        assert read_photometry(path).flux_lm == pytest.approx(self.read(tmp_path).flux_lm)

    def test_flux_beyond_the_lamps_is_told(self, tmp_path):
        web = self.read(tmp_path, lumens=10.0)
        assert "more than the 10 lm" in web.remarks[0]
        told = self.read(tmp_path, keywords=["[_TOTALLUMINAIRELUMENS] 700", "[OTHER] in mW/sr"])
        assert "keywords say 700" in told.remarks[0] and "W or mW, not in lm" in told.remarks[1]

    def test_ldt_conversion_and_sets(self, tmp_path):
        row = [1000.0 / math.pi * np.cos(np.radians(GAMMA.clip(0, 90)))]
        text = ldt_text(row, GAMMA, [0.0], 1, flux=3000.0, conversion=0.5, output=50.0, sets=3)
        web = read_photometry(write(tmp_path, text.replace(".", ","), "a.ldt"))
        # Chords of the cosine over 2.5°: 1.6e-4 below it.
        assert web.flux_lm == pytest.approx(1500.0, rel=2e-4)
        assert web.remarks == ("it lists 3 sets of lamps; the first is taken",)

    def test_ldt_that_misses_its_shares_is_told(self, tmp_path):
        row = [1000.0 / math.pi * np.cos(np.radians(GAMMA.clip(0, 90)))]
        text = ldt_text(row, GAMMA, [0.0], 1, output=90.0, downward=60.0, tilt=15.0)
        remarks = read_photometry(write(tmp_path, text, "a.ldt")).remarks
        assert [w in r for w, r in zip(("tilt of 15", "90 %", "60 %"), remarks, strict=True)]


def line(text, number, new):
    lines = text.split("\r\n")
    lines[number - 1] = new
    return "\r\n".join(lines)


IES = ies_text(uneven(np.zeros((2, 1)), DOWN[None]), DOWN, [0.0, 90.0])
LDT = ldt_text([100 + 0 * DOWN], DOWN, [0.0], 1, output=62.8)


@pytest.mark.parametrize(
    ("text", "name", "said"),
    [
        (IES.replace("TILT=NONE", "NONE"), "a.ies", "no line TILT"),
        (IES.replace("TILT=NONE", "TILT=lamp.tlt"), "a.ies", "line 6: TILT=lamp.tlt"),
        (IES[:-20], "a.ies", "line 19: the file ends where intensity 3[0-9] of 38"),
        (IES + "5\r\n", "a.ies", "line 20: 1 more values"),
        (line(IES, 7, "1 -1 1 19 2 3 2"), "a.ies", "photometric type 3 .A.: only type C"),
        (line(IES, 7, "1 -1 1 19 2 1 4"), "a.ies", "line 7: units type = 4: must lie between 1"),
        (line(IES, 7, "1 -1 1 19.5 2 1 2"), "a.ies", "line 7: number of vertical angles = 19.5"),
        (line(IES, 7, "1 -1 0 19 2 1 2"), "a.ies", "line 7: candela multiplier = 0"),
        (line(IES, 7, "1 -5 1 19 2 1 2"), "a.ies", "lumens per lamp = -5"),
        (line(IES, 8, "0.2 wide 0"), "a.ies", "line 8: luminous dimension 2 of 3 = 'wide'"),
        (line(IES, 10, "0 5 10 15 15 25 30"), "a.ies", "vertical angle 5 = 15 follows 15"),
        (line(IES, 13, "0 80"), "a.ies", "horizontal angles from 0 to 80"),
        (line(IES, 14, "-50 1 1 1 1 1 1"), "a.ies", "intensity 1 of half-plane 1 = -50"),
        (line(IES, 12, "70 75 80 85 89"), "a.ies", "vertical angles end at 89"),
        (line(LDT, 3, "7"), "a.ldt", "line 3: symmetry Isym = 7: must lie between 0 and 4"),
        (line(LDT, 4, "x"), "a.ldt", "line 4: number of half-planes Mc = 'x'"),
        (line(LDT, 3, "4"), "a.ldt", "line 4: Mc = 1: must be a multiple of 4"),
        (line(LDT, 24, "0"), "a.ldt", "line 24: conversion factor = 0"),
        (line(LDT, 29, "-7"), "a.ldt", "line 29: flux of the lamps"),
        (LDT[:-30], "a.ldt", "the file ends where intensity 1[0-9] of 19"),
        (LDT + "9\r\n", "a.ldt", "1 more values"),
        (LDT[:40], "a.ldt", "the file ends where size of the luminaire"),
        (line(LDT, 23, "10"), "a.ldt", "add up to 62.8.* %.*line 23 says 10 %: at most 25 %"),
        ("\x00\x01", "a.ldt", "byte 0 is 0: this is no text"),
        ("hello", "a.ldt", "line 1: the file ends where symmetry"),
    ],
)
def test_files_that_cannot_be_used(tmp_path, text, name, said):
    path = write(tmp_path, text, name)
    with pytest.raises(InputError, match=said) as caught:
        read_photometry(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_dark_and_missing_files(tmp_path):
    with pytest.raises(MissingFileError, match="none.ies: no such file"):
        read_photometry(tmp_path / "none.ies")
    path = write(tmp_path, ies_text(np.zeros((1, 19)), DOWN, [0.0]))
    with pytest.raises(InputError, match="no intensity is above zero"):
        read_photometry(path)


#: Stated by the files themselves: EULUMDAT by LORL and lamp flux; sample_A by a keyword, before its
#: multiplier of 1.32; LLIA… in a keyword as its total.
CORPUS = {
    "sample1.ldt": (1983.0, 1e-3),
    "sample2.ldt": (4600.0, 1e-3),
    "sample6.ldt": (1800.0 * 0.999492, 1e-3),
    "sample10.ldt": (7000.0, 1e-3),
    "sample_A.ies": (91.6 * 1.32, 3e-3),
}


@pytest.mark.parametrize("name", sorted(CORPUS))
def test_real_files_give_the_flux_they_state(name):
    folder = os.environ.get("PATCHLIGHT_CORPUS")
    if not folder or not (Path(folder) / "photometry").is_dir():
        pytest.skip("PATCHLIGHT_CORPUS is not set")
    web = read_photometry(Path(folder) / "photometry" / name)
    flux, tolerance = CORPUS[name]
    # Rounding of the stored intensities, and chords against the laboratory's own zones.
    assert web.flux_lm == pytest.approx(flux, rel=tolerance)
