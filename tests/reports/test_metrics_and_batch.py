"""Verdicts, number formats, levels, pictures' tone and the batch summary."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patchlight.reports import evaluate_requirements, figures, write_batch_summary
from patchlight.reports.formats import addend, console, coordinate, decimals, number, with_error
from patchlight.reports.lattice import find_lattice, smooth_field
from patchlight.reports.levels import scale_for
from patchlight.reports.metrics import verdict
from patchlight.reports.plan import SHORTEST, _isolux_lines
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


def test_parts_of_a_sum_have_its_decimals() -> None:
    """They add up as shown; what would vanish keeps two digits."""
    assert [addend(v, decimals(9864.2, 4)) for v in (9805.8, 58.4, 9864.2)] == [
        "9806",
        "58",
        "9864",
    ]
    places = decimals(46.67, 4)
    assert [addend(v, places) for v in (45.73, 0.941, 46.67)] == ["45.73", "0.94", "46.67"]
    assert [addend(v, 1) for v in (0.0, 1e-9, 0.00041)] == ["0", "0", "0.00041"]


def test_coordinates_that_are_rounding_are_zero() -> None:
    """A sensor stands a little before its face, far less than the grid is wide."""
    shown = [coordinate(c, 0.05, 4) for c in (2.5e-7, -0.0123456, 0.0)]
    assert shown == ["0", "−0.01235", "0"]
    assert coordinate(0.75, 0.0) == "0.750"  # a single point


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
         "metrics": {"plane": {"E_avg_lx": 512.2}, "U0": float("nan")},
         "errors": {"plane": {"E_avg_lx": 3.1}}, "accuracy_reached": 0.013,
         "warnings": ["odd <part>", "no floor"]},
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
    assert rows[0]["plane.E_avg_lx_error"] == "3.1" and rows[0]["U0_error"] == ""
    assert rows[0]["accuracy_reached"] == "0.013" and rows[1]["accuracy_reached"] == ""
    assert rows[0]["warnings"] == "odd <part> | no floor" and rows[1]["warnings"] == ""
    assert "512.2 ± 3.1" in html and "2 warnings" in html and "odd &lt;part&gt;" in html
    assert "1.3 %" in html
    assert rows[1]["status"] == "failed" and rows[1]["reason"] == "not a STEP file"
    late = dict(items[0], status="not converged", reason="reached 0.04, asked 0.01")
    html = write_batch_summary([late], tmp_path / "late")["summary.html"].read_text()
    assert "1 of 1 files with a report" in html and '<tr class="open-row">' in html
    empty = write_batch_summary([], tmp_path / "none")
    assert "nothing to do" in empty["summary.html"].read_text()


def test_batch_summary_shows_names_and_keeps_paths(tmp_path: Path) -> None:
    files = ("/data/parts/long name of a bracket.step", "/data/a/x.step", "/data/b/x.step")
    items = [{"file": file, "status": "ok", "report": None, "metrics": {}} for file in files]
    html = write_batch_summary(items, tmp_path)["summary.html"].read_text()
    assert f'<span title="{files[0]}">long name of a bracket.step</span>' in html
    assert ">a/x.step</span>" in html and ">b/x.step</span>" in html
    with open(tmp_path / "summary.csv", newline="") as stream:
        assert [row["file"] for row in csv.DictReader(stream)] == list(files)


def slanted_shadow(step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells (n, 2) of a 6 x 4 m floor, and light of 400 lx with a slanted strip of 100 lx."""
    x, y = (np.arange(0.5 * step, s, step) for s in (6.0, 4.0))
    uv = np.stack([g.ravel() for g in np.meshgrid(x, y, indexing="ij")], axis=-1)
    dark = np.abs(0.31 * uv[:, 0] - uv[:, 1] + 1.2) < 0.12
    return uv, np.full(len(uv), step**2), np.where(dark, 100.0, 400.0) + 3.0 * uv[:, 0]


def test_fields_do_not_overshoot_at_edges_of_shadow() -> None:
    uv, areas, values = slanted_shadow(0.2)
    lattice = find_lattice(uv, areas)
    assert lattice is not None
    u, v, fine = smooth_field(lattice, values)
    field = values[lattice.row]
    # Fine points between four cell centres lie within the four values; the rim is continued.
    iu = np.floor((u - lattice.u[0]) / lattice.step_u + 1e-9).astype(int)
    iv = np.floor((v - lattice.v[0]) / lattice.step_v + 1e-9).astype(int)
    inner_u, inner_v = (iu >= 0) & (iu < len(lattice.u) - 1), (iv >= 0) & (iv < len(lattice.v) - 1)
    iu, iv = iu[inner_u], iv[inner_v]
    corners = np.stack([field[np.ix_(iv + a, iu + b)] for a in (0, 1) for b in (0, 1)])
    inner = fine[np.ix_(inner_v, inner_u)]
    # Beside the strip the light is linear, which cubics keep to rounding.
    assert (inner <= corners.max(axis=0) + 1e-9).all()
    assert (inner >= corners.min(axis=0) - 1e-9).all()


def test_smooth_fields_keep_their_curvature() -> None:
    uv, areas, _ = slanted_shadow(0.5)
    values = 500.0 - 20.0 * ((uv[:, 0] - 3.1) ** 2 + (uv[:, 1] - 2.1) ** 2)
    lattice = find_lattice(uv, areas)
    assert lattice is not None
    u, v, fine = smooth_field(lattice, values)
    exact = 500.0 - 20.0 * ((u[None, :] - 3.1) ** 2 + (v[:, None] - 2.1) ** 2)
    inside = (slice(16, -16), slice(16, -16))  # Catmull-Rom cubics are exact for parabolas inside
    top = exact[inside] < values.max()  # ... up to the range of the values
    assert np.abs(fine - exact)[inside][top].max() < 1e-9


@pytest.mark.parametrize("step", [0.1, 0.2, 0.5])
def test_isolux_lines_have_no_little_rings(step: float) -> None:
    uv, areas, values = slanted_shadow(step)
    values[np.argmin(np.hypot(*(uv - [5.0, 1.0]).T))] = 60.0  # a single dark point
    big = np.hypot(*(uv - [1.5, 2.8]).T) < 0.75
    values[big] = 150.0
    lattice = find_lattice(uv, areas)
    assert lattice is not None
    with figures.look():
        axes = figures.new_figure(4.0, 3.0).add_subplot()
        levels = np.array([75.0, 100.0, 150.0, 200.0, 300.0, 500.0])
        field = smooth_field(lattice, values)
        every = axes.contour(*field, levels=levels)
        lines = _isolux_lines(axes, field, levels, SHORTEST * step)

    def rings(found: Any) -> list[np.ndarray]:
        kept = [line for level in found.allsegs for line in level if len(line)]
        return [line for line in kept if (line[0] == line[-1]).all()]

    def length(line: np.ndarray) -> float:
        return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())

    assert min(map(length, rings(every))) < SHORTEST * step <= min(map(length, rings(lines)))
    centers = np.array([line.mean(axis=0) for line in rings(lines)])
    assert np.hypot(*(centers - [1.5, 2.8]).T).min() < 0.5 * step + 0.1  # the large one is kept


def test_a_single_dark_point_leaves_no_line() -> None:
    uv, areas, values = slanted_shadow(0.5)
    values = np.full(len(uv), 400.0)
    values[44] = 10.0
    lattice = find_lattice(uv, areas)
    assert lattice is not None
    with figures.look():
        axes = figures.new_figure(4.0, 3.0).add_subplot()
        field = smooth_field(lattice, values)
        assert _isolux_lines(axes, field, np.array([50.0]), SHORTEST * 0.5) is None


def test_importing_loads_no_heavy_library() -> None:
    code = (
        "import sys, patchlight.reports as r; r.evaluate_requirements; r.rendering_status();"
        "heavy = {'OCP', 'cadquery', 'vtk', 'vtkmodules', 'pyvista', 'numba', 'matplotlib',"
        " 'colour', 'pandas', 'scipy', 'jinja2', 'OpenEXR', 'weasyprint'} & set(sys.modules);"
        "sys.exit(f'loaded: {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
