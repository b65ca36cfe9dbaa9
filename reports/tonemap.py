"""Pictures for the eye: tone mapping of absolute luminance to sRGB, and log false colours.

References
----------
.. [1] E. Reinhard, M. Stark, P. Shirley, J. Ferwerda, "Photographic tone reproduction for digital
   images", ACM Trans. Graphics 21(3), 2002.
.. [2] IEC 61966-2-1:1999, sRGB transfer function.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model.bands import LUMINANCE_WEIGHTS

from .formats import number, srgb_encode

#: Display luminance of the picture's log-average; interiors look natural a little above 0.18.
KEY = 0.27
#: Display luminance up to which the picture is linear, as a photograph is.
KNEE = 0.55
#: Decades shown by the false-colour luminance bar at most.
DECADES = 4.0


@dataclass(frozen=True, slots=True)
class ToneMap:
    """Settings of `apply`, stated below every picture.

    Attributes
    ----------
    adaptation_cd_m2 : float
        Log-average luminance the picture is exposed for. [cd/m²]
    white_cd_m2 : float
        Luminance shown as white. [cd/m²]
    """

    adaptation_cd_m2: float
    white_cd_m2: float

    def describe(self) -> str:
        """One line for captions."""
        return (
            f"Tone mapped for display: linear, {number(self.adaptation_cd_m2, 2)} cd/m² shown at "
            f"{100 * KEY:.0f} % of white; above {100 * KNEE:.0f} % the shoulder of Reinhard et al. "
            f"(2002, eq. 4) up to {number(self.white_cd_m2, 2)} cd/m²; sRGB"
        )


def luminance(rgb: NDArray[Any]) -> NDArray[np.float64]:
    """Luminance (h, w) of linear sRGB (h, w, 3), scaled in cd/m². [cd/m²]"""
    return np.asarray(rgb, dtype=np.float64) @ np.array(LUMINANCE_WEIGHTS)


def tone_map_for(rgb: NDArray[Any]) -> ToneMap:
    """Exposure from the picture itself: log-average without the darkest and brightest 2 %.

    The trim keeps a lamp in the field of view from turning the room black, and a black background
    from washing it out.
    """
    y = luminance(rgb)
    y = np.sort(y[np.isfinite(y) & (y > 0.0)], axis=None)
    if y.size == 0:
        return ToneMap(1.0, 1.0)
    # Pixels far below the picture's median are background: exposing for them would bleach it.
    y = y[y > 1e-3 * y[y.size // 2]]
    trim = int(0.02 * y.size)
    middle = y[trim : y.size - trim] if y.size > 2 * trim else y
    adaptation = float(np.exp(np.mean(np.log(middle))))
    # At least as far as white would be without compression.
    white = max(float(np.quantile(y, 0.995)), adaptation / KEY)
    return ToneMap(adaptation, white)


def apply(rgb: NDArray[Any], tone: ToneMap) -> NDArray[np.uint8]:
    """Tone-mapped sRGB (h, w, 4) of linear absolute ``rgb`` (h, w, 3); alpha 0 where not finite.

    The scaled luminance L = key · Y / Y_adaptation is the display luminance up to the knee k. Above
    it x = (L − k) / (1 − k) is compressed to x (1 + x / x_white²) / (1 + x) [1, eq. 4], which
    leaves the knee with slope 1; on the whole range that operator makes rooms look flat. Colours
    too saturated for the display are mixed with grey of the same luminance: they keep it and their
    hue.
    """
    rgb = np.asarray(rgb, dtype=np.float64)
    y = luminance(rgb)
    valid = np.isfinite(y)
    y = np.where(valid, np.maximum(y, 0.0), 0.0)
    safe = np.where(valid[..., None], np.maximum(rgb, 0.0), 0.0)
    scaled = KEY * y / tone.adaptation_cd_m2
    x = np.maximum(scaled - KNEE, 0.0) / (1.0 - KNEE)
    white = (KEY * tone.white_cd_m2 / tone.adaptation_cd_m2 - KNEE) / (1.0 - KNEE)
    shoulder = KNEE + (1.0 - KNEE) * x * (1.0 + x / white**2) / (1.0 + x)
    display = np.minimum(np.where(scaled > KNEE, shoulder, scaled), 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        color = safe * np.where(y > 0.0, display / y, 0.0)[..., None]
        excess = color.max(axis=-1)
        mix = np.where(excess > 1.0, (1.0 - display) / (excess - display), 1.0)
    color = display[..., None] + np.clip(mix, 0.0, 1.0)[..., None] * (color - display[..., None])
    out = np.empty((*y.shape, 4), dtype=np.uint8)
    out[..., :3] = np.round(255.0 * srgb_encode(np.clip(color, 0.0, 1.0)))
    out[..., 3] = np.where(valid, 255, 0)
    return out


def luminance_range(y: NDArray[Any]) -> tuple[float, float] | None:
    """Limits of a log scale for luminances ``y``, whole thirds of a decade; None if all dark."""
    y = np.asarray(y, dtype=np.float64)
    y = y[np.isfinite(y) & (y > 0.0)]
    if y.size == 0:
        return None
    low, high = np.quantile(y, (0.01, 0.9995))
    top = math.ceil(3.0 * math.log10(max(float(high), 1e-6)) - 1e-9) / 3.0
    bottom = math.floor(3.0 * math.log10(max(float(low), 1e-9)) + 1e-9) / 3.0
    bottom = min(max(bottom, top - DECADES), top - 1.0)
    return 10.0**bottom, 10.0**top
