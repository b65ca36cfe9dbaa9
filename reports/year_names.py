"""Names of the metrics of a year, as those who plan daylight know them, for their keys."""

from __future__ import annotations

import re

from .autonomy import UDI_LX, UDI_NAMES
from .en17037 import LEVELS, MINIMUM_AREA, TARGET_AREA
from .green_credits import ASE_TOLD, HOURS, RANGE_LX, USES
from .lm83 import ASE_HOURS, ASE_LX, SDA_LX, SDA_SHARE
from .melanopic import ENOUGH_LX

_MEAN = "mean of the area"
_USE = "in the hours of use"
_SDA = f"sDA{SDA_LX:g}/{100 * SDA_SHARE:g}%"
_ASE = f"ASE{ASE_LX:g},{ASE_HOURS:g}h"
_NAMES = {
    "E_mean_lx": f"Mean illuminance {_USE}, Ē",
    "E_mean_with_electric_lx": f"Mean illuminance {_USE} with electric light, Ē",
    **{
        f"EDI{key}": f"{name}{more}, modelled"
        for end, more in (("", ""), ("_with_electric", " with electric light"))
        for key, name in (
            (f"_mean{end}_lx", f"Mean melanopic equivalent daylight illuminance {_USE}"),
            (
                f"{ENOUGH_LX:g}_mean{end}_pct",
                f"Melanopic EDI of {ENOUGH_LX:g} lx or more {_USE} (asked for at eyes), {_MEAN}",
            ),
        )
    },
    "DA300_mean_pct": f"Daylight autonomy DA{SDA_LX:g}, {_MEAN}",
    "cDA300_mean_pct": f"Continuous daylight autonomy cDA{SDA_LX:g}, {_MEAN}",
    "blinds_not_in_first_state_pct": f"Blinds not in their first state {_USE}",
    "sDA300_50_pct": f"Spatial daylight autonomy {_SDA} (LM-83)",
    "ASE1000_250h_pct": f"Annual sunlight exposure {_ASE} (LM-83)",
    "LEED_option_1_points": "LEED v4.1 daylight, option 1 (sDA): points",
    "LEED_option_1_sun_to_be_explained": (
        f"LEED v4.1 daylight, option 1: ASE above {100 * ASE_TOLD:g} %, to be explained"
    ),
    "LEED_option_2_pct": (
        f"LEED v4.1 daylight, option 2: area with {RANGE_LX[0]:g} to {RANGE_LX[1]:g} lx at "
        f"{HOURS[0]} h and {HOURS[1]} h"
    ),
    "LEED_option_2_points": "LEED v4.1 daylight, option 2 (illuminance): points",
    "light_exposure_klx_h": f"Annual light exposure, {_MEAN}",
    "DF_mean_pct": "Mean daylight factor",
    "EN17037_median_diffuse_lx": "Median external diffuse illuminance (EN 17037)",
    "EN17037_view_level": "View out (EN 17037): level",
    "sight_angle_mean_deg": f"Horizontal sight angle, {_MEAN}",
    "sight_angle_least_deg": "Horizontal sight angle, least",
}
_BINS = (
    f"below {UDI_LX[0]:g} lx", f"{UDI_LX[0]:g} to {UDI_LX[1]:g} lx",
    f"{UDI_LX[1]:g} to {UDI_LX[2]:g} lx", f"above {UDI_LX[2]:g} lx",
)  # fmt: skip
_NAMES |= {
    f"UDI_{name.replace(' ', '_')}_mean_pct": f"Useful daylight illuminance, {name} ({bin_}), mean"
    for name, bin_ in zip(UDI_NAMES, _BINS, strict=True)
}
#: Ways of EN 17037 to tell the provision of daylight.
_WAYS = {
    "by_factor": "method 1, daylight factors",
    "hour_first": "method 2, area hour by hour",
    "sensor_first": "method 2, hours point by point",
}
#: Keys with a day, a group of windows or of lamps in them.
_PATTERNS = (
    (r"sunlight_(.+)_mean_h", rf"Exposure to sunlight on \1 (month-day), {_MEAN}"),
    (r"sunlight_(.+)_most_h", r"Exposure to sunlight on \1 (month-day), sunniest point"),
    (r"EN17037_sunlight_(.+)_level", r"Exposure to sunlight on \1 (EN 17037): level"),
    (r"EN17037_view_(.+)_pct", r"View out (EN 17037): area with level \1 or better"),
    (r"blinds_(.+)_not_in_first_state_pct", rf"Blinds of \1 not in their first state {_USE}"),
    (r"electric_(.+)_h", r"Burning hours of the lamps \1"),
)


def _provision() -> dict[str, str]:
    out = {}
    for key, way in _WAYS.items():
        stem = f"Daylight provision (EN 17037, {way})"
        out[f"EN17037_{key}_level"] = f"{stem}: level"
        what = "area" if key == "sensor_first" else "hours"
        for level, (target, least) in LEVELS.items():
            if key == "by_factor":
                ends = (f"area with the factor of {target:g} lx", f"area with that of {least:g} lx")
            elif what == "hours":
                ends = (
                    f"hours with {target:g} lx on {100 * TARGET_AREA:g} % of the area",
                    f"hours with {least:g} lx on {100 * MINIMUM_AREA:g} % of the area",
                )
            else:
                ends = (
                    f"area with {target:g} lx in half of the hours",
                    f"area with {least:g} lx in half of the hours",
                )
            out[f"EN17037_{key}_{level}_target_pct"] = f"{stem}, {level}: {ends[0]}"
            out[f"EN17037_{key}_{level}_minimum_pct"] = f"{stem}, {level}: {ends[1]}"
    return out


def _breeam() -> dict[str, str]:
    out = {}
    for key, use in USES.items():
        stem = f"BREEAM Hea 01, {key.replace('_', ' ')}"
        out[f"BREEAM_{key}"] = f"{stem}: requirement"
        out[f"BREEAM_{key}_mean_h"] = f"{stem}: hours with a mean of {use.mean_lx:g} lx"
        out[f"BREEAM_{key}_least_h"] = (
            f"{stem}: hours with {use.least_lx:g} lx at the worst-lit point of "
            f"{100 * use.area:g} % of the area"
        )
        out[f"BREEAM_{key}_least_pct"] = (
            f"{stem}: area with {use.least_lx:g} lx in {use.least_h:g} hours"
        )
    return out


_NAMES |= _provision() | _breeam()


def metric_name(quantity: str) -> str:
    """Name of a metric of `year_rows` or `view_rows`; its key where it has none."""
    if quantity in _NAMES:
        return _NAMES[quantity]
    for pattern, name in _PATTERNS:
        found = re.fullmatch(pattern, quantity)
        if found is not None:
            return found.expand(name)
    return quantity
