"""Surfaces of point queries, made ready once."""

import numpy as np
import pytest
from patchlight.solver import PatchSet, point_form_factors
from patchlight.solver.prepared import forget, prepare

LAMP = PatchSet.from_bilinear([[[-1, -1, 2], [-1, 1, 2], [1, 1, 2], [1, -1, 2]]])
BALL = PatchSet.sphere((0.2, 0.1, 1.0), 0.3)
POINTS = np.random.default_rng(4).uniform(-1.0, 1.0, (20, 3)) * (1.0, 1.0, 0.0)
UP = (0.0, 0.0, 1.0)


def arrays(value):
    """All arrays in nested tuples, by where they are."""
    if isinstance(value, np.ndarray):
        return {"": value}
    if not isinstance(value, tuple):
        return {}
    names = getattr(value, "_fields", range(len(value)))
    return {
        f"{name}.{inner}": array
        for name, part in zip(names, value, strict=True)
        for inner, array in arrays(part).items()
    }


@pytest.fixture(autouse=True)
def nothing_kept():
    forget()
    yield
    forget()


def test_the_same_surfaces_are_prepared_once():
    kept = prepare(LAMP.control_points, BALL)
    again = PatchSet(LAMP.control_points.copy()), PatchSet(BALL.control_points.copy())
    assert prepare(again[0].control_points, again[1]) is kept


def test_other_blockers_and_moved_sources_are_others():
    kept = prepare(LAMP.control_points, BALL)
    assert prepare(LAMP.control_points, None) is not kept
    moved = BALL.control_points.copy()
    moved[..., 0] += 1e-15 * moved[..., 3]
    assert prepare(LAMP.control_points, PatchSet(moved)) is not kept
    # What is a source and what a blocker is part of the question.
    assert len(prepare(BALL.control_points, LAMP).sources.nets) == len(BALL)


@pytest.mark.parametrize("visibility", ["auto", "strict", "none"])
def test_queries_leave_what_is_kept_as_it_was(visibility):
    kept = prepare(LAMP.control_points, BALL)
    parts = (kept.sources, kept.surfaces, kept.quadrics, *kept.outlines)
    before = {name: array.copy() for name, array in arrays(parts).items()}
    assert len(before) > 50
    first = point_form_factors(POINTS, UP, LAMP, BALL, accuracy=0.01, visibility=visibility)
    for name, array in arrays(parts).items():
        np.testing.assert_array_equal(array, before[name], err_msg=name)
    again = point_form_factors(POINTS, UP, LAMP, BALL, accuracy=0.01, visibility=visibility)
    forget()
    anew = point_form_factors(POINTS, UP, LAMP, BALL, accuracy=0.01, visibility=visibility)
    np.testing.assert_array_equal(first.value, again.value)
    np.testing.assert_array_equal(first.value, anew.value)


def test_large_sets_are_not_kept(monkeypatch):
    monkeypatch.setattr("patchlight.solver.prepared._KEPT_PATCHES", len(BALL))
    assert prepare(LAMP.control_points, BALL) is not prepare(LAMP.control_points, BALL)
    assert prepare(LAMP.control_points, None) is prepare(LAMP.control_points, None)
