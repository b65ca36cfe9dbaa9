"""What is to be known of the metrics of a year besides their values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .lm83 import LM83_HOURS
from .year_tables import (
    has_lm83_hours,
    is_whole_year,
    level_grids,
    sunlight_key,
    window_groups,
)

if TYPE_CHECKING:
    import xarray


def year_remarks(dataset: xarray.Dataset) -> list[str]:
    """Remarks on a dataset of `simulate_year`, and on what `year_rows` makes of it.

    Parameters
    ----------
    dataset : Dataset
        Of `simulate_year`.
    """
    told = str(dataset.attrs.get("remarks", "")).splitlines()
    return [text for text in (*told, *_of_metrics(dataset)) if text]


def _of_metrics(dataset: xarray.Dataset) -> list[str]:
    out = _of_grids(dataset)
    if is_whole_year(dataset) and not has_lm83_hours(dataset):
        out.append(
            f"schedule = {dataset.attrs.get('schedule', 'another')}: sDA, ASE and option 1 of LEED "
            f"are left out of the metrics: LM-83 has them of {LM83_HOURS} on every day"
        )
    if "state" in dataset.dims:
        groups = [name for name in dict.fromkeys(window_groups(dataset)) if name]
        if len(groups) > 1:
            out.append(
                f"light by the blinds of {len(groups)} window groups ({', '.join(groups)}) is "
                "summed: that is exact for direct light, but leaves out what closed blinds of one "
                "group send back of the light through another; no stated error holds that"
            )
    if (key := sunlight_key(dataset)) and not dataset.attrs.get("sun_above_deg", 0.0) > 0.0:
        step = dataset["sunlight_hours"].attrs.get("step_minutes")
        how = f"; hours are in steps of {step} minutes" if step else ""
        out.append(
            f"{key}: sun_above_deg = 0 counts the sun from the horizon on, but EN 17037 has a "
            f"least altitude for each site: give that{how}"
        )
    return out


def _of_grids(dataset: xarray.Dataset) -> list[str]:
    """Which grids are graded as work planes, where some are not."""
    level = level_grids(dataset)
    others = [name for name, is_level in level.items() if not is_level]
    if not others:
        return []
    graded = ", ".join(name for name, is_level in level.items() if is_level) or "no grid"
    return [
        f"{', '.join(others)}: not all points face straight up, so that illuminance, melanopic "
        "values where they are asked for, and hours of sun alone are told; DA, UDI, sDA, ASE, "
        "daylight factors, EN 17037's provision, LEED and BREEAM are defined on a horizontal work "
        f"plane: {graded} is graded by them"
    ]
