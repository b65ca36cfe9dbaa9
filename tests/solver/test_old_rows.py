"""Rows that stay as they are though something has moved: what they have wrong is stated."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver import kept_error, simulation
from patchlight.solver.arrangement import MOST_STANDS, Arrangement
from patchlight.solver.budget import Budget
from patchlight.solver.change_bounds import bounds_of_change
from patchlight.solver.exchange import Rows, form_factor_matrix, make_sources
from patchlight.solver.field_rows import FieldRows
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import CIESky, Ground, Material, PatchSet
from patchlight.solver.row_finder import Ask
from patchlight.solver.simulation import solve
from patchlight.solver.stand import History, Stand
from patchlight.solver.surfaces import Receivers

from .fixtures_light import Body, ceiling, grid, scene, setup

ACCURACY = 0.3
MANY = 30
SEAT = PatchSet.box((0.4, 0.4, 0.4))
BALL = PatchSet.sphere((0.0, 0.0, 0.0), 0.25)
FIRST, SECOND = (0.9, 1.2, 0.25), (0.6, 0.9, 0.25)
POINTS = [(x, y, 0.8) for x in (-1.2, 1.3) for y in (-1.7, 1.8)]


def room(*at, things=(SEAT,), points=POINTS, rho=0.5, flux=3000.0, wall=False):
    """A closed room with a lamp, and things in it that stand ``at`` (x, y, z)."""
    shell = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    bodies = [Body(thing.moved(where)) for thing, where in zip(things, at, strict=False)]
    if wall:
        bodies.append(Body(PatchSet.box((0.1, 3.0, 2.0), center=(0.3, 1.0, 1.0))))
    parts = setup(shell, ceiling(-0.4, 0.4, -0.3, 0.3, 2.5), *bodies)
    return scene(parts, rho=rho, lamps=[(1, "lamp", flux)], sensors=[grid("plane", points)])


def run(made):
    return solve(made, accuracy=ACCURACY, cache=True)


def fresh(made):
    return solve(made, accuracy=ACCURACY)


def off(one, other):
    """Largest difference at the sensors, against the error that ``one`` states."""
    told, own = one.sensors["plane"], other.sensors["plane"]
    return float(np.max(np.abs(told.illuminance_lx - own.illuminance_lx) / told.error_lx))


def traced(made, receivers):
    """Every patch as one element, what receivers see of them, and how they stand."""
    patches, n = made.patches, len(made.patches)
    elements = make_elements(patches, np.zeros(n, bool), np.ones((n, 2), np.int64))
    sources = make_sources(elements, patches.control_points, np.full(len(elements), 1e-4))
    found = form_factor_matrix(
        receivers.nodes,
        receivers.normals,
        receivers.weights,
        receivers.patches,
        sources,
        made.blockers,
        eps=1e-6,
    )
    asked = Ask(None, receivers, sources)
    return found, asked, Stand.of(patches.control_points, sources)


@pytest.mark.parametrize("thing", [SEAT, BALL], ids=["box", "ball"])
@pytest.mark.parametrize("wall", [False, True], ids=["open", "behind a wall"])
def test_what_rows_have_wrong_is_below_the_bound(thing, wall):
    """Random receivers, exitances and places; form factors by pyramids, to 1e-3."""
    rng = np.random.default_rng(3)
    shell = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    screen = [Body(PatchSet.box((0.1, 3.0, 2.0), center=(0.3, 0.0, 1.2)))] if wall else []
    nodes = rng.uniform((-1.9, -2.4, 0.1), (1.9, 2.4, 2.6), (MANY, 3))
    normals = rng.normal(size=(MANY, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    on = np.full(MANY, -1)
    receivers = Receivers.of_points(nodes, normals, np.ones(MANY), on)
    tightest, far = np.inf, []
    for _ in range(3):
        places = rng.uniform((-1.5, -2.0, 0.3), (1.5, 2.0, 2.2), (2, 3))
        made = [setup(shell, *screen, Body(thing.moved(tuple(at)))) for at in places]
        (old, _, before), (new, asked, after) = (traced(one, receivers) for one in made)
        light = rng.uniform(0.0, 100.0, old.factors.shape[1]) ** 2
        history = History.new(before, MANY).moved_on(after, np.zeros(MANY, dtype=np.int64))
        parts = made[1].solid
        which = np.ones(MANY, dtype=bool)
        bounds = bounds_of_change(old, history, asked, after, light, which, parts)
        inside = [np.linalg.norm(nodes - at, axis=1) < 0.36 for at in places]
        outside = ~(inside[0] | inside[1])
        wrong = np.abs((new.factors - old.factors) @ light)
        assert (wrong <= bounds + 2e-3 * light.max())[outside].all()
        some = wrong > 0.01 * light.max()
        tightest = min(tightest, (bounds[some] / wrong[some]).min(initial=np.inf))
        far += [bounds[outside].min() == 0.0]
    # It is no bound for anything: some are nearly met, and behind receivers nothing changes.
    assert tightest < 20.0 and any(far)


def test_most_rows_stay_and_what_they_have_wrong_is_stated():
    run(room(FIRST))
    again, own = run(room(SECOND)), fresh(room(SECOND))
    rows = again.counters["unknowns"] + again.counters["unknowns_checked"] + len(POINTS)
    assert again.counters["rows_left"] > 0.3 * rows
    most = again.settings["error_of_rows_left_lx"]
    plane = again.sensors["plane"]
    assert 0.0 < most <= kept_error.AT_MOST * ACCURACY * plane.illuminance_lx.max()
    assert (plane.error_lx > 0.3 * most).all()
    assert off(again, own) < 1.0


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ([room(FIRST)], room((1.2, -1.7, 0.25))),
        ([room((0.9, 0.9, 0.25), wall=True)], room((-0.7, 0.9, 0.25), wall=True)),
        ([room(FIRST, SECOND, things=(SEAT, BALL))], room(SECOND, FIRST, things=(SEAT, BALL))),
    ],
    ids=["under a sensor", "from behind a wall", "in exchange"],
)
def test_a_moved_thing_is_told_within_what_is_stated(before, after):
    for made in before:
        run(made)
    again = run(after)
    assert again.counters["rows_left"] > 0
    assert off(again, fresh(after)) < 1.0


@pytest.mark.slow
def test_a_thing_that_is_dragged_about_is_told_within_what_is_stated():
    """What rows have wrong does not add up: all that counts is where things stood and stand."""
    run(room(FIRST))
    told = []
    for k in range(1, MOST_STANDS + 4):
        # To and fro: what is left wrong is that of two places, not of all of the way.
        last = room((0.9 - 0.3 * (k % 2), 1.2 - 0.01 * k, 0.25))
        again = run(last)
        told.append(again.settings["error_of_rows_left_lx"])
        if k in (1, 2, MOST_STANDS + 3):
            assert off(again, fresh(last)) < 1.0
    light = again.sensors["plane"].illuminance_lx.max()
    assert max(told) <= kept_error.AT_MOST * ACCURACY * light
    assert told[-1] < 3.0 * told[0]


def test_back_at_the_first_place_nothing_is_wrong():
    first = run(room(FIRST))
    run(room(SECOND))
    back = run(room(FIRST))
    assert "rows_left" not in back.counters
    one, other = (r.sensors["plane"] for r in (first, back))
    assert np.array_equal(one.illuminance_lx, other.illuminance_lx)
    assert np.array_equal(one.error_lx, other.error_lx)


def test_a_row_that_stayed_is_exact_again_where_everything_is_back():
    """The last stand is the first one again: no row is off, whatever was between."""
    made = room(FIRST)
    receivers = Receivers.of_points(
        np.array([[0.0, 0.0, 0.5]]), np.array([[0.0, 0.0, 1.0]]), np.ones(1), np.array([-1])
    )
    parts = setup(Body(PatchSet.box((4, 5, 2.7), inward=True)), Body(SEAT.moved(FIRST)))
    found, asked, stand = traced(parts, receivers)
    history = History.new(stand, 1).moved_on(stand, np.zeros(1, dtype=np.int64))
    light = np.full(found.factors.shape[1], 100.0)
    of = made.patches.part_index
    assert history.is_old
    assert not bounds_of_change(found, history, asked, stand, light, np.ones(1, bool), of).any()


def test_what_would_be_too_much_is_found_anew(monkeypatch):
    """Nothing may be wrong: rows that were left before are found as a fresh run finds them."""
    run(room(FIRST))
    monkeypatch.setattr(kept_error, "AT_MOST", 0.0)
    again, own = run(room(SECOND)), fresh(room(SECOND))
    assert "error_of_rows_left_lx" not in again.settings
    assert off(again, own) < 1.0
    # Painted anew, nothing is left of them either.
    monkeypatch.setattr(kept_error, "AT_MOST", 0.1)
    painted = run(room(SECOND, rho=0.6))
    assert "rows_left" not in painted.counters


def test_other_light_on_rows_that_were_left_is_bounded_anew(monkeypatch):
    """Brighter lamps: rows found before count in the error by as much more; or are found anew."""
    run(room(FIRST))
    moved = run(room(SECOND))
    brighter = run(room(SECOND, flux=6000.0))
    assert brighter.counters["rows_left"] == moved.counters["rows_left"] > 0
    told = [r.settings["error_of_rows_left_lx"] for r in (moved, brighter)]
    assert told[1] == pytest.approx(2.0 * told[0], rel=1e-3)
    monkeypatch.setattr(kept_error, "AT_MOST", 0.0)
    exact = run(room(SECOND, flux=6000.0 * 1.1))
    assert "error_of_rows_left_lx" not in exact.settings
    assert exact.counters["pairs_renewed"] > 0


def test_under_a_sky_no_row_stays():
    """What is behind something that moves may be the sky, of which rows tell nothing."""

    def daylit(at):
        shell = PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True)
        parts = setup(Body(shell.take(np.arange(5))), Body(SEAT.moved(at)))
        plane = grid("plane", POINTS)
        return scene(parts, sensors=[plane], sky=CIESky(1), ground=Ground(0.2))

    run(daylit(FIRST))
    again = run(daylit(SECOND))
    assert again.counters["pairs_renewed"] > 0 and "rows_left" not in again.counters


def test_rows_found_more_coarsely_than_asked_are_not_taken():
    """Meridians, and what is traced or told by a point, are part of what was asked for."""
    made = room(FIRST)
    box = setup(Body(PatchSet.box((4, 5, 2.7), inward=True)), Body(SEAT.moved(FIRST)))
    receivers = Receivers.of_points(
        np.array([[0.0, 0.0, 0.5]]), np.array([[0.0, 0.0, 1.0]]), np.ones(1), np.array([-1])
    )
    found, asked, stand = traced(box, receivers)
    budget = Budget.of(made, ACCURACY)
    sources = asked.sources
    asked = Ask(budget, receivers, sources._replace(exact_above=np.full(len(sources.nets), 0.1)))
    history = History.new(stand, 1)
    known = Arrangement.of(history, asked, (found,), np.empty(0), b"1")

    def taken(**other):
        now = dataclasses.replace(asked, sources=asked.sources._replace(**other))
        return known.changed(box.patches, now, stand, sees_out=False) is not None

    n = len(sources.nets)
    assert taken() and taken(exact_above=np.full(n, 0.2))
    assert not taken(exact_above=np.full(n, 0.05))
    assert not taken(azimuths=np.ones((4, 2)))
    assert not taken(cell_eps=np.full(n, 1e-6))
    finite = known.point_from, np.full(n, 1.0)
    assert taken(point_from=finite[1]) and np.isinf(finite[0]).all()
    nearer = dataclasses.replace(known, point_from=np.full(n, 0.5))
    now = dataclasses.replace(asked, sources=asked.sources._replace(point_from=finite[1]))
    assert nearer.changed(box.patches, now, stand, sees_out=False) is None


def closed_rows(missing, outside, deviation=0.004):
    """One row that sums to less than 1, and what its meridians saw of sky and ground."""
    return Rows(
        np.array([[1.0 - missing]]),
        np.array([[deviation**2]], dtype=np.float32),
        {},
        np.array([[0.0, outside, 0.0, 0.0, 0.0]]),
    )


@pytest.mark.parametrize(
    ("missing", "outside", "out"),
    [(0.3, 0.3, True), (0.3, 0.0, False), (0.013, 6e-5, False), (0.0001, 0.3, False)],
    ids=["window", "error of the row", "noise and a sliver", "noise of the meridians"],
)
def test_light_leaves_where_sums_and_meridians_agree_that_it_does(missing, outside, out):
    """Slivers between facets of curved walls and noise of a sum do not make a window."""

    class Finder:
        trace = True

    class Panes:
        any = False

    rows = FieldRows(Finder(), Panes(), None, in_cavity=False)
    assert rows.sees_out(closed_rows(missing, outside), np.array([True])) is out


def test_paint_of_materials_is_no_place(monkeypatch):
    """Nothing has moved: nothing is left, or bounded."""
    asked = []
    real = simulation.kept_error
    monkeypatch.setattr(
        simulation, "kept_error", lambda *args: asked.append(args[2].old_rows.copy()) or real(*args)
    )
    run(room(FIRST))
    run(dataclasses.replace(room(FIRST), materials=(Material(0.6), Material(0.3))))
    assert asked == [{}, {}]


def test_what_is_behind_a_sheet_without_a_back_is_found_anew():
    """Its black back has no elements, so nothing tells what its shadow was and is."""
    sheet = PatchSet.from_bilinear(
        [[(-0.4, -0.4, 0), (-0.4, 0.4, 0), (0.4, 0.4, 0), (0.4, -0.4, 0)]]
    )
    sheet = sheet if sheet.normals(0.5, 0.5)[0, 2] > 0.0 else sheet.flipped()
    made = [
        room((*at, 1.6), things=(sheet,), points=[(0.0, 0.0, 0.8), *POINTS])
        for at in ((1.4, 1.8), (0.0, 0.0))
    ]
    closed = made[0].patches.part_index != 2
    made = [dataclasses.replace(one, closed=one.closed & closed) for one in made]
    run(made[0])
    again = run(made[1])
    assert again.counters.get("rows_left", 0) == 0
    assert off(again, fresh(made[1])) < 1.0


def test_what_moved_in_the_dark_is_found_anew_when_it_is_painted():
    run(room(FIRST, rho=0.0))
    run(room(SECOND, rho=0.0))
    painted = room(SECOND, rho=0.6)
    again, own = run(painted), fresh(painted)
    assert off(again, own) < 1.0
    # Rows that are left are known as such: their error is stated.
    assert again.counters.get("rows_left", 0) == 0 or again.settings["error_of_rows_left_lx"] > 0.0


def test_gloss_leaves_no_rows():
    run(room(FIRST))
    made = [
        dataclasses.replace(
            one,
            materials=tuple(
                dataclasses.replace(m, specular=0.2, exponent=50.0) for m in one.materials
            ),
        )
        for one in (room(FIRST, rho=0.4), room(SECOND, rho=0.4))
    ]
    run(made[0])
    again = run(made[1])
    assert again.counters.get("rows_left", 0) == 0
    assert off(again, fresh(made[1])) < 1.0
