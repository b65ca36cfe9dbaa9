"""Boxes cut where direct light changes: where the cuts lie, what they cost, and what they gain."""

import dataclasses
import math

import numpy as np
import pytest
from patchlight.solver.budget import Budget
from patchlight.solver.direct_light import DirectLight, sun_numbers
from patchlight.solver.field import FieldSolver
from patchlight.solver.mesh import Boxes, elements_on
from patchlight.solver.mesher import Mesher
from patchlight.solver.model import PatchSet, Sun
from patchlight.solver.refinement import CUT, Refiner, best_cut
from patchlight.solver.simulation import solve
from patchlight.solver.stages import Stages
from patchlight.solver.tables import make_facets

from .fixtures_light import Body, ceiling, grid, rectangle, scene, setup
from .test_meridian import Bulk

PLATE = rectangle((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
ROOM = PatchSet.box((4, 3, 2.7), center=(0, 0, 1.35), inward=True)
X, Y = np.meshgrid(np.linspace(-1.75, 1.75, 8), np.linspace(-1.25, 1.25, 6), indexing="ij")
PLANE = grid("plane", np.stack([X, Y, np.full_like(X, 0.8)], axis=-1).reshape(-1, 3))
#: Size and middle of a lamp under the ceiling, out of the middle so that nothing is symmetric.
SIZE, AT = np.array([0.6, 0.6, 0.08]), np.array([0.31, -0.17])


def room_with_lamp(gap, *, body=ROOM, **more):
    """A box that shines all over, ``gap`` [m] below the ceiling."""
    lamp = Body(PatchSet.box(tuple(SIZE), center=(*AT, 2.7 - gap - 0.5 * SIZE[2])))
    lamps = [(1, "lamp", 1000.0)]
    options = {"materials": [0.7, 0.5], "sensors": [PLANE], **more}
    return scene(setup(Body(body), lamp), lamps=lamps, **options)


def boxes_of(made, accuracy, **changes):
    """Boxes of a mesh."""
    parts = setup(Body(made.patches))
    budget = dataclasses.replace(Budget.of(made, accuracy), **changes)
    solids = setup(*(Body(made.patches.take(made.patches.part_index == k)) for k in range(2)))
    assert len(solids.patches) == len(parts.patches)
    return Mesher(made, solids.blockers, trace=True, stages=Stages()).boxes(budget)[0]


class Light:
    """Light of which the illuminance is given as a function of points."""

    def __init__(self, illuminance, nearness=0.0):
        self.illuminance, self.nearness = illuminance, nearness

    def at(self, points, normals, patches):
        return self.illuminance(points), np.full(len(points), self.nearness)

    def stays(self, points, normals):
        return np.ones(len(points))


def refined(patches, light, allowed, *, counts=(1, 1), most=1000, two_sided=False, distance=1e3):
    p = len(patches)
    boxes = Boxes.regular(np.tile(counts, (p, 1)), np.full(p, two_sided))
    refiner = Refiner(patches, np.ones((p, 2)), light, distance)
    return refiner.refine(boxes, allowed, most)


def fills(boxes, sides):
    """Whether boxes fill each side once: every point of a fine grid lies in one of them."""
    t = (np.arange(97) + 0.3) / 97
    u, v = np.meshgrid(t, t, indexing="ij")
    count = np.zeros((sides, 97, 97), dtype=int)
    for patch, side, (u0, u1, v0, v1) in zip(boxes.patch, boxes.side, boxes.ends, strict=True):
        count[2 * patch + side] += (u0 < u) & (u < u1) & (v0 < v) & (v < v1)
    used = count.any(axis=(1, 2))
    area = np.diff(boxes.ends.reshape(-1, 2, 2), axis=2).prod(axis=1).sum()
    return bool((count[used] == 1).all()) and area == pytest.approx(used.sum(), rel=1e-12)


@pytest.mark.parametrize("place", range(1, CUT))
@pytest.mark.parametrize("axis", [0, 1])
def test_the_best_cut_is_at_the_edge(axis, place):
    light = np.where(np.arange(CUT) < place, 5.0, 1.0)
    light = np.broadcast_to(light[:, None] if axis == 0 else light, (1, CUT, CUT))
    found = best_cut(light, np.ones_like(light))
    assert [int(f[0]) for f in found] == [axis, place]


def test_even_light_is_halved():
    light = np.full((2, CUT, CUT), 3.0)
    light[1, 4:] *= 1.0 + 1e-15  # rounding does not choose
    _, place = best_cut(light, np.ones_like(light))
    assert place.tolist() == [CUT // 2, CUT // 2]


def test_cuts_find_an_edge():
    """Light on one side of x = 0.37 only, in a gap."""
    light = Light(lambda x: np.where(x[:, 0] < 0.37, 100.0, 0.0), nearness=1e3)
    boxes, left = refined(PLATE, light, 1e-3)
    assert fills(boxes, 2)
    assert len(boxes) <= 8
    # Points look no nearer to the sides of a box than 0.07 of it: the first cut is at 3/8.
    assert np.abs(boxes.ends[:, :2] - 0.37).min() <= 0.07 * 0.375
    assert left <= 1e-3
    assert (np.diff(boxes.ends[:, 2:], axis=1) == 1.0).all()  # across the edge only


def test_an_edge_aslant_is_found_to_what_is_allowed():
    light = Light(lambda x: np.where(x[:, 0] + 0.6 * x[:, 1] < 0.7, 100.0, 0.0), nearness=1e3)
    coarse, fine = (refined(PLATE, light, a) for a in (0.1, 0.05))
    for boxes, _ in (coarse, fine):
        assert fills(boxes, 2)
    assert len(coarse[0]) < len(fine[0])
    assert coarse[1] <= 0.1 and fine[1] <= 0.05


def test_what_is_small_against_the_distance_is_left():
    """Light that changes gradually, a thousand plates away from what it falls on."""
    light = Light(lambda x: 100.0 + 4.0 * (x[:, 0] - 0.5) ** 2)
    boxes, left = refined(PLATE, light, 1e-3)
    assert len(boxes) == 1
    # Mean of |t² − 1/3| over −1 … 1 in 100.3 lx, moved by a thousandth; 4 x 4 points tell it to
    # 11 %.
    assert left == pytest.approx(8.0 / 9.0 / math.sqrt(12.0) / 100.3333 * 1e-3, rel=0.12)


def test_light_that_nodes_tell_is_not_misplaced():
    """Bilinear over a plane element: interpolated between its nodes to the bit, nearly."""
    light = Light(lambda x: 100.0 + 3.0 * x[:, 0] - x[:, 1] + 2.0 * x[:, 0] * x[:, 1], nearness=1e3)
    boxes, left = refined(PLATE, light, 1e-9)
    assert len(boxes) == 1 and left < 1e-14


def test_no_more_boxes_than_allowed():
    light = Light(lambda x: np.hypot(x[:, 0], x[:, 1]) < 0.6, nearness=1e3)
    for most in (1, 2, 7, 40):
        boxes, _ = refined(PLATE, light, 1e-6, most=most)
        assert len(boxes) <= most and fills(boxes, 2)
    assert len(boxes) == 40


def test_darkness_is_not_cut():
    boxes, left = refined(PLATE, Light(lambda x: np.zeros(len(x))), 0.0, counts=(2, 3))
    assert len(boxes) == 6 and left == 0.0


def test_both_sides_of_a_sheet_are_cut_by_their_own_light():
    class Above(Light):
        def at(self, points, normals, patches):
            light = (normals[:, 2] > 0) & (points[:, 0] < 0.3)
            return light.astype(float), np.full(len(points), 1e3)

    boxes, _ = refined(PLATE, Above(None), 1e-2, two_sided=True)
    assert fills(boxes, 2)
    assert (boxes.side == 1).sum() == 1 and (boxes.side == 0).sum() > 1
    assert (np.diff(boxes.side) >= 0).all()


def test_regular_boxes():
    boxes = Boxes.regular(np.array([[2, 3], [1, 1]]), np.array([False, True]))
    assert boxes.patch.tolist() == [0] * 6 + [1, 1] and boxes.side.tolist() == [0] * 7 + [1]
    assert fills(boxes, 4)
    np.testing.assert_allclose(boxes.ends[1], [0, 0.5, 1 / 3, 2 / 3])


def test_flat_patches_stay_one_panel_however_they_are_cut():
    """Cells of a grid along all lines, each handed to its element: the shares are the same."""
    light = Light(lambda x: np.hypot(x[:, 0] - 1, x[:, 1] - 0.5) < 0.9, nearness=1e3)
    parts = setup(
        Body(PatchSet.box((4, 3, 2.7), center=(0, 0, 1.35), inward=True)),
        Body(PatchSet.box((1.3, 0.8, 0.05), center=(0.2, 0.3, 0.9))),
    )
    boxes, _ = refined(parts.patches, light, 0.03, counts=(2, 2))
    bulk = Bulk(parts, 2)
    bulk.elements = elements_on(parts.patches, boxes)
    facets, lifts = make_facets(bulk.elements, bulk.nets, parts.closed, parts.solid)
    assert len(facets.panel_corners) == 12 and (facets.panel_grid >= 0).all()
    assert set(facets.grid_element.tolist()) == set(range(len(boxes)))
    assert len(facets.grid_element) > len(boxes) > 60
    assert not lifts.any()


def test_shares_of_elements_of_several_cells(monkeypatch):
    """Joined or not, a partly hidden floor is seen alike, and with the same deviations."""
    parts = setup(
        Body(PatchSet.box((4, 3, 2.7), center=(0, 0, 1.35), inward=True)),
        Body(PatchSet.box((1.3, 0.8, 0.05), center=(0.2, 0.3, 0.9))),
    )
    light = Light(lambda x: np.hypot(x[:, 0] - 1, x[:, 1] - 0.5) < 0.9, nearness=1e3)
    boxes, _ = refined(parts.patches, light, 0.03, counts=(2, 2))

    def rows():
        bulk = Bulk(parts, 2)
        bulk.elements = elements_on(parts.patches, boxes)
        bulk.receivers = type(bulk.receivers).of_elements(bulk.elements)
        closed, solid = bulk.blockers.closed, bulk.blockers.solid
        bulk.facets, bulk.lifts = make_facets(bulk.elements, bulk.nets, closed, solid)
        return bulk.rows(64)

    joined = rows()
    monkeypatch.setattr(
        "patchlight.solver.tables._in_grids", lambda elements, nets, element, ends: (element, ends)
    )
    apart = rows()
    # What no meridian meets is told by panels that differ: single small elements, each within its
    # stated deviation; what is met is the same but for rounding.
    off = np.abs(joined.factors - apart.factors)
    assert (off <= 1e-9 + 4.0 * np.sqrt(joined.variances + apart.variances)).all()
    sampled = (joined.variances > 0.0) & (apart.variances > 0.0)
    ratio = joined.variances[sampled] / apart.variances[sampled]
    assert np.median(ratio) == pytest.approx(1.0, rel=1e-3)


def test_rows_of_a_closed_room_still_sum_to_one():
    result = solve(room_with_lamp(0.02), accuracy=0.1)
    assert result.counters["elements_added"] > 0
    # Raw sums; single rows in the gap see slivers along few meridians.
    assert np.median(np.abs(result.row_sums - 1.0)) < 1e-3
    assert np.percentile(np.abs(result.row_sums - 1.0), 95) < 3e-2


def test_furnace_on_a_cut_mesh():
    """Everything shines alike: E / (1 − ρ) everywhere, whatever the elements."""
    made = room_with_lamp(0.02, materials=[0.5, 0.5])
    made = dataclasses.replace(
        made,
        luminaire_index=np.stack([np.zeros(12, int), np.full(12, -1)], axis=1),
        luminaires=(
            dataclasses.replace(
                made.luminaires[0],
                flux_lm=100.0 * float(made.patches.areas().sum()),
                area_m2=float(made.patches.areas().sum()),
            ),
        ),
    )
    result = solve(made, accuracy=0.1)
    # Rows are closed to 1: what GMRES leaves.
    np.testing.assert_allclose(result.exitance, 200.0, rtol=1e-4)


def test_plain_light_is_left_to_the_size_of_the_mesh():
    """A lamp in the middle of the room: the regular mesh is good enough for the accuracy."""
    made = scene(
        setup(Body(ROOM), ceiling(-0.3, 0.3, -0.3, 0.3, 2.0)),
        lamps=[(1, "lamp", 1000.0)],
        sensors=[PLANE],
    )
    for accuracy in (0.2, 0.05):
        result = solve(made, accuracy=accuracy)
        assert result.counters["elements_added"] <= 0.05 * len(result.elements)


def test_without_lamps_nothing_is_cut():
    result = solve(scene(setup(Body(ROOM)), sensors=[PLANE]), accuracy=0.2)
    assert "elements_added" not in result.counters


def test_boxes_do_not_depend_on_size_or_place():
    plain = boxes_of(room_with_lamp(0.01), 0.05)
    made = room_with_lamp(0.01)
    quarter = np.eye(4)  # about z, and away: sizes follow the room's sides
    quarter[:2, :2], quarter[:3, 3] = [[0.0, -1.0], [1.0, 0.0]], (3.0, -2.0, 5.0)
    for motion in (quarter, np.diag([1e3, 1e3, 1e3, 1.0])):
        nets = made.patches.control_points @ motion.T
        patches = PatchSet(nets, made.patches.face_index, made.patches.part_index)
        luminaire = made.luminaires[0]
        if motion[0, 0] == 1e3:
            luminaire = dataclasses.replace(luminaire, area_m2=1e6 * luminaire.area_m2)
        moved = dataclasses.replace(made, patches=patches, luminaires=(luminaire,), sensors=())
        found = boxes_of(moved, 0.05)
        assert len(found) == len(plain)
        np.testing.assert_allclose(found.ends, plain.ends, atol=1e-12)


def test_memory_sets_a_limit(monkeypatch):
    monkeypatch.setattr("patchlight.solver.mesher.fits", lambda elements: False)
    made = room_with_lamp(0.01)
    boxes = boxes_of(made, 0.05)
    assert len(boxes) == Budget.of(made, 0.05).elements


def test_many_lamps_are_not_looked_at_one_by_one(monkeypatch):
    """Where it would cost more than the form factors themselves, equal elements have to do."""
    monkeypatch.setattr("patchlight.solver.mesher.MANY_LAMPS", 5)
    made = room_with_lamp(0.01)
    blockers = setup(Body(made.patches)).blockers
    many = Budget.of(made, 0.05)
    few = dataclasses.replace(many, divisions=np.ones((12, 2), np.int64), elements=12)

    def boxes(budget: Budget) -> tuple[int, dict[str, str]]:
        stages = Stages()
        found, _ = Mesher(made, blockers, trace=False, stages=stages).boxes(budget)
        return len(found), stages.skipped

    count, skipped = boxes(few)
    assert count == 12 and skipped["refinement"].startswith("6 shining patches")
    count, skipped = boxes(many)
    assert count > many.elements and "refinement" not in skipped


def test_points_are_done_some_at_a_time(monkeypatch):
    made = room_with_lamp(0.01)
    at_once = boxes_of(made, 0.1)
    monkeypatch.setattr("patchlight.solver.direct_light.PAIRS", 600)
    some = boxes_of(made, 0.1)
    assert np.array_equal(some.ends, at_once.ends) and np.array_equal(some.patch, at_once.patch)


def test_the_number_of_elements_is_bounded():
    made = room_with_lamp(0.002)
    budget = Budget.of(made, 0.05)
    boxes = boxes_of(made, 0.05, misplaced=1e-9)
    assert budget.elements < len(boxes) <= budget.most_elements <= 2 * budget.elements


def lines_about(edges, low, high, size, least):
    """Lines from ``low`` to ``high`` with some at the ``edges``, and closer and closer to them."""
    places = {low, high, *edges}
    for edge in edges:
        step, off = least, least
        while step < size:
            places |= {x for x in (edge - off, edge + off) if low < x < high}
            step *= 1.7
            off += step
    kept = sorted(places)
    out = [low]
    for place in kept[1:]:
        n = max(1, round((place - out[-1]) / size))
        start = out[-1]
        out += [start + (place - start) * k / n for k in range(1, n + 1)]
    lines = np.array(out)
    far = np.abs(lines[:, None] - np.array(edges)).min(axis=1)
    # What lies closer to another edge's line than that line's own step would be a sliver.
    keep = np.ones(len(lines), dtype=bool)
    keep[1:-1] = (np.diff(lines)[:-1] > 0.3 * least) | (far[1:-1] == 0.0)
    return lines[keep]


def aligned_truth(made, gap, size):
    """Indirect light with lines in the ceiling along the lamp's outline: it crosses no element."""
    budget = Budget.of(made, 0.02)
    counts = np.maximum(
        1, np.ceil(np.array([[4, 3]] * 2 + [[4, 2.7]] * 4 + [[0.6, 0.6]] * 6) / size)
    )
    counts[6:] = 4
    boxes = Boxes.regular(counts, np.zeros(12, bool))
    top = int(np.argmax(ROOM.evaluate(0.5, 0.5)[:, 2]))
    net = ROOM.control_points[top, ..., :3]
    lines = []
    for step in (net[3, 0] - net[0, 0], net[0, 3] - net[0, 0]):
        axis = int(np.argmax(np.abs(step)))
        edges = [AT[axis] - 0.5 * SIZE[axis], AT[axis] + 0.5 * SIZE[axis]]
        half = 0.5 * abs(step[axis])
        places = lines_about(edges, -half, half, size, gap)
        lines.append(np.sort((places - net[0, 0, axis]) / step[axis]))
    (u, v), kept = lines, boxes.patch != top
    i, j = (g.ravel() for g in np.indices((len(u) - 1, len(v) - 1)))
    own = np.stack([u[i], u[i + 1], v[j], v[j + 1]], axis=1)
    ceiling_boxes = Boxes(np.full(len(i), top), np.zeros(len(i), int), own)
    boxes, _ = boxes.take(kept).joined(ceiling_boxes)
    room, lamp = (Body(made.patches.take(made.patches.part_index == k)) for k in range(2))
    solver = FieldSolver(made, setup(room, lamp).blockers, trace=True, stages=Stages())
    budget = dataclasses.replace(budget, size=0.0)
    field = solver.solve(budget, boxes)
    seen = solver.seen(made.sensors[0], budget, field)
    found, *_ = solver.gather(made.sensors[0], seen, field, solver.finer(field, budget, [seen]))
    return found.luminous("indirect")


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.02, 0.005, 0.002])
def test_light_from_a_gap_under_the_ceiling(gap):
    """As accurate as asked, and as stated; equal elements alone are 17 % off at 1 %."""
    made = room_with_lamp(gap)
    rough, truth = (aligned_truth(made, gap, size) for size in (0.5, 0.35))
    # What the truth itself still moves when its lines are closer.
    doubt = np.abs(rough / truth - 1.0).max()
    assert doubt < 0.01
    for accuracy in (0.1, 0.05, 0.02):
        found = solve(made, accuracy=accuracy).sensors["plane"]
        error = np.abs(found.components["lamp.indirect"] - truth)
        relative = error / found.illuminance_lx
        assert np.percentile(relative, 95) <= accuracy + doubt
        held = error <= found.error_lx + doubt * truth
        assert held.mean() >= 0.95, (accuracy, error / found.error_lx)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_stated_errors_hold_in_rooms_at_random(seed):
    """Lamps anywhere, some next to a wall or the ceiling, and a piece of furniture."""
    random = np.random.default_rng(seed)
    bodies, lamps = [Body(ROOM)], []
    for k in range(2):
        size = random.uniform((0.2, 0.2, 0.03), (0.9, 0.5, 0.1))
        gap = 10.0 ** random.uniform(-2.5, -0.3)
        x, y = random.uniform(-1.3, -0.6) + 2.0 * k, random.uniform(-1.0, 1.0)
        bodies.append(Body(PatchSet.box(tuple(size), center=(x, y, 2.7 - gap - 0.5 * size[2]))))
        lamps.append((k + 1, f"lamp{k}", 1000.0))
    bodies.append(Body(PatchSet.box((1.2, 0.6, 0.03), center=(*random.uniform(-0.8, 0.8, 2), 0.7))))
    made = scene(setup(*bodies), lamps=lamps, materials=[0.7, 0.5, 0.5, 0.4], sensors=[PLANE])
    reference = solve(made, accuracy=0.015).sensors["plane"]
    for accuracy in (0.2, 0.07):
        found = solve(made, accuracy=accuracy).sensors["plane"]
        error = np.abs(found.illuminance_lx - reference.illuminance_lx)
        held = error <= found.error_lx + reference.error_lx
        assert held.mean() >= 0.95, (accuracy, (error / found.error_lx).round(2))


def test_a_convex_lamp_does_not_hide_itself():
    """Light of a sphere in a sphere is even: nothing is misplaced, and no box is cut."""
    lamp = Body(PatchSet.sphere((0, 0, 0), 1.0))
    shell = Body(PatchSet.sphere((0, 0, 0), 2.0, inward=True))
    made = scene(setup(lamp, shell), lamps=[(0, "lamp", 1.0)])
    stages = Stages()
    mesher = Mesher(made, setup(lamp, shell).blockers, trace=True, stages=stages)
    boxes, misplaced = mesher.boxes(Budget.of(made, 0.1))
    # Direct light is found to 1e-2 for this.
    assert misplaced <= 0.02 and stages.counters.get("elements_added", 0) == 0


def test_no_cuts_for_a_sun_that_does_not_come_in():
    """No rays are traced in a closed convex room: its walls keep the sun out all the same."""
    box = Body(ROOM)
    made = scene(setup(box), sun=Sun(40.0, 200.0, normal_illuminance_lx=80_000.0))
    blockers = setup(box).blockers
    assert not len(sun_numbers(made, blockers))
    light = DirectLight(made, blockers, trace=False)
    assert not light.at(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.zeros(1, int))[0].any()
    mesher = Mesher(made, blockers, trace=False, stages=Stages())
    budget = Budget.of(made, 0.1)
    assert len(mesher.boxes(budget)[0]) == len(Boxes.regular(budget.divisions, made.two_sided))
    # The same from outside is a body that the sun shines on.
    body = Body(ROOM.flipped())
    outside = scene(setup(body), sun=made.sun)
    assert len(sun_numbers(outside, setup(body).blockers))
