"""Camera images: OpenEXR, tone-mapped PNG and false-colour luminance PNG."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from patchlight.solver.model import CameraImage, Result

from . import exr, figures, tonemap
from .files import safe_names, write_bytes
from .formats import number
from .levels import palette
from .run_files import tool_version


@dataclass(frozen=True, slots=True)
class Picture:
    """A camera image as shown in the report."""

    name: str
    caption: str
    tone_mapped: bytes
    false_color: bytes
    statistics: dict[str, float]


def picture(name: str, image: CameraImage) -> Picture:
    """Both PNGs of ``image`` and its luminance statistics. [cd/m²]"""
    tone = tonemap.tone_map_for(image.rgb)
    y = np.asarray(image.luminance_cd_m2, dtype=np.float64)
    valid = y[np.isfinite(y)]
    statistics = (
        {
            "mean": float(valid.mean()),
            "median": float(np.median(valid)),
            "max": float(valid.max()),
        }
        if valid.size
        else {}
    )
    dark = "" if valid.size and valid.max() > 0.0 else "The picture is black: no light reaches it. "
    return Picture(
        name=name,
        caption=dark + tone.describe(),
        tone_mapped=figures.png_of_array(tonemap.apply(image.rgb, tone)),
        false_color=false_color(y),
        statistics=statistics,
    )


def false_color(y: np.ndarray) -> bytes:
    """PNG of luminances ``y`` (h, w) in log colours with a scale bar in cd/m²."""
    from matplotlib.colors import ListedColormap, LogNorm

    height, width = y.shape
    limits = tonemap.luminance_range(y) or (0.1, 1.0)
    with figures.look():
        dpi = 100.0
        # The picture keeps its pixels; the bar is added to the right of it.
        bar = max(110.0, 0.16 * width)
        total = width + bar
        figure = figures.new_figure(total / dpi, height / dpi)
        axes = figure.add_axes((0.0, 0.0, width / total, 1.0))
        axes.set_axis_off()
        colormap = ListedColormap(palette(np.linspace(0.0, 1.0, 256))).with_extremes(bad="#ffffff")
        norm = LogNorm(*limits, clip=True)
        shown = np.where(np.isfinite(y), np.maximum(y, limits[0]), np.nan)
        drawn = axes.imshow(
            np.ma.masked_invalid(shown), cmap=colormap, norm=norm, aspect="auto",
            interpolation="nearest",
        )  # fmt: skip
        size = float(np.clip(0.0135 * width, 7.0, 18.0))
        scale = figure.add_axes((
            (width + 0.16 * bar) / total, 0.06, 0.20 * bar / total, 0.82,
        ))  # fmt: skip
        colorbar = figure.colorbar(drawn, cax=scale)
        ticks = _log_ticks(*limits)
        colorbar.set_ticks(ticks, labels=[number(t, 2) if t < 10 else f"{t:g}" for t in ticks])
        colorbar.ax.minorticks_off()
        colorbar.ax.tick_params(labelsize=size, length=3)
        colorbar.outline.set_linewidth(0.5)  # type: ignore[operator]
        figure.text((width + 0.14 * bar) / total, 0.93, "L [cd/m²]", size=size, weight="bold")
        return figures.png(figure, dpi=dpi)


def _log_ticks(low: float, high: float) -> list[float]:
    """Ticks 1-2-5 a decade, or whole decades where those would crowd."""
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    steps = (1.0, 2.0, 5.0) if high / low < 2e3 else (1.0, 3.0)
    ticks = [s * 10.0**d for d in decades for s in steps]
    return [t for t in ticks if low * 0.999 <= t <= high * 1.001]


def write_images(result: Result, folder: Path) -> tuple[dict[str, Path], list[Picture]]:
    """All image files below ``images/``, and the pictures for the report."""
    written: dict[str, Path] = {}
    pictures = []
    # images/scene_falsecolor.png is the 3-D still.
    stems = safe_names(result.images, endings=("", "_falsecolor"), reserved=("scene_falsecolor",))
    for name, stem in stems.items():
        image = result.images[name]
        key = f"images/{stem}"
        written[f"{key}.exr"] = exr.write_exr(
            image,
            folder / f"{key}.exr",
            software=f"patchlight {tool_version()}",
            comments=f"{result.scene.title}: camera {name}; schema_version 1",
        )
        shown = picture(name, image)
        written[f"{key}.png"] = write_bytes(folder / f"{key}.png", shown.tone_mapped)
        written[f"{key}_falsecolor.png"] = write_bytes(
            folder / f"{key}_falsecolor.png", shown.false_color
        )
        pictures.append(shown)
    return written, pictures
