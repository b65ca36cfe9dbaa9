"""How results look at a Python prompt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from patchlight.solver.model import Result


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
