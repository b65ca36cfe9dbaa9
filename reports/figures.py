"""Matplotlib without global state: own figures, one look, SVG or PNG bytes."""

from __future__ import annotations

import base64
import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, MUTED, PAPER = "#1d2530", "#5d6b7a", "#ffffff"
#: The writing library's version would change the bytes of equal pictures.
_NO_SOFTWARE: Any = {"Software": None}
_LOOK = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "Helvetica", "sans-serif"],
    "font.size": 8.5,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "svg.fonttype": "none",  # real text: small files, searchable, in the reader's font
    "svg.hashsalt": "patchlight",  # same numbers, same file
    "path.simplify": True,
}


def look() -> Any:
    """Context in which the figures of a report are drawn."""
    import matplotlib

    return matplotlib.rc_context(_LOOK)  # type: ignore[arg-type]


def new_figure(width: float, height: float) -> Figure:
    """A figure of ``width`` x ``height`` inches that no global registry keeps alive."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def svg(figure: Figure, *, prefix: str) -> str:
    """Inline SVG; ``prefix`` keeps the ids of several figures of a page apart."""
    stream = io.StringIO()
    nothing: dict[str, Any] = {"Date": None, "Creator": None}  # same numbers, same bytes
    figure.savefig(stream, format="svg", metadata=nothing, dpi=200)  # dpi of rasterised points
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", text)
    text = re.sub(r'(xlink:href|href)="#([^"]+)"', rf'\1="#{prefix}-\2"', text)
    return text


def png(figure: Figure, *, dpi: float = 150.0) -> bytes:
    """PNG of a figure."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi, metadata=_NO_SOFTWARE)
    return stream.getvalue()


def png_of_array(pixels: np.ndarray) -> bytes:
    """PNG of sRGB pixels (h, w, 3 or 4), uint8, one to one."""
    from matplotlib import image

    stream = io.BytesIO()
    image.imsave(stream, np.ascontiguousarray(pixels), format="png", metadata=_NO_SOFTWARE)
    return stream.getvalue()


def data_uri(png_bytes: bytes) -> str:
    """``data:`` address of a PNG, for pages without external files."""
    return "data:image/png;base64," + base64.b64encode(png_bytes).decode("ascii")
