"""Distribution of the illuminance over the measured area."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.model import SensorResult

from . import figures
from .levels import level_text, pale, scale_for
from .metrics import RequirementResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Fewer points than this have no distribution worth drawing.
MIN_POINTS = 4


def histogram_figure(
    grid: SensorResult, requirements: Sequence[RequirementResult] = ()
) -> Figure | None:
    """Share of the area by illuminance, and the share that reaches each illuminance.

    None for grids too small or entirely dark. Drawn inside `figures.look`.
    """
    e = np.asarray(grid.illuminance_lx, dtype=np.float64)
    weight = np.asarray(grid.area_m2, dtype=np.float64)
    if len(e) < MIN_POINTS or not e.max() > 0.0 or not weight.sum() > 0.0:
        return None
    low, high = float(e.min()), float(e.max())
    if high - low < 0.02 * high:
        low, high = low - 0.01 * high, high + 0.01 * high
    bins = np.linspace(low, high, int(np.clip(2.0 * np.sqrt(len(e)), 8, 30)) + 1)
    share = 100.0 * np.histogram(e, bins, weights=weight)[0] / weight.sum()
    scale = scale_for(e)
    colors = pale(scale.colors())[scale.index(0.5 * (bins[1:] + bins[:-1]))]
    figure = figures.new_figure(7.0, 2.3)
    axes = figure.add_axes((0.072, 0.2, 0.80, 0.62))
    axes.bar(
        bins[:-1],
        share,
        np.diff(bins),
        align="edge",
        color=colors,
        edgecolor="white",
        linewidth=0.5,
    )
    axes.set_ylabel("share of area per bin [%]", size=7.5)
    axes.set_xlabel("illuminance E [lx]", size=7.5, labelpad=2)
    order = np.argsort(e)
    reached = 100.0 * np.cumsum(weight[order][::-1])[::-1] / weight.sum()
    if len(order) > 500:  # more steps than pixels only make the page large
        shown = np.unique(np.linspace(0, len(order) - 1, 500).astype(np.int64))
        order, reached = order[shown], reached[shown]
    curve = axes.twinx()
    curve.step(
        np.concatenate([[low], e[order], [e[order][-1]]]),
        np.concatenate([[100.0], reached, [0.0]]),
        where="pre", color=figures.INK, linewidth=1.3,
    )  # fmt: skip
    curve.set_ylim(0.0, 108.0)
    curve.set_yticks([0, 25, 50, 75, 100])
    curve.set_ylabel("area with at least E [%]", size=7.5)
    marks = [("E_avg", grid.mean(e), figures.INK, "-")]
    for r in requirements:
        if r.metric in ("E_avg_lx", "E_min_lx", "E_max_lx"):
            for bound, word in ((r.minimum, "≥"), (r.maximum, "≤")):
                if bound is not None and low - 0.3 * (high - low) <= bound <= high * 1.5:
                    marks.append(
                        (f"{r.metric[:-3]} {word} {bound:g} asked", bound, "#b3261e", "--")
                    )
    ends = [m[1] for m in marks]
    span = max([high, *ends]) - min([low, *ends])
    axes.set_xlim(min([low, *ends]) - 0.02 * span, max([high, *ends]) + 0.02 * span)
    level = 1.02
    previous = -np.inf
    for text, x, color, style in sorted(marks, key=lambda m: m[1]):
        axes.axvline(x, color=color, linestyle=style, linewidth=1.0)
        # Marks close together are written one above the other.
        level = 1.11 if x - previous < 0.22 * span and level < 1.05 else 1.02
        previous = x
        axes.text(
            x, level, text.replace("E_avg", "$E_{avg}$").replace("E_min", "$E_{min}$")
            .replace("E_max", "$E_{max}$"),
            transform=axes.get_xaxis_transform(), size=7, color=color, ha="center", va="bottom",
        )  # fmt: skip
    axes.xaxis.set_major_formatter(lambda x, _: level_text(x))
    for a in (axes, curve):
        a.tick_params(labelsize=7, length=2.5, width=0.5)
        a.spines["top"].set_visible(False)
    return figure
