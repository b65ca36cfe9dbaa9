"""Verdicts, number formats, levels, pictures' tone and the batch summary."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from patchlight.reports import evaluate_requirements, write_batch_summary
from patchlight.reports.formats import console, number, with_error
from patchlight.reports.levels import scale_for
from patchlight.reports.metrics import verdict
from patchlight.reports.section import cut, joined, patch_triangles
from patchlight.reports.tonemap import apply, tone_map_for
from patchlight.solver.model import PatchSet, Result


@pytest.mark.parametrize(
    ("value", "error", "low", "high", "expected"),
    [
        (505, 5, 500, None, "pass"),
        (504.9, 5, 500, None, "not decidable"),
        (495, 5, 500, None, "not decidable"),
        (494.9, 5, 500, None, "fail"),
        (500, 0, 500, None, "pass"),
        (95, 5, None, 100, "pass"),
        (105, 5, None, 100, "not decidable"),
        (105.1, 5, None, 100, "fail"),
        (75, 5, 50, 100, "pass"),
        (97, 5, 50, 100, "not decidable"),
        (40, 5, 50, 100, "fail"),
    ],
)
def test_verdict_rule(
    value: float, error: float, low: float | None, high: float | None, expected: str
) -> None:
    assert verdict(value, error, low, high) == expected


def test_requirements_that_cannot_be_evaluated_say_why(build: Callable[..., Result]) -> None:
    asked = [
        {"sensors": "workplan", "metric": "E_avg_lx", "min": 500},
        {"sensors": "workplane", "metric": "E_mean", "min": 500},
        {"sensors": "workplane", "metric": "E_avg_lx"},
        {"sensors": "workplane", "metric": "E_avg_lx", "min": 266.0},
        {"sensors": "workplane", "metric": "U0", "min": 0.1, "max": 0.9},
    ]
    result = build(pieces=1, images={}, settings={"requirements": asked})
    found = evaluate_requirements(result)
    assert [r.verdict for r in found] == ["not decidable"] * 4 + ["pass"]
    assert "there are: workplane" in found[0].reason and "E_avg_lx" in found[1].reason
    assert "neither min nor max" in found[2].reason and "error" in found[3].reason
    assert found[4].line.startswith("pass: workplane U0 = 0.4")


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (451.2, 30.0, "451 ± 30"),
        (451.2, 30.01, "451 ± 31"),
        (512.34, 5.0, "512.3 ± 5.0"),
        (512.34, 0.312, "512.34 ± 0.32"),
        (512.34, 9.96, "512 ± 10"),
        (0.6131, 0.0121, "0.613 ± 0.013"),
        (0.3, 0.1 + 0.2, "0.30 ± 0.30"),
        (51234.0, 320.0, "51\u202f230 ± 320"),
        (51236.0, 1320.0, "51\u202f200 ± 1400"),
        (3.0, 120.0, "0 ± 120"),
        (5.25, 0.0, "5.250"),
        (5.25, None, "5.250"),
        (3e-15, 2e-17, "0"),
        (-3e-15, 0.2, "0.00 ± 0.20"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_error_sets_the_digits(value: float, error: float, text: str) -> None:
    assert with_error(value, error) == text


def test_terminals_get_plain_numbers() -> None:
    shown = [console(with_error(v, e)) for v, e in ((1e4, None), (123456.0, 78.0), (1e6, 1e4))]
    assert shown == ["10000", "123456 ± 78", "1000000 ± 10000"]


def test_numbers_have_sensible_digits() -> None:
    values = (0.0, 9.996, 1234567.0, 0.00012345, 2e-7, -3.5, None)
    assert [number(v) for v in values] == [
        "0", "10.0", "1\u202f230\u202f000", "0.000123", "2.00·10⁻⁷", "−3.50", "–",
    ]  # fmt: skip


@pytest.mark.parametrize("low", [1e-3, 0.3, 5.0, 90.0, 480.0, 3e4])
@pytest.mark.parametrize("ratio", [1.0, 1.05, 1.7, 3.0, 10.0, 200.0, 1e5])
def test_levels_are_few_rising_and_reach_the_top(low: float, ratio: float) -> None:
    scale = scale_for(np.array([low, low * ratio]))
    assert 2 <= scale.classes <= 10
    assert (np.diff(scale.levels) > 0).all()
    assert scale.levels[-1] >= low * ratio * (1 - 1e-9)
    assert scale.levels[0] <= max(low, low * ratio / 300.0) * (1 + 1e-9)


def test_office_levels_are_those_of_the_standard() -> None:
    levels = scale_for(np.array([100.0, 950.0])).levels
    np.testing.assert_allclose(levels, [100, 150, 200, 300, 500, 750, 1000])


def test_cut_of_a_sphere_is_a_circle() -> None:
    triangles = patch_triangles(PatchSet.sphere((1.0, 2.0, 3.0), 0.5))
    segments = cut(triangles, np.array([0.0, 0.0, 3.3]), np.array([0.0, 0.0, 1.0]))
    radius = np.hypot(segments[..., 0] - 1.0, segments[..., 1] - 2.0)
    # The grid's chords may stay 2e-4 of the size inside the sphere, four thirds of that at z.
    np.testing.assert_allclose(radius, 0.4, atol=5e-4)
    loops = joined(segments[..., :2])
    assert len(loops) == 1 and np.array_equal(loops[0][0], loops[0][-1])
    inside = joined(np.array([[[0.0, 0.0], [1.0, 0.0]], [[2.0, 0.0], [1.0, 0.0]]]))
    np.testing.assert_array_equal(inside[0][[0, -1], 0] % 2, [0, 0])
    assert len(inside) == 1 and len(inside[0]) == 2
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum()
    assert length == pytest.approx(2 * np.pi * 0.4, rel=5e-3)


@pytest.mark.parametrize("level", [1e-3, 1.0, 1e4])
def test_pictures_are_neither_black_nor_clipped(result: Result, level: float) -> None:
    rgb = level * np.asarray(result.images["door"].rgb)
    rgb[:30, :30] = 3e7 * level  # a lamp in view
    pixels = apply(rgb, tone_map_for(rgb))[..., :3] / 255.0
    assert 0.3 < np.median(pixels) < 0.75
    assert (pixels < 0.02).mean() < 0.01
    room = pixels[60:, :, :]
    assert (room > 0.995).all(axis=-1).mean() < 0.10  # the window may be white, the walls not


def test_tone_mapping_keeps_order_and_survives_darkness_and_holes() -> None:
    ramp = np.geomspace(1e-2, 1e4, 500)[None, :, None] * np.ones(3)
    pixels = apply(ramp, tone_map_for(ramp))
    assert (np.diff(pixels[0, :, 1].astype(int)) >= 0).all()
    ramp[0, :10] = np.nan
    pixels = apply(ramp, tone_map_for(ramp))
    assert (pixels[0, :10, 3] == 0).all() and (pixels[0, 10:, 3] == 255).all()
    dark = apply(np.zeros((2, 2, 3)), tone_map_for(np.zeros((2, 2, 3))))
    assert (dark[..., :3] == 0).all()


def test_batch_summary_links_reports_and_shows_failures(tmp_path: Path) -> None:
    items = [
        {"file": "a b#1.step", "status": "ok", "reason": "", "seconds": 12.0, "faces": 12,
         "patches": 60, "report": "a b#1-patchlight/report.html",
         "metrics": {"plane": {"E_avg_lx": 512.2}, "U0": float("nan")}},
        {"file": "bad<.step", "status": "failed", "reason": "bad<.step: not a STEP file",
         "seconds": None, "faces": None, "patches": None, "report": None, "metrics": {}},
    ]  # fmt: skip
    written = write_batch_summary(items, tmp_path / "out")
    html = written["summary.html"].read_text()
    assert 'href="./a%20b%231-patchlight/report.html"' in html
    assert "bad&lt;.step" in html and html.count('<tr class="fail-row">') == 1
    assert html.count("not a STEP file") == 2 and "1 of 2 files" in html
    assert "http" not in html
    with open(written["summary.csv"], newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows[0]["plane.E_avg_lx"] == "512.2" and rows[0]["U0"] == ""
    assert rows[1]["status"] == "failed" and rows[1]["reason"] == "not a STEP file"
    late = dict(items[0], status="not converged", reason="reached 0.04, asked 0.01")
    html = write_batch_summary([late], tmp_path / "late")["summary.html"].read_text()
    assert "1 of 1 files with a report" in html and '<tr class="open-row">' in html
    empty = write_batch_summary([], tmp_path / "none")
    assert "nothing to do" in empty["summary.html"].read_text()


def test_importing_loads_no_heavy_library() -> None:
    code = (
        "import sys, patchlight.reports as r; r.evaluate_requirements; r.rendering_status();"
        "heavy = {'OCP', 'cadquery', 'vtk', 'vtkmodules', 'pyvista', 'numba', 'matplotlib',"
        " 'colour', 'pandas', 'scipy', 'jinja2', 'OpenEXR', 'weasyprint'} & set(sys.modules);"
        "sys.exit(f'loaded: {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
