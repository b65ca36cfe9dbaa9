"""After parts have moved: what is taken of the run before is what a fresh run makes."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver import arrangement, gap_cuts, reuse, store
from patchlight.solver.budget import Budget
from patchlight.solver.containment import Containment
from patchlight.solver.field_rows import FieldRows
from patchlight.solver.kept_quadrics import kept_quadrics
from patchlight.solver.mesh import Boxes
from patchlight.solver.mesher import Mesher
from patchlight.solver.model import PatchSet
from patchlight.solver.moved_blockers import kept_blockers
from patchlight.solver.moved_elements import kept_elements
from patchlight.solver.quadrics import fit_quadrics
from patchlight.solver.simulation import solve
from patchlight.solver.stages import Stages
from patchlight.solver.topology import make_blockers

from .fixtures_light import Body, ceiling, grid, scene, setup

ACCURACY = 0.3
BALL = PatchSet.sphere((0.0, 0.0, 0.0), 0.3)
SEAT = PatchSet.box((0.5, 0.5, 0.4), center=(0.0, 0.0, 0.2))
POINTS = [(x, y, 0.8) for x in (-1.2, 1.3) for y in (-1.7, 1.8)]


@pytest.fixture(autouse=True)
def nothing_kept():
    store.forget()
    yield
    store.forget()


def room(*at, points=POINTS, seats=True, screen=False):
    """A closed room: a lamp over seats, which stand ``at`` (x, y, z), and a ball in a corner."""
    shell = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    lamp = ceiling(-0.4, 0.4, -0.3, 0.3, 2.5)
    bodies = [Body(SEAT.moved(where)) for where in at] if seats else []
    if screen:
        bodies.append(Body(PatchSet.box((0.1, 3.0, 2.0), center=(0.3, 1.0, 1.0))))
    parts = setup(shell, lamp, Body(BALL.moved((-1.5, 2.0, 0.31))), *bodies)
    return scene(parts, lamps=[(1, "lamp", 3000.0)], sensors=[grid("plane", points)])


def run(made):
    return solve(made, accuracy=ACCURACY, cache=True)


def fresh(made):
    return solve(made, accuracy=ACCURACY)


def off(one, other):
    """Largest difference at the sensors, against the error that ``one`` states."""
    told, own = one.sensors["plane"], other.sensors["plane"]
    return float(np.max(np.abs(told.illuminance_lx - own.illuminance_lx) / told.error_lx))


SUMS = ("areas", "weights")
FIRST, SECOND = (0.9, 1.2, 0.01), (0.6, 0.9, 0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after"),
    [
        ([room(FIRST)], room((1.1, -1.5, 0.01))),
        ([room(FIRST, screen=True)], room((-0.7, 0.9, 0.01), screen=True)),
        ([room(FIRST), room(SECOND)], room((0.2, 1.5, 0.01))),
        ([room(FIRST), room(SECOND)], room(FIRST)),
        ([room(FIRST)], room()),
        ([room()], room(FIRST)),
    ],
    ids=["under a sensor", "from behind a screen", "twice", "and back", "removed", "new"],
)
def test_a_moved_seat_is_told_as_well_as_by_a_fresh_run(before, after):
    for made in before:
        run(made)
    assert off(run(after), fresh(after)) < 1.0


@pytest.mark.slow
def test_many_small_moves_do_not_add_up():
    """Rows are closed once more after each of them."""
    for k in range(8):
        run(room((0.9 - 0.05 * k, 1.2, 0.01)))
    last = room((0.5, 1.2, 0.01))
    again = run(last)
    assert again.counters["pairs_reused"] > 0
    assert off(again, fresh(last)) < 0.5


@pytest.mark.slow
def test_only_what_is_in_view_is_scanned_and_nothing_is_lost(monkeypatch):
    """Rows that are scanned all around are the same, but for rounding."""
    after = room(SECOND)
    run(room(FIRST))
    narrow = run(after)
    real = arrangement.Arrangement.changed

    def everywhere(self, patches, asked, stand, **how):
        found = real(self, patches, asked, stand, **how)
        return found and dataclasses.replace(found, whole=np.ones_like(found.whole))

    monkeypatch.setattr(arrangement.Arrangement, "changed", everywhere)
    store.forget()
    run(room(FIRST))
    wide = run(after)
    assert narrow.counters["pairs_renewed"] == wide.counters["pairs_renewed"] > 0
    one, other = (r.sensors["plane"].illuminance_lx for r in (narrow, wide))
    assert one == pytest.approx(other, rel=1e-3 * ACCURACY)


def with_hatch(x):
    """A room with a hatch in a corner of its ceiling, moved by ``x`` [m], and up; no sky."""
    shell = PatchSet.box((3, 3, 2.5), center=(0, 0, 1.25), inward=True)
    walls = shell.take(np.flatnonzero(shell.evaluate(0.5, 0.5)[:, 2] < 2.4))
    tiles = [
        ceiling(a, a + 1.0, b, b + 1.0, 2.5) for a in (-1.5, -0.5, 0.5) for b in (-1.5, -0.5, 0.5)
    ]
    hatch = tiles.pop().moved((x, 0.0, 0.02 if x else 0.0))
    parts = setup(
        Body(PatchSet.concatenated(walls, *tiles)),
        Body(PatchSet.box((0.6, 0.6, 0.1), center=(0.0, 0.0, 1.5))),
        Body(hatch),
    )
    return scene(parts, lamps=[(1, "lamp", 3000.0)], sensors=[grid("plane", [(0.8, 0.9, 0.5)])])


@pytest.mark.slow
def test_a_room_that_is_opened_lets_light_out(monkeypatch):
    """Where a hatch was there is nothing now: told although only the way to it is looked at."""
    tried = []
    real = FieldRows.renewed

    def renewed(self, rows, asked, changed, tell=None):
        tried.append(bool(changed.again.any() and not changed.whole.any()))
        return real(self, rows, asked, changed, tell)

    monkeypatch.setattr(FieldRows, "renewed", renewed)
    closed = run(with_hatch(0.0))
    assert closed.balance.escaped_lm < 1e-6 * closed.balance.emitted_lm
    open_ = with_hatch(-1.0)
    again, own = run(open_), fresh(open_)
    assert tried[:1] == [True]
    assert off(again, own) < 1.0
    assert again.balance.escaped_lm > 0.01 * again.balance.emitted_lm


def test_blockers_are_those_that_are_made_anew():
    before, after = room(FIRST, SECOND), room(FIRST, (-0.6, -0.9, 0.3))
    found = [
        kept_blockers(
            reuse.Kept(made, stages=Stages(), store=store.STORE),
            made.patches,
            made.closed,
            made.patches.part_index,
            ~made.two_sided,
        )
        for made in (before, after)
    ]
    solids = after.patches, after.closed, after.patches.part_index
    own = make_blockers(*solids, one_sided=~after.two_sided)
    for name, array in found[1]._asdict().items():
        assert np.array_equal(array, getattr(own, name)), name
    assert not np.array_equal(found[0].nets, found[1].nets)


def test_quadrics_of_what_has_not_moved_are_known(monkeypatch):
    shapes = BALL.moved((0.0, 0.0, 0.3)), BALL.moved((0.2, 0.1, 0.3))
    fitted = []

    def counted(nets):
        fitted.append(len(nets))
        return fit_quadrics(nets)

    monkeypatch.setattr("patchlight.solver.kept_quadrics.fit_quadrics", counted)
    for at in shapes:
        made = scene(setup(Body(BALL.moved((-1.5, 2.0, 0.31))), Body(at)), lamps=[])
        kept = reuse.Kept(made, stages=Stages(), store=store.STORE)
        blockers = make_blockers(made.patches, made.closed, made.patches.part_index)
        found = kept_quadrics(kept, blockers)
        np.testing.assert_allclose(found, fit_quadrics(made.patches.control_points), rtol=1e-12)
    assert fitted == [2 * len(BALL.control_points), len(BALL.control_points)]
    assert found[:, 4, 3].all()


def mesher_of(made, kept_in):
    blockers = make_blockers(made.patches, made.closed, made.patches.part_index)
    kept = reuse.Kept(made, stages=Stages(), store=kept_in)
    return Mesher(
        made, blockers, trace=True, stages=kept.stages, tester=Containment(made), kept=kept
    )


@pytest.mark.parametrize("height", [0.0, 0.01, 0.41])
def test_elements_are_those_that_are_made_anew(height):
    """The seat stands on the floor, within another one, or on that: each buries something."""
    before, after = room(FIRST, (0.0, 0.0, 0.0)), room(FIRST, (0.9, 1.1, height))
    budget = Budget.of(before, ACCURACY)
    boxes = Boxes.regular(budget.divisions, before.two_sided)
    for made in (before, after):
        mesher = mesher_of(made, store.STORE)
        found = kept_elements(mesher.kept, mesher, budget, boxes)
    own = mesher_of(after, None).elements(budget, boxes)
    for one in dataclasses.fields(own):
        # Areas are sums, whose order depends on how many are found at once.
        told = pytest.approx(
            getattr(own, one.name), rel=1e-14 if one.name in SUMS else 0.0, abs=0.0
        )
        assert getattr(found, one.name) == told, one.name
    assert own.buried.any()


def test_gaps_are_asked_about_again_where_something_has_moved():
    before, after = room(FIRST), room((0.0, 0.0, 0.005))
    budget = Budget.of(before, ACCURACY)
    boxes = Boxes.regular(budget.divisions, before.two_sided)
    first = gap_cuts.in_gaps(boxes, before, budget, None)
    again = gap_cuts.in_gaps(boxes, after, budget, first)
    own = gap_cuts.in_gaps(boxes, after, budget, None)
    assert np.array_equal(again.wrong, own.wrong) and again.allowed == pytest.approx(own.allowed)
    assert not np.array_equal(first.wrong, own.wrong)


def hollow(at):
    """A seat, and a box of sheets in which no light comes."""
    parts = setup(
        Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True)),
        ceiling(-0.4, 0.4, -0.3, 0.3, 2.5),
        Body(SEAT.moved(at)),
        PatchSet.box((0.3, 0.3, 0.3), center=(-1.0, -1.0, 1.0)),
    )
    made = scene(parts, lamps=[(1, "lamp", 3000.0)], sensors=[grid("plane", POINTS)])
    return dataclasses.replace(made, two_sided=parts.solid == 3)


@pytest.mark.slow
def test_what_is_shut_in_stays_so_when_something_else_moves():
    first, again = run(hollow(FIRST)), run(hollow(SECOND))
    assert first.counters["elements_shut_in"] > 0
    assert again.counters["elements_shut_in"] == first.counters["elements_shut_in"]
    own = fresh(hollow(SECOND))
    found = [r.counters["pairs_scanned"] for r in (again, own)]
    assert found[0] < 0.5 * found[1]
    assert off(again, own) < 1.0


def test_a_view_holds_all_that_is_wanted_and_its_meridians_all_of_it():
    """Random balls before a point, some of them wanted; directions to these are in the cone."""
    from patchlight.solver.kernels.cuts import tangent_frame
    from patchlight.solver.kernels.meridian import want_lines
    from patchlight.solver.kernels.rows import view_of_wanted

    rng = np.random.default_rng(5)
    narrow = 0
    for _ in range(200):
        middle = rng.normal(size=3)
        centers = 3.0 * middle / np.linalg.norm(middle) + rng.normal(size=(6, 3))
        balls = np.column_stack([centers, rng.uniform(0.01, 0.5, 6)])
        wanted = np.arange(6) < 4
        view, lines = np.empty(7), np.empty(48, dtype=bool)
        view_of_wanted(np.zeros(3), balls[:5], wanted[:5], balls[5:], view)
        towards = rng.normal(size=(6, 400, 3))
        towards *= balls[:, None, 3:] / np.linalg.norm(towards, axis=2, keepdims=True)
        places = (balls[:, None, :3] + towards)[[0, 1, 2, 3, 5]].reshape(-1, 3)
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        frame = np.empty((2, 3))
        tangent_frame(n, 0.3, frame)
        want_lines(view, n, frame, lines)
        turn = np.arctan2(places @ frame[1], places @ frame[0]) / (2.0 * np.pi) % 1.0 * len(lines)
        before = turn.astype(int) % len(lines)
        assert lines[before].all() and lines[(before + 1) % len(lines)].all()
        if view[3] > 1.0:
            assert lines.all()
            continue
        assert (places @ view[:3] >= view[4] * np.linalg.norm(places, axis=1)).all()
        narrow += not lines.all()
    assert narrow > 50
