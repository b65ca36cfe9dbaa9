"""Sizes that are not to be believed draw a warning with the likely mistake, others none."""

from __future__ import annotations

import cadquery as cq
import pytest
from patchlight.importers import from_cadquery


def warnings_of(size, name, unit="m"):
    box = cq.Workplane().box(size, 0.1 * size, 0.5 * size)
    return from_cadquery(cq.Assembly(name="x").add(box, name=name), unit=unit).warnings


@pytest.mark.parametrize(
    ("name", "size", "hint"),
    [
        ("Simple 2-panes window", 0.12, "centimetres taken for millimetres"),
        ("doors_01", 2e-3 * 40, "centimetres taken for millimetres"),
        ("IkeaLikeChair", 900.0, "millimetres taken for metres"),
        ("desk:3", 1.6e-3, "metres taken for millimetres"),
        ("office", 0.2, "centimetres taken for millimetres"),
        ("BOTTLE", 25.0, "millimetres taken for centimetres"),
        ("sofa", 35.0, "millimetres taken for centimetres"),
    ],
)
def test_things_have_the_size_of_what_they_are_called(name, size, hint):
    (said,) = warnings_of(size, name)
    assert name in said
    assert f"{size:.3g} m long" in said
    assert "(option unit)" in said  # CadQuery's models have no other
    assert hint in said


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("window", 1.2), ("chair", 0.9), ("door handle", 0.1), ("window frame", 0.05),
        ("office", 6.0), ("wall", 0.5), ("bottle", 0.25), ("lamp", 0.05), ("bracket", 1e-2),
        ("", 0.01), ("17", 0.01),
        # Words of machines as well: a rotary table, the can of a capacitor, a printer's bed.
        ("rotary table", 0.05), ("can", 0.005), ("heat bed", 0.1), ("bearing cup", 0.005),
    ],
)  # fmt: skip
def test_usual_sizes_draw_no_word(name, size):
    assert warnings_of(size, name) == ()


def test_equal_parts_are_named_once():
    chair = cq.Workplane().box(0.05, 0.05, 0.09)
    rows = cq.Assembly(name="rows")
    for k in range(5):
        rows.add(chair, name=f"chair {k}", loc=cq.Location((k, 0, 0)))
    (said,) = from_cadquery(rows, unit="m").warnings
    assert "chair 0" in said


@pytest.mark.parametrize(("size", "words"), [(2e6, "2000 m"), (1e-4, "1e-07 m")])
def test_models_of_no_likely_size_at_all(size, words):
    (said,) = warnings_of(size, "thing", "mm")
    assert words in said
    assert "unit" in said
