"""How results look at a Python prompt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from patchlight.solver.model import (
    Certificate,
    Face,
    Model,
    Part,
    PatchSet,
    Photometry,
    Result,
)
from patchlight.solver.model.reprs import lux_text


def test_result_shows_size_accuracy_and_means(result: Result) -> None:
    lines = repr(result).splitlines()
    assert lines[0] == (
        "<Result 'Office <B&B> 3.14': 4 parts, 31 patches, 1116 elements; accuracy 0.01 reached"
    )
    assert lines[1] == "  workplane: 95 sensors, E_avg 266.3 ± 2.7 lx, 106.5 to 726.0 lx"
    assert lines[2] == "  pictures: door"
    assert lines[3].startswith("  1 warning, the first: office/vase") and lines[3].endswith(">")
    assert len(lines) == 4 and "array" not in repr(result)


def test_short_results_stay_on_one_line(build: Callable[..., Result]) -> None:
    result = build(pieces=1, images={}, sensors={}, settings={}, warnings=(), converged=False)
    assert repr(result) == (
        "<Result 'Office <B&B> 3.14': 4 parts, 31 patches, 31 elements; accuracy not reached>"
    )


def test_many_grids_are_counted(result: Result) -> None:
    grid = result.sensors["workplane"]
    many = replace(result, sensors={f"g{k}": grid for k in range(10)})
    text = repr(many)
    assert "g7" in text and "g8" not in text and "and 2 more grids" in text


def test_grids_show_their_mean_and_survive_having_none(result: Result) -> None:
    grid = result.sensors["workplane"]
    assert repr(grid) == (
        "<SensorResult 'workplane': 95 sensors, E_avg 266.3 ± 2.7 lx, 106.5 to 726.0 lx>"
    )
    none = replace(
        grid,
        points=grid.points[:0],
        normals=grid.normals[:0],
        area_m2=grid.area_m2[:0],
        illuminance_lx=grid.illuminance_lx[:0],
        error_lx=grid.error_lx[:0],
        components={},
    )
    assert repr(none) == "<SensorResult 'workplane': 0 sensors>"
    nan = replace(grid, illuminance_lx=np.full(95, np.nan))
    assert "nan" in repr(nan)
    high = replace(grid, illuminance_lx=np.full(95, 12345678.0))
    assert "E_avg 12350000 ±" in repr(high)


def test_models_and_photometry_show_numbers_not_arrays() -> None:
    patches = PatchSet.box((1, 1, 1))
    part = Part("a/box", "solid")
    faces = tuple(Face(0, k + 1, "plane", True, 1, 0.0, 0.0, 1.0) for k in range(6))
    model = Model("a", (part,), faces, patches, Certificate((), ()), source="a.step")
    assert repr(model) == "<Model 'a' of a.step: 1 part, 6 faces, 6 patches>"
    doubtful = replace(model, source="a", warnings=("odd",))
    assert repr(doubtful) == "<Model 'a': 1 part, 6 faces, 6 patches; 1 warning>"
    web = Photometry(
        np.array([0.0, 360.0]), np.array([0.0, 90.0]), np.full((2, 2), 100.0), name="lamp",
        power_w=9.0, source="lamp.ldt", remarks=("old",),
    )  # fmt: skip
    assert repr(web) == (
        "<Photometry 'lamp': 628.3 lm, 9 W, 2 half-planes x 2 angles, up to 100 cd; lamp.ldt; "
        "1 remark>"
    )
    assert repr(patches) == "<PatchSet: 6 patches>"


def test_points_without_area_count_in_no_metric(result: Result) -> None:
    """They lie inside solids; without any other all count."""
    grid = result.sensors["workplane"]
    low, high = np.argmin(grid.illuminance_lx), np.argmax(grid.illuminance_lx)
    area = np.array(grid.area_m2)
    area[[low, high]] = 0.0
    less = replace(grid, area_m2=area)
    e = np.delete(grid.illuminance_lx, [low, high])
    assert less.metrics["E_min_lx"] == e.min() and less.metrics["E_max_lx"] == e.max()
    assert less.metrics["U0"] == e.min() / less.metrics["E_avg_lx"]
    error = np.delete(grid.error_lx, [low, high])
    assert less.metric_errors["E_min_lx"] == error[np.argmin(e)]
    assert f"{lux_text(e.min())} to {lux_text(e.max())} lx" in repr(less)
