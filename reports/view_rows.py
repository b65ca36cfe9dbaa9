"""View out of a grid as rows of metrics and columns of its points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.view_out import LEVELS, ViewOut

#: Columns that `view_columns` fills.
VIEW_COLUMNS = ("sight_angle_deg", "view_distance_m", "view_sky", "view_landscape", "view_ground")


def view_rows(views: Mapping[str, ViewOut]) -> list[dict[str, Any]]:
    """Levels of EN 17037 of the view out of grids, by their name, as rows of ``metrics.csv``.

    Angles are exact but for the rays between which a narrow opening may lie: no error is stated.
    """
    rows = []
    for name, view in views.items():
        share = view.area_m2 / view.area_m2.sum()
        found: list[tuple[str, Any, str]] = [("EN17037_view_level", view.level or "none", "")]
        found += [
            (f"EN17037_view_{level}_pct", 100.0 * view.share(level), "% of area")
            for level in LEVELS
        ]
        angle = view.sight_angle_deg
        found.append(("sight_angle_mean_deg", float(share @ angle), "deg"))
        found.append(("sight_angle_least_deg", float(angle.min()), "deg"))
        rows += [
            {
                "id": f"{name}.{quantity}",
                "quantity": quantity,
                "sensor_id": name,
                "value": value,
                "low": None,
                "high": None,
                "unit": unit,
            }
            for quantity, value, unit in found
        ]
    return rows


def view_columns(view: ViewOut) -> list[FloatArray]:
    """Values of the points, one array for each of `VIEW_COLUMNS`; layers are 1 where seen."""
    layers = (view.sky, view.landscape, view.ground)
    return [view.sight_angle_deg, view.distance_m, *(np.asarray(one, float) for one in layers)]
