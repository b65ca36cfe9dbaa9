"""The harness of years: the hall with windows, weather files, and a run of the smallest."""

import json

import numpy as np
import pytest


def test_hall_has_windows():
    """Its wall is 4 strips about an opening, which face the hall."""
    from large_room import large_room
    from year_hall import HEAD, MARGIN, SILL, year_hall

    scene, closed = year_hall(2, 30), large_room(2)
    assert len(scene.patches) == len(closed.patches) - 1 + 4
    areas, normals = scene.patches.areas(), scene.patches.normals(0.5, 0.5)
    opening = (4.0 - 2 * MARGIN) * (HEAD - SILL)
    hall = scene.patches.part_index == 0
    whole = closed.patches.areas()[closed.patches.part_index == 0].sum()
    assert areas[hall].sum() == pytest.approx(whole - opening)
    np.testing.assert_allclose(normals[-4:], np.tile([0.0, 1.0, 0.0], (4, 1)), atol=1e-12)
    assert len(scene.sensors[0]) == 30


def test_weather_of_gendaymtx(tmp_path):
    from year_accuracy import weather_of
    from year_hall import weather

    head = "place a\nlatitude 50\nlongitude -8\ntime_zone -15\nsite_elevation 100\n"
    path = tmp_path / "some.wea"
    path.write_text(head + "weather_data_file_units 1\n1 1 0.5 0 0\n1 1 1.5 500 100\n")
    found = weather_of(path)
    assert (found.site.latitude_deg, found.site.longitude_deg) == (50.0, 8.0)
    assert found.utc_offset_h == 1.0 and len(found) == 2
    assert found.direct_normal_w_m2[1] == 500.0
    made = weather()
    assert made.whole_year and 1500.0 < float((made.direct_normal_w_m2 > 0).sum()) < 4000.0


@pytest.mark.slow
def test_a_year_is_measured(tmp_path):
    from year_hall import measure

    record = json.loads(json.dumps(measure(1, 20, 0.4, 6.0, str(tmp_path))))
    assert record["elements"] >= record["patches"]
    # The process may have taken more before.
    assert record["peak_bytes"] >= record["bytes_before"] > 0 and record["told_bytes"] > 0
    assert record["mean_lx"] > 10.0 and 0.0 < record["DA300_mean_pct"] < 100.1
    assert (tmp_path / "annual.nc").stat().st_size == record["file_bytes"]
