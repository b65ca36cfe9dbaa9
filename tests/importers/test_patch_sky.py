"""Files of measured skies: two layouts of the same 145 luminances, and what is wrong in others."""

import numpy as np
import pytest
from patchlight.importers import read_patch_sky
from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.model.patch_sky import PATCH_COUNT, patch_middles

VALUES = np.round(np.random.default_rng(11).uniform(100.0, 9000.0, PATCH_COUNT), 1)


def table(change=None, head="altitude_deg,luminance_cd_m2,azimuth_deg"):
    altitude, azimuth = patch_middles()
    rows = [
        f"{a:g},{v:g},{(b + 180.0) % 360.0 - 180.0:.4g}"
        for a, b, v in zip(altitude, azimuth, VALUES, strict=True)
    ]
    rows = rows[::-1]  # in any order
    if change is not None:
        change(rows)
    return "\n".join(["# measured", head, *rows, ""])


def written(folder, text):
    path = folder / "sky.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("between", [" ", ", ", ";", "\n"])
def test_numbers_in_order(tmp_path, between):
    sky = read_patch_sky(written(tmp_path, "# cd/m2\n" + between.join(map(str, VALUES))))
    assert sky.luminance_cd_m2 == tuple(VALUES.tolist())


def test_table_in_any_order(tmp_path):
    sky = read_patch_sky(
        written(tmp_path, table()), sun_altitude_deg=30.0, sun_azimuth_deg=100.0, cct_k=7000.0
    )
    assert sky.luminance_cd_m2 == tuple(VALUES.tolist())
    assert (sky.sun_altitude_deg, sky.sun_azimuth_deg, sky.cct_k) == (30.0, 100.0, 7000.0)


def test_the_zenith_has_any_azimuth(tmp_path):
    def turn(rows):
        rows[0] = rows[0].rsplit(",", 1)[0] + ",77"

    assert read_patch_sky(written(tmp_path, table(turn))).luminance_cd_m2[144] == VALUES[144]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no values"),
        (" ".join(["1"] * 144), "144 values: must be 145"),
        (" ".join(["1"] * 146), "146 values: must be 145"),
        ("1 2 x 4", "line 1: luminance_cd_m2 = 'x': must be a number"),
        ("1\n-2", "line 2: luminance_cd_m2 = -2: must lie between 0 and"),
        (table(head="altitude,luminance,azimuth"), "line 2: columns altitude, luminance, azimuth"),
        (table(lambda rows: rows.pop()), "1 of 145 patches have no value, the first is patch 1"),
        (table(lambda rows: rows.append(rows[3])), "line 148: a second value of patch"),
        (table(lambda rows: rows.insert(0, "3,5,9")), "degrees from the middle of the nearest"),
        (table(lambda rows: rows.insert(0, "3,5")), "line 3: 2 values: must be 3"),
        (table(lambda rows: rows.insert(0, "93,5,0")), "line 3: altitude_deg = 93: must lie"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as error:
        read_patch_sky(written(tmp_path, text))
    assert "sky.csv" in str(error.value) and "\n" not in str(error.value)


def test_files_that_are_none(tmp_path):
    with pytest.raises(MissingFileError, match="no such file"):
        read_patch_sky(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\x00\x01")
    with pytest.raises(InputError, match="no text file"):
        read_patch_sky(tmp_path / "b.csv")
    path = written(tmp_path, " ".join(["0"] * 145))
    with pytest.raises(InputError, match=r"sky\.csv: PatchSky: a black sky"):
        read_patch_sky(path, diffuse_illuminance_lx=1e4)
