"""What later runs take of earlier ones: the same numbers, without form factors."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver import kept_light, reuse, rule_error, store
from patchlight.solver.budget import Budget
from patchlight.solver.direct_light import DirectLight
from patchlight.solver.field import FieldSolver
from patchlight.solver.mesh import Boxes
from patchlight.solver.mesher import Mesher
from patchlight.solver.model import CIESky, Ground, Material, PatchSet, Sun
from patchlight.solver.simulation import solve
from patchlight.solver.stages import Stages
from patchlight.solver.topology import make_blockers

from .fixtures_light import Body, ceiling, grid, scene, setup

ROOM = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
LAMPS = [ceiling(x - 0.4, x + 0.4, -0.3, 0.3, 2.5) for x in (-0.8, 0.8)]
SEAT = PatchSet.box((0.5, 0.5, 0.4), center=(0.9, 1.2, 0.3))
PLANE = grid("plane", [(x, y, 0.8) for x in (-1.2, 0.1, 1.3) for y in (-1.7, 0.2, 1.8)])
ACCURACY = 0.3


def room(*, rho=(0.5, 0.8, 0.2), flux=(2000.0, 2000.0), at=(0.0, 0.0, 0.0), **more):
    """Two lamps over a seat: materials of the room, of the lamps, of the seat."""
    seat = Body(SEAT.moved(_shift(at)))
    parts = setup(ROOM, *LAMPS, seat)
    made = scene(
        parts,
        lamps=[(1, "left", flux[0]), (2, "right", flux[1])],
        sensors=[PLANE],
        **more,
    )
    part = made.patches.part_index
    index = np.where(part == 0, 0, np.where(part == 3, 2, 1))
    return dataclasses.replace(
        made,
        materials=tuple(Material(r) for r in rho),
        material_index=np.stack([index, index], axis=1),
    )


def _shift(at):
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return matrix


@pytest.fixture(autouse=True)
def nothing_kept():
    store.forget()
    yield
    store.forget()


def run(made, **options):
    return solve(made, accuracy=ACCURACY, cache=True, **options)


def fresh(made):
    return solve(made, accuracy=ACCURACY)


def same_bits(one, other):
    assert np.array_equal(one.exitance, other.exitance)
    for name, sensors in one.sensors.items():
        assert np.array_equal(sensors.illuminance_lx, other.sensors[name].illuminance_lx)
        for group, values in sensors.components.items():
            assert np.array_equal(values, other.sensors[name].components[group])


def same_mesh(one, other):
    return np.array_equal(one.elements.boxes, other.elements.boxes)


def within_error(one, other):
    for name, sensors in one.sensors.items():
        told = sensors.error_lx + other.sensors[name].error_lx
        assert (np.abs(sensors.illuminance_lx - other.sensors[name].illuminance_lx) <= told).all()


def pairs_found(result):
    return sum(result.counters.get(name, 0) for name in ("pairs_scanned", "pairs_traced"))


def test_the_same_scene_again_gives_the_same_bits_without_form_factors():
    first, again = run(room()), run(room())
    same_bits(first, again)
    assert pairs_found(first) > 0 and pairs_found(again) == 0
    assert again.counters["rows_reused"] >= len(PLANE) + first.counters["unknowns"]
    assert "earlier run" in again.skipped["form factors"]
    assert not again.skipped.keys() & again.stages.keys()
    assert again.settings["mesh_of_earlier_run"] and not first.settings["mesh_of_earlier_run"]


def test_nothing_is_taken_without_the_cache():
    first = run(room())
    again = fresh(room())
    same_bits(first, again)
    assert pairs_found(again) == pairs_found(first) and "rows_reused" not in again.counters


def test_nothing_is_left_once_forgotten():
    run(room())
    assert store.STORE.bytes > 0 and len(store.STORE) > 0
    store.forget()
    assert store.STORE.bytes == len(store.STORE) == 0
    assert pairs_found(run(room())) > 0


@pytest.mark.parametrize(
    "changed",
    [room(rho=(0.4, 0.8, 0.2)), room(flux=(2000.0, 1500.0)), room(rho=((0.6, 0.5, 0.4), 0.8, 0.2))],
    ids=["painted", "dimmed", "coloured"],
)
def test_other_paint_and_lamps_need_no_form_factors(changed):
    run(room())
    again, own = run(changed), fresh(changed)
    assert pairs_found(again) == 0 and pairs_found(own) > 0
    within_error(again, own)
    # Where both would have been cut alike, nothing differs at all.
    if same_mesh(again, own):
        same_bits(again, own)


@pytest.mark.parametrize(
    ("flux", "asked"),
    [((2000.0, 700.0), 1), ((1000.0, 1000.0), 0), ((250.0, 900.0), 1)],
)
def test_light_of_dimmed_lamps_is_that_of_then_and_the_change(monkeypatch, flux, asked):
    """Only lamps that are dimmed unlike the others are looked at, none where all are alike."""
    before, now = _refiner(room()), _refiner(room(flux=flux))
    boxes = Boxes.regular(Budget.of(room(), ACCURACY).divisions, room().two_sided)
    looked, own = before._look(boxes), now._look(boxes)
    assert np.abs(own.light - looked.light).max() > 0.1 * looked.light.max()
    made = []
    monkeypatch.setattr(
        kept_light,
        "DirectLight",
        lambda *of, **more: made.append(more["more"]) or DirectLight(*of, **more),
    )
    found = now.relit(boxes, looked, before.light.shining)
    assert len(made) == asked and all((more == 0.0).any() for more in made)
    # What makes up less than two hundredths of a point's light is taken to be in sight.
    for one, other in ((found.light, own.light), (found.told, own.told)):
        assert (np.abs(one - other) <= 0.03 * other + 1e-9 * own.light.max()).all()


def test_lamps_that_were_faint_are_asked_about_once_they_count():
    """Beside a bright lamp others may have no shadows: all are asked where that is dimmed."""
    light = _refiner(room(flux=(2000.0, 100.0))).light
    levels = _refiner(room()).light.shining
    assert not light.is_like(levels) and not _refiner(room(flux=(1.0, 0.0))).light.is_like(levels)
    assert _refiner(room(flux=(500.0, 1500.0))).light.is_like(levels)


def _refiner(made):
    """Looks at the light of lamps, with nothing kept."""
    blockers = make_blockers(made.patches, made.closed, made.patches.part_index)
    mesher = Mesher(made, blockers, trace=True, stages=Stages())
    return mesher._refine_by(Budget.of(made, ACCURACY))


def test_a_mesh_without_lamps_stays_and_so_do_the_bits():
    """The mesh follows no light here: walls painted anew give what a fresh run gives."""
    open_room = dict(sky=CIESky(16), ground=Ground(0.2))

    def made(rho):
        body = Body(ROOM.patches.take(np.arange(5)))
        seat = Body(SEAT)
        return scene(setup(body, seat), rho=rho, sensors=[PLANE], **open_room)

    run(made(0.5))
    again, own = run(made(0.7)), fresh(made(0.7))
    assert same_mesh(again, own) and again.counters["rows_reused"] > 0
    assert pairs_found(again) == 0
    same_bits(again, own)


def under(sky, *, curved=False):
    """A room without one of its walls, and in it a seat or a ball."""
    body = Body(ROOM.patches.take(np.arange(5)))
    seat = Body(PatchSet.sphere((0.9, 1.2, 0.5), 0.3) if curved else SEAT)
    return scene(setup(body, seat), sensors=[PLANE], sky=sky, ground=Ground(0.2))


@pytest.mark.parametrize("curved", [False, True])
def test_another_sky_is_seen_through_the_same_form_factors(curved):
    overcast, clear = CIESky(1), CIESky(12, sun_altitude_deg=40.0, sun_azimuth_deg=120.0)
    first = run(under(overcast, curved=curved))
    again, own = run(under(clear, curved=curved)), fresh(under(clear, curved=curved))
    assert same_mesh(again, own)
    within_error(again, own)
    plane = first.sensors["plane"].illuminance_lx
    assert not np.allclose(again.sensors["plane"].illuminance_lx, plane, rtol=0.01)
    # Past flat surfaces alone the sky is told exactly; else the rows that see it are found again.
    assert (pairs_found(again) > 0) == curved
    assert pairs_found(again) <= pairs_found(own)
    assert again.counters["rows_reused"] > 0


def test_a_mesh_from_before_the_sun_rose_is_cut_for_it():
    """Without lamps nothing was looked at then: that is not to say that it is good for any sun."""
    made = under(CIESky(1))
    sunny = dataclasses.replace(made, sun=Sun(35.0, 90.0, normal_illuminance_lx=80_000.0))
    solve(made, accuracy=0.1, cache=True)
    again, own = solve(sunny, accuracy=0.1, cache=True), solve(sunny, accuracy=0.1)
    assert own.counters["elements_added"] > 0
    assert not again.settings["mesh_of_earlier_run"] and same_mesh(again, own)


def test_a_brighter_sky_of_the_same_kind_needs_nothing():
    def sky(level):
        return CIESky(1, diffuse_illuminance_lx=level)

    first = run(under(sky(10_000.0), curved=True))
    again = run(under(sky(20_000.0), curved=True))
    assert pairs_found(again) == 0
    plane, brighter = (r.sensors["plane"].illuminance_lx for r in (first, again))
    # Everything is linear in the sky, up to rounding and the tolerance of the solver.
    assert brighter == pytest.approx(2.0 * plane, rel=1e-6)


@pytest.mark.slow
def test_a_moved_part_is_seen():
    first = run(room())
    moved = room(at=(-0.7, -0.3, 0.0))
    again = run(moved)
    within_error(again, fresh(moved))
    plane = first.sensors["plane"].illuminance_lx
    assert not np.allclose(again.sensors["plane"].illuminance_lx, plane, rtol=1e-6)


def test_another_accuracy_takes_nothing():
    run(room())
    assert pairs_found(solve(room(), accuracy=0.2, cache=True)) > 0


def test_warnings_are_given_again():
    inside = grid("inside", [(0.9, 1.2, 0.3)])
    made = dataclasses.replace(room(), sensors=(inside,))
    first, again = run(made), run(made)
    assert any("inside" in line for line in first.warnings)
    assert again.warnings == first.warnings


def two_rooms(at=0.0):
    """A wall of some thickness between two rooms, and a seat in the second one, moved by ``at``."""
    rooms = [PatchSet.box((3, 3, 2.5), center=(x, 0, 1.25), inward=True) for x in (-1.6, 1.6)]
    lamps = [ceiling(x - 0.3, x + 0.3, -0.3, 0.3, 2.4) for x in (-1.6, 1.6)]
    seat = SEAT.moved((0.9 + at, -1.2, 0.0))
    parts = setup(*(Body(r) for r in rooms), *lamps, Body(seat))
    points = [(x + d, y, 0.8) for x in (-1.6, 1.6) for d in (-0.7, 0.1) for y in (-0.8, 0.9)]
    lit = [(2, "lamp", 3000.0), (3, "lamp", 3000.0)]
    return scene(parts, lamps=lit, sensors=[grid("plane", points)])


@pytest.mark.slow
def test_rows_that_a_moved_part_does_not_touch_stay():
    """A wall hides the seat from one half of the scene: most of its rows are taken as they were."""
    first, again, own = run(two_rooms()), run(two_rooms(-0.8)), fresh(two_rooms(-0.8))
    assert again.settings["mesh_of_earlier_run"]
    rows = first.counters["unknowns"] + first.counters["unknowns_checked"] + 8
    assert again.counters["rows_reused"] > 0.3 * rows
    assert 0 < pairs_found(again) < 0.7 * pairs_found(own)
    within_error(again, own)
    # The seat stands in the second room alone, so nothing changes in the first one: to the bit what
    # sensors see of lamps, and but for rows found anew along other meridians what is reflected.
    direct = [r.sensors["plane"].components["lamp.direct"][:4] for r in (first, again)]
    assert np.array_equal(*direct)
    before, after = (r.sensors["plane"].illuminance_lx for r in (first, again))
    assert before[:4] == pytest.approx(after[:4], rel=1e-2 * ACCURACY)
    assert not np.allclose(before[4:], after[4:], rtol=1e-6)


@pytest.mark.slow
def test_only_the_pairs_that_may_change_are_found_anew():
    """Pairs found after a move are far fewer than those of the rows they are in."""
    run(room())
    again = run(room(at=(-0.2, -0.1, 0.0)))
    assert again.settings["mesh_of_earlier_run"]
    own = fresh(room(at=(-0.2, -0.1, 0.0)))
    within_error(again, own)
    renewed = again.counters["pairs_renewed"]
    every = renewed + again.counters["pairs_reused"]
    assert 0 < renewed < 0.6 * every
    # Where both meshes are alike, the pairs found are those of a fresh run, but for how rows close.
    if same_mesh(again, own):
        one, other = (r.sensors["plane"].illuminance_lx for r in (again, own))
        assert one == pytest.approx(other, rel=1e-2 * ACCURACY)


def test_a_seat_under_another_sky_takes_no_row_of_the_old_one():
    """Rows that know of the sky are not mixed with others: both change here at once."""
    overcast, clear = CIESky(1), CIESky(12, sun_altitude_deg=40.0, sun_azimuth_deg=120.0)
    run(under(overcast, curved=True))
    made = under(clear, curved=True)
    nets = made.patches.control_points.copy()
    own = made.patches.part_index == 1
    nets[own] = nets[own] @ _shift((-0.5, -0.4, 0.0)).T
    patches = PatchSet(nets, made.patches.face_index, made.patches.part_index)
    moved = dataclasses.replace(made, patches=patches)
    again, alone = run(moved), fresh(moved)
    assert same_mesh(again, alone)
    # Areas of the moved elements are found apart from the others: sums in another order.
    assert again.exitance == pytest.approx(alone.exitance, rel=1e-12)
    # How exactly dim elements are told follows from the light of the run before.
    for group, values in again.sensors["plane"].components.items():
        assert values == pytest.approx(alone.sensors["plane"].components[group], rel=1e-6)


@pytest.mark.slow
def test_lamps_are_asked_about_once_more_where_something_comes_to_them():
    """A seat that is put around a lamp is told, and buries elements that were looked at closely."""
    run(room())
    lifted = room(at=(-0.1, -1.2, 2.2))  # about the right lamp
    again, own = run(lifted), fresh(lifted)
    assert any("lamp" in line and "inside" in line for line in own.warnings)
    assert again.warnings == own.warnings


def test_as_many_elements_of_another_mesh_are_others():
    """Nothing has moved, and the meshes are of one size: their form factors are not the same."""
    made = room()
    blockers = make_blockers(made.patches, made.closed, made.patches.part_index)
    budget = Budget.of(made, ACCURACY)
    whole = Boxes.regular(budget.divisions, made.two_sided)

    def factors(place, store):
        kept = reuse.Kept(made, stages=Stages(), store=store).with_more(True)
        solver = FieldSolver(made, blockers, trace=True, stages=kept.stages, kept=kept)
        halves = whole.take(np.array([0])).cut(np.array([0]), np.array([place]))
        boxes = whole.take(np.arange(1, len(whole))).joined(halves)[0]
        return solver.solve(budget, boxes).system.factors

    factors(0.3, store.STORE)
    assert np.array_equal(factors(0.7, store.STORE), factors(0.7, None))


def under_a_panel(gap, ceiling=0.8):
    """A lamp in a room, and a black panel ``gap`` [m] below its ceiling. [m]"""
    panel = Body(PatchSet.box((1.4, 1.4, 0.02), center=(0.3, 0.2, 2.69 - gap)))
    parts = setup(ROOM, ceiling_lamp(), panel)
    made = scene(parts, lamps=[(1, "lamp", 3000.0)], materials=[0.5, 0.3, 0.0], sensors=[PLANE])
    z = made.patches.evaluate(0.5, 0.5)[:, 2]
    index = np.where((made.patches.part_index == 0) & (z > 2.6), 3, made.material_index[:, 0])
    return dataclasses.replace(
        made,
        materials=(*made.materials, Material(ceiling)),
        material_index=np.stack([index, index], axis=1),
    )


def ceiling_lamp():
    return ceiling(-1.6, -1.0, -1.8, -1.2, 2.2)


@pytest.mark.parametrize(
    "before",
    [{"gap": 0.5}, {"gap": 0.03, "ceiling": 0.0}],
    ids=["hung lower", "black above"],
)
def test_a_mesh_made_without_gaps_is_not_taken_where_there_are_some(before):
    first, again = run(under_a_panel(**before)), run(under_a_panel(0.03))
    assert "elements_added_for_gaps" not in first.counters
    assert again.counters["elements_added_for_gaps"] > 0
    assert not again.settings["mesh_of_earlier_run"]


def test_a_mesh_with_gaps_is_taken_again():
    """Though paint and lamps change: it is cut as far as either needs."""
    first = run(under_a_panel(0.03))
    again = run(under_a_panel(0.03, ceiling=0.4))
    assert first.counters["elements_added_for_gaps"] > 0
    assert again.settings["mesh_of_earlier_run"]


def test_what_is_shut_in_is_counted_once_more():
    made = room()
    first, again = run(made), run(made)
    assert pairs_found(again) == 0
    assert again.counters["elements_shut_in"] == first.counters["elements_shut_in"]


def test_a_lamp_by_night_tells_nothing_of_what_the_sky_lights():
    """A box with a slit of light from outside, beside the room that the lamp stands in."""
    night = day_and_night()
    day = dataclasses.replace(night, sky=CIESky(1), ground=Ground(0.2))
    run(night)
    same_bits(run(day), fresh(day))


def day_and_night():
    """A room with a lamp, closed, and one beside it without one of its walls."""
    lit = PatchSet.box((3.0, 3.0, 2.5), center=(-1.6, 0.0, 1.25), inward=True)
    other = PatchSet.box((3.0, 3.0, 2.5), center=(1.6, 0.0, 1.25), inward=True)
    open_ = other.take(np.flatnonzero(other.evaluate(0.5, 0.5)[:, 0] < 3.0))
    parts = setup(Body(lit), ceiling(-1.9, -1.3, -0.3, 0.3, 2.4), Body(open_))
    points = [(x, y, 0.8) for x in (-2.3, -0.9, 0.9, 2.3) for y in (-0.8, 0.9)]
    return scene(parts, lamps=[(1, "lamp", 3000.0)], sensors=[grid("plane", points)])


def test_a_sky_that_was_dark_tells_nothing_of_a_brighter_one():
    """There is nothing to scale by: what sees the sky is found anew."""
    dark, bright = (CIESky(1, diffuse_illuminance_lx=level) for level in (0.0, 10_000.0))
    run(under(dark, curved=True))
    made = under(bright, curved=True)
    again, own = run(made), fresh(made)
    assert same_mesh(again, own)
    within_error(again, own)
    plane = again.sensors["plane"].illuminance_lx
    assert np.isfinite(plane).all() and (plane > 0.0).any()


def test_rows_that_errors_are_measured_by_are_found_once(monkeypatch):
    found = []
    real = rule_error.form_factor_matrix

    def counted(*args, **options):
        found.append(len(args[0]))
        return real(*args, **options)

    monkeypatch.setattr(rule_error, "form_factor_matrix", counted)
    first = run(room())
    count = len(found)
    again = run(room())
    assert count > 0 and len(found) == count
    for name, sensors in first.sensors.items():
        assert np.array_equal(sensors.error_lx, again.sensors[name].error_lx)
