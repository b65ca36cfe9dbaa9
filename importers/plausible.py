"""Whether models and parts have the size of what they are called.

Files state a unit and mean another: windows of 12 cm, chairs of 25 m. Names tell what a thing is;
the bounds are wide enough for every real one.
"""

from __future__ import annotations

import re

import numpy as np
from patchlight.solver.model import Part, PatchSet

#: Longest side that a model may have without a word. [m]
SMALLEST, LARGEST = 1e-3, 1e3
#: Longest side of things by the last word of their names: a "door handle" is no door. [m]
SIZES = (
    (("room", "raum", "zimmer", "hall", "office", "building", "house", "storey"), 0.8, 1000.0),
    (("floor", "ceiling", "roof", "wall", "slab"), 0.2, 1000.0),
    (("window", "fenster", "door", "facade"), 0.2, 100.0),
    (("chair", "stool", "desk", "sofa", "couch", "cupboard", "wardrobe", "shelf", "bench"),
     0.2, 20.0),
    (("lamp", "luminaire", "leuchte", "downlight"), 0.01, 20.0),
    (("bottle", "mug", "bulb"), 0.01, 3.0),
)  # fmt: skip
#: Units that files get wrong: what a length of theirs becomes when read as stated, and their names.
MISTAKES = (
    (10.0, "centimetres taken for millimetres"),
    (25.4, "inches taken for millimetres"),
    (1000.0, "metres taken for millimetres"),
    (100.0, "metres taken for centimetres"),
    (0.1, "millimetres taken for centimetres"),
    (1 / 25.4, "millimetres taken for inches"),
    (1e-3, "millimetres taken for metres"),
)  # fmt: skip
#: Words of a name: also of "IkeaLikeChair" and "2-panes_window".
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def size_warnings(
    name: str, parts: list[Part], patches: PatchSet, *, from_file: bool = True
) -> list[str]:
    """What is said of a model whose size, or that of its parts, is not to be believed.

    Parameters
    ----------
    name : str
        Of the model; names the whole of it.
    parts : list of Part
        Rows that ``patches.part_index`` counts.
    patches : PatchSet
        Of all parts. [m]
    from_file : bool
        Whether ``scale`` can be set besides ``unit``, which only readers of files let.
    """
    setting = "option unit or scale" if from_file else "option unit"
    low, high = patches.bounds()
    size = float((high - low).max())
    if not SMALLEST <= size <= LARGEST:
        return [f"the model is {size:.4g} m long: check its length unit ({setting})"]
    if said := _said(f"model {name}", name, size, setting):
        return [said]
    out: dict[str, str] = {}
    corners = patches.control_points[..., :3] / patches.control_points[..., 3:]
    lows, highs = corners.min(axis=(1, 2)), corners.max(axis=(1, 2))
    order = np.argsort(patches.part_index, kind="stable")
    rows, starts = np.unique(patches.part_index[order], return_index=True)
    spans = np.maximum.reduceat(highs[order], starts) - np.minimum.reduceat(lows[order], starts)
    for row, span in zip(rows.tolist(), spans, strict=True):
        path = parts[row].path
        if said := _said(f"part {path}", path.rsplit("/", 1)[-1], float(span.max()), setting):
            out.setdefault(re.sub(r"[\d:#]+", "", path), said)  # one of many equal ones
    return list(out.values())


def _said(what: str, name: str, size: float, setting: str) -> str | None:
    words = _WORDS.findall(name)
    word = words[-1].lower() if words else ""
    for known, low, high in SIZES:
        kind = next((k for k in known if word in (k, k + "s")), None)
        if kind is None or low <= size <= high:
            continue
        hint = next(
            (
                f": {text}? {factor:.4g} times as long it has {size * factor:.3g} m"
                for factor, text in MISTAKES
                if low <= size * factor <= high
            ),
            "",
        )
        return (
            f"{what} is {size:.3g} m long, but a {kind} has {low:g} to {high:g} m; check its "
            f"length unit ({setting}){hint}"
        )
    return None
