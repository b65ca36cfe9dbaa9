"""Right-hand panel of a plan: north arrow, colour bar and scale bar."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import figures
from .levels import Scale, level_text, pale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Width of the panel. [inch]
PANEL = 0.95


def draw_bar(figure: Figure, scale: Scale, values: NDArray[np.float64], quantity: str) -> None:
    """Colour bar with one box a class."""
    width, height = figure.get_size_inches()
    tall = min(height - 1.5, 3.0)
    axes = figure.add_axes((
        (width - PANEL + 0.22) / width, 0.48 / height, 0.17 / width, tall / height
    ))  # fmt: skip
    n = scale.classes
    axes.barh(np.arange(n) + 0.5, 1.0, height=1.0, color=pale(scale.colors()))
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, n)
    low, high = float(values.min(initial=0)), float(values.max(initial=0))
    labels = [level_text(x) for x in scale.levels]
    if len(values) and values.min() < scale.levels[0] * (1 - 1e-9):
        labels[0] = f"< {labels[0]}" if low < scale.levels[0] else labels[0]
    if high > scale.levels[-1] * (1 + 1e-9):
        labels[-1] = f"> {labels[-1]}"
    axes.set_yticks(np.arange(n + 1), labels=labels)
    axes.yaxis.tick_right()
    axes.tick_params(labelsize=7, length=2, width=0.5, pad=2)
    axes.set_xticks([])
    axes.set_title(quantity, size=8, weight="bold", pad=6, loc="left")


def draw_length(figure: Figure, axes: Axes, box: tuple[float, float, float, float]) -> None:
    """Scale bar of a round length, at most as long as the panel is wide."""
    width, height = figure.get_size_inches()
    per_metre = axes.get_position().width * width / (box[1] - box[0])
    longest = 0.72 / per_metre
    decade = 10.0 ** math.floor(math.log10(longest))
    metres = next(s * decade for s in (5.0, 2.0, 1.0) if s * decade <= longest * (1 + 1e-9))
    bar = metres * per_metre
    panel = figure.add_axes(
        ((width - PANEL + 0.2) / width, 0.1 / height, 0.75 / width, 0.22 / height)
    )
    panel.set_axis_off()
    panel.set_xlim(0.0, 0.75)
    panel.set_ylim(0.0, 0.22)
    for k, color in enumerate((figures.INK, "white")):
        panel.fill(
            [k * bar / 2, (k + 1) * bar / 2, (k + 1) * bar / 2, k * bar / 2],
            [0.02, 0.02, 0.065, 0.065], facecolor=color, edgecolor=figures.INK, linewidth=0.6,
            clip_on=False,
        )  # fmt: skip
    panel.text(0.5 * bar, 0.095, f"{metres:g} m", size=7, ha="center", va="bottom")


def draw_north(figure: Figure, north_deg: float) -> None:
    width, height = figure.get_size_inches()
    size = 0.5
    axes = figure.add_axes((
        (width - PANEL + 0.2) / width, (height - size - 0.06) / height, size / width, size / height
    ))  # fmt: skip
    axes.set_axis_off()
    axes.set_xlim(-1.35, 1.35)
    axes.set_ylim(-1.35, 1.35)
    angle = math.radians(north_deg)
    north = np.array([math.sin(angle), math.cos(angle)])
    side = np.array([north[1], -north[0]])
    tip, tail = 0.75 * north, -0.8 * north
    for sign, face in ((1.0, figures.INK), (-1.0, "white")):
        shape = np.array([tip, tail + sign * 0.45 * side, -0.45 * north])
        axes.fill(*shape.T, facecolor=face, edgecolor=figures.INK, linewidth=0.7)
    axes.text(
        1.15 * north[0], 1.15 * north[1], "N", ha="center", va="center", size=7.5, weight="bold"
    )
