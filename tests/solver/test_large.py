"""Meshes too large for whole matrices: packed rows, and the same light as without."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from patchlight.solver import budget, field, field_rows, large_rows, memory, row_finder, simulation
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import CIESky, Material, PatchSet, Photometry, Web
from patchlight.solver.packed import PACKED_ROUNDING, GroupedVariances, PackedMatrix
from patchlight.solver.simulation import solve
from patchlight.solver.unknowns import Unknowns

from .fixtures_light import Body, ceiling, grid, rectangle, scene, setup

#: What nodes that count against an element near by are worth, where elements are as coarse as here.
NEGATIVE = 4e-3


def matrix(n=300, filled=1.0, seed=1, rows=200):
    """Factors over many orders of magnitude, as they come: many of them 0."""
    rng = np.random.default_rng(seed)
    out = (10.0 ** rng.uniform(-9, -1, (rows, n))).astype(np.float32)
    out[rng.random(out.shape) >= filled] = 0.0
    out[3] = 0.0  # a buried element
    return out


def packed(factors, size=77, **options):
    out = PackedMatrix(factors.shape[1], **options)
    for start in range(0, len(factors), size):
        out.append(factors[start : start + size])
    return out


@pytest.fixture(params=[1.0, 0.2], ids=["full", "sparse"])
def factors(request):
    return matrix(filled=request.param)


def test_factors_are_rounded_to_twelve_bits_and_rows_keep_their_sums(factors):
    found = packed(factors).take(np.arange(len(factors)))
    # The scale that restores the sum moves all factors by less than their rounding.
    np.testing.assert_allclose(found, factors, rtol=2 * PACKED_ROUNDING, atol=1e-10)
    ones = packed(factors).products(np.ones(factors.shape[1]))
    np.testing.assert_allclose(ones, factors.sum(axis=1, dtype=float), rtol=1e-13)
    assert (found[3] == 0.0).all()


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (70,), (0,)])
def test_products_are_those_of_what_is_unpacked(factors, shape):
    rng = np.random.default_rng(2)
    kept = packed(factors)
    whole = kept[np.arange(200), np.arange(300)].astype(float)
    light, values = rng.random((300, *shape)), rng.random((200, *shape))
    # What is unpacked is rounded to single precision.
    found = kept.products(light)
    np.testing.assert_allclose(found, np.tensordot(whole, light, 1), rtol=1e-7)
    found = kept.transposed_products(values)
    np.testing.assert_allclose(found, np.tensordot(whole.T, values, 1), rtol=1e-7)


def test_blocks_beyond_the_room_lie_in_a_file(factors):
    kept, filed = packed(factors), packed(factors, room=20_000)
    assert kept.bytes_on_disk == 0
    assert 0 < filed.bytes_on_disk
    light = np.random.default_rng(3).random((300, 3))
    np.testing.assert_array_equal(kept.products(light), filed.products(light))
    values = np.random.default_rng(4).random(200)
    np.testing.assert_array_equal(
        kept.transposed_products(values), filed.transposed_products(values)
    )


def test_what_is_hidden_takes_no_room():
    assert packed(matrix(filled=1.0)).nbytes == pytest.approx(2 * 300 * 200, rel=0.05)
    # Place and factor, two bytes each, and where rows begin.
    assert packed(matrix(filled=0.1)).nbytes == pytest.approx(0.1 * 4 * 300 * 200, rel=0.2)


def test_more_columns_than_a_short_place_tells():
    n = 70_000
    factors = np.zeros((3, n), dtype=np.float32)
    factors[:, [0, 65_535, 65_536, n - 1]] = [0.1, 0.2, 0.3, 0.05]
    kept = packed(factors)
    np.testing.assert_allclose(kept.take(np.array([2]))[0], factors[2], rtol=2 * PACKED_ROUNDING)
    np.testing.assert_allclose(kept.products(np.arange(n))[1], factors[1] @ np.arange(n), rtol=1e-3)


def test_a_block_can_be_packed_anew(factors):
    kept = packed(factors, size=100)
    other = matrix(seed=9, rows=100)
    kept.replace(1, other)
    light = np.random.default_rng(5).random(300)
    expected = packed(np.concatenate([factors[:100], other]), size=100)
    np.testing.assert_array_equal(kept.products(light), expected.products(light))


def test_variances_of_groups_lose_nothing_in_all():
    rng = np.random.default_rng(6)
    variances, light = rng.random((40, 30)).astype(np.float32), rng.random(30)
    known = GroupedVariances(np.arange(30) % 4, 4, np.array([2, 7]))
    for start in (0, 20):
        known.put(start, variances[start : start + 20])
    exact = variances.astype(float) @ light**2
    np.testing.assert_allclose(known.of(light).sum(), exact.sum(), rtol=1e-6)
    even = np.array([1.0, 5.0, 2.0, 0.5])[known.group]
    np.testing.assert_allclose(known.of(even), variances.astype(float) @ even**2, rtol=1e-6)
    np.testing.assert_array_equal(known[:, np.array([7])], variances[:, [7]])
    np.testing.assert_array_equal(
        known[np.ix_([3, 21], [2, 7])], variances[np.ix_([3, 21], [2, 7])]
    )


def room(**more):
    """A furnished room, lit by a lamp, and through a gap under its ceiling if that is open."""
    table = Body(PatchSet.box((1.2, 0.8, 0.1), center=(0.3, 0.2, -0.6)))
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    lamp = ceiling(-0.5, 0.5, -0.5, 0.5, 1.3)
    sensors = [grid("plane", [(0, -1, 0), (1.5, 2.0, -0.5), (-1.2, 0.3, 0.9), (0.3, 0.2, -1.2)])]
    return scene(setup(walls, table, lamp), lamps=[(2, "lamp", 3000.0)], sensors=sensors, **more)


def porch(**more):
    """Plates under the sky: light enters and leaves."""
    floor = Body(PatchSet.box((3, 3, 0.2), center=(0, 0, -0.1)))
    roof = Body(PatchSet.box((2, 2, 0.2), center=(0, 0, 1.6)))
    sensors = [grid("plane", [(0, 0, 0.4), (1.2, 0.9, 0.5)])]
    return scene(setup(floor, roof), sensors=sensors, sky=CIESky(16), **more)


@pytest.fixture
def small_limits(monkeypatch):
    """Everything is large, and a block holds 20 rows."""
    monkeypatch.setattr(budget, "VARYING_ELEMENTS", 0)
    monkeypatch.setattr(memory, "DENSE_UNKNOWNS", 10)
    monkeypatch.setattr(memory, "VARYING_UNKNOWNS", 10)
    monkeypatch.setattr(large_rows, "BLOCK_BYTES", 0)
    monkeypatch.setattr(large_rows, "LEAST_ROWS", 20)


@pytest.mark.parametrize("make", [room, porch])
def test_packed_meshes_give_the_same_light(make, small_limits, monkeypatch):
    # Of the worst rows so many a block are found anew, not so many of all.
    monkeypatch.setattr(row_finder, "LEVELS", 0)
    monkeypatch.setattr(simulation, "REFINEMENTS", 0)  # the same mesh
    packed_run = solve(make(), accuracy=0.1)
    monkeypatch.setattr(memory, "DENSE_UNKNOWNS", 10**6)
    monkeypatch.setattr(memory, "VARYING_UNKNOWNS", 10**6)
    whole = solve(make(), accuracy=0.1)
    assert packed_run.counters["packed_bytes"] > 0
    assert packed_run.counters["unknowns"] > packed_run.counters["elements"]
    assert "packed_bytes" not in whole.counters
    for name, expected in whole.sensors["plane"].components.items():
        found = packed_run.sensors["plane"].components[name]
        # Factors are rounded to 2⁻¹², and their errors average in a row; direct light at sensors
        # is not packed.
        rtol = 1e-12 if name.endswith(".direct") else NEGATIVE
        np.testing.assert_allclose(found, expected, rtol=rtol, atol=1e-9)
    np.testing.assert_allclose(
        packed_run.sensors["plane"].error_lx, whole.sensors["plane"].error_lx, rtol=0.05
    )
    np.testing.assert_allclose(packed_run.row_sums, whole.row_sums, rtol=1e-12)
    assert abs(packed_run.balance.residual_lm - whole.balance.residual_lm) <= (
        NEGATIVE * (whole.balance.emitted_lm + whole.balance.entered_lm)
    )


def test_factors_of_nodes_near_by_become_positive_and_keep_their_sums():
    boxes = PatchSet.box((1, 1, 1))
    elements = make_elements(boxes, np.zeros(6, bool), np.ones((6, 2), int), nodes=2)
    unknowns = Unknowns.of(elements, "bilinear")
    rng = np.random.default_rng(8)
    factors = rng.uniform(-0.2, 1.0, (5, 24)).astype(np.float32)
    factors[0] = np.abs(factors[0])
    before = factors.copy()
    large_rows._lift_negative(factors, unknowns)
    assert (factors >= 0.0).all()
    np.testing.assert_array_equal(factors[0], before[0])
    sums = before.reshape(5, 6, 4).sum(axis=2)
    np.testing.assert_allclose(
        factors.reshape(5, 6, 4).sum(axis=2), np.maximum(sums, 0.0), rtol=1e-5, atol=1e-6
    )


def test_light_that_leaves_late_blocks_only_is_found(small_limits, monkeypatch):
    """Blocks that were closed as if nothing left are found again once one shows that it does."""
    seen = []
    original = field_rows.FieldRows.sees_out

    def blind_at_first(self, rows, lit):
        seen.append(len(rows.factors))
        return original(self, rows, lit) if len(seen) > 2 else False

    monkeypatch.setattr(field_rows.FieldRows, "sees_out", blind_at_first)
    late = solve(porch(), accuracy=0.1)
    assert late.counters["rows_found_twice"] > 0
    monkeypatch.setattr(field_rows.FieldRows, "sees_out", original)
    soon = solve(porch(), accuracy=0.1)
    assert "rows_found_twice" not in soon.counters or not soon.counters["rows_found_twice"]
    np.testing.assert_allclose(
        late.sensors["plane"].illuminance_lx, soon.sensors["plane"].illuminance_lx, rtol=1e-12
    )


def webbed():
    """The room lit by a web, I = I0 cosγ."""
    data = room()
    gamma = np.arange(0.0, 91.0, 1.0)
    row = 1000.0 / np.pi * np.cos(np.radians(gamma))
    photometry = Photometry([0.0, 360.0], gamma, [row, row])
    web = Web.aimed(photometry, (0, 0, -1), (1, 0, 0))
    lamp = dataclasses.replace(data.luminaires[0], web=web, flux_lm=photometry.flux_lm)
    return dataclasses.replace(data, luminaires=(lamp,))


def test_lamps_with_webs_shine_in_packed_meshes(small_limits, monkeypatch):
    packed_run = solve(webbed(), accuracy=0.1)
    monkeypatch.setattr(memory, "DENSE_UNKNOWNS", 10**6)
    monkeypatch.setattr(memory, "VARYING_UNKNOWNS", 10**6)
    whole = solve(webbed(), accuracy=0.1)
    assert packed_run.counters["packed_bytes"] > 0
    np.testing.assert_allclose(
        packed_run.sensors["plane"].illuminance_lx,
        whole.sensors["plane"].illuminance_lx,
        rtol=2 * PACKED_ROUNDING,
    )
    found = packed_run.components["lamp.direct"]
    # Single factors of the lamp, on each element: their rounding, and the scale of their row.
    np.testing.assert_allclose(found, whole.components["lamp.direct"], rtol=2 * PACKED_ROUNDING)


@pytest.fixture
def many(monkeypatch):
    """Meshes of more than 50 elements are large."""
    monkeypatch.setattr(budget, "VARYING_ELEMENTS", 50)
    monkeypatch.setattr(budget, "MANY_ELEMENTS", 50)


def test_large_meshes_tell_their_error(many, monkeypatch):
    large = solve(room(), accuracy=0.03)
    assert large.settings["meridians"] == budget.LINES_OF_MANY
    assert large.counters["unknowns_checked"] > 0
    monkeypatch.setattr(budget, "MANY_ELEMENTS", 10**6)
    small = solve(room(), accuracy=0.01)
    found, truth = large.sensors["plane"], small.sensors["plane"]
    off = np.abs(found.illuminance_lx - truth.illuminance_lx)
    # Half-widths hold at 95 % of the sensors; these four see much the same elements.
    assert (off <= 1.5 * (found.error_lx + truth.error_lx)).all()


def test_light_of_large_meshes_is_gathered_in_blocks(many, monkeypatch):
    """More finely known light is the same, however few rows are held at a time."""
    whole = solve(room(), accuracy=0.1)
    monkeypatch.setattr(field, "BLOCK_BYTES", 0)
    parts = solve(room(), accuracy=0.1)
    # Meridians start at other angles, and few of them meet each element.
    for name, expected in whole.sensors["plane"].components.items():
        rtol = 1e-12 if name.endswith(".direct") else 2e-3
        np.testing.assert_allclose(parts.sensors["plane"].components[name], expected, rtol=rtol)


def pendant():
    """A lamp that shines up onto the ceiling close above it, which it hides from below."""
    lamp = rectangle((-0.6, -0.2, 0.95), (0.6, -0.2, 0.95), (0.6, 0.2, 0.95), (-0.6, 0.2, 0.95))
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    shade = Body(PatchSet.box((1.2, 0.4, 0.04), center=(0, 0, 0.92)))
    return scene(setup(walls, lamp, shade), lamps=[(1, "lamp", 3000.0)], rho=0.7)


def test_large_meshes_are_solved_with_what_is_hidden(monkeypatch):
    """Light gathered once more where the mesh knows it is the same: hidden parts do not shine."""
    monkeypatch.setattr(budget, "VARYING_ELEMENTS", 20)
    monkeypatch.setattr(budget, "MANY_ELEMENTS", 20)
    run = simulation.Simulation(pendant(), 0.05, "auto", simulation.Stages(), simulation.Options())
    solver, _ = run.start()
    solved = solver.solve(run.budget, solver.mesher.boxes(run.budget)[0])
    again, _ = solver.light_at(solved.unknowns, run.budget, solved)
    areas = solved.unknowns.areas
    found, known = (light.components["lamp.indirect"][:, 0] for light in (again, solved.arriving))
    off = np.sqrt(np.average((found - known) ** 2, weights=areas))
    # Without, 3e-4. What the change of the light changes again is left.
    assert off < 1e-6 * np.average(known, weights=areas)


def test_packed_rows_tell_form_factors_of_whole_elements(factors):
    element = np.sort(np.random.default_rng(2).choice(np.arange(1, 90), factors.shape[1]))
    unknowns = SimpleNamespace(element=element, elements=90)
    more = {"grouped": None, "unknowns": unknowns}
    sums = np.zeros((len(factors), 2))
    rows = large_rows.PackedRows(packed(factors), None, {}, np.zeros((0, 5)), sums, **more)
    some = np.array([5, 6, 99, 3])
    expected = np.stack([np.bincount(element, row, minlength=90) for row in factors[some]])
    assert not expected[:, 0].any()
    np.testing.assert_allclose(rows.of_elements(some), expected, rtol=2 * PACKED_ROUNDING)


def test_an_even_light_stays_even_in_large_meshes(many):
    sphere = Body(PatchSet.sphere((0, 0, 0), 1.0, inward=True))
    furnace = scene(setup(sphere), rho=0.5, lamps=[(0, "wall", 100.0)])
    result = solve(furnace, accuracy=0.01)
    expected = 100.0 / 0.5
    # As far as single factors are known.
    np.testing.assert_allclose(result.surfaces["*"].illuminance_lx, expected, rtol=3e-4)


def test_what_light_varies_over_needs_form_factors_alone(many):
    assert budget.Budget.of(room(), 0.02).basis == "bilinear"
    mirrored = dataclasses.replace(room(), materials=(Material(0.2, mirror=0.5),) * 3)
    assert budget.Budget.of(mirrored, 0.02).basis == "constant"


def test_large_meshes_have_fewer_lines_a_node_and_one_node_on_what_is_small(monkeypatch):
    data = room()
    few = budget.Budget.of(data, 0.02)
    assert not few.is_large and few.gathered(10_000) == 10_000 * budget.GATHERED
    assert few.gathered(10) == budget.PIECES and few.left_out == 0.0
    monkeypatch.setattr(budget, "MANY_ELEMENTS", few.elements // 2)
    many = budget.Budget.of(data, 0.02)
    assert many.elements == few.elements and many.is_large
    assert few.lines == 250 and many.lines == budget.LINES_OF_MANY
    assert many.sights == budget.SIGHTS_OF_MANY < few.sights
    assert many.small > few.small
    # As many rows may be found again, but no more than matter.
    assert many.gathered(200_000) == 200_000 * budget.GATHERED
    assert many.left_out == budget.LEFT_OUT_OF_MANY > 0.0
    # No more than a small mesh has.
    monkeypatch.setattr(budget, "LINES_OF_MANY", 64)
    assert budget.Budget.of(data, 0.5).lines == 48


def test_large_meshes_look_closely_where_it_matters(monkeypatch):
    """As many elements are halved as leave out little of what may matter, and no more."""
    monkeypatch.setattr(budget, "MANY_ELEMENTS", 1)
    halved = {}
    for left_out in (0.0, 0.2, 1.0):
        monkeypatch.setattr(budget, "LEFT_OUT_OF_MANY", left_out)
        counters = solve(room(), accuracy=0.02, cache=False).counters
        halved[left_out] = counters["unknowns_checked"]
    assert halved[0.0] > halved[0.2] > halved[1.0] > 0


def test_large_patches_are_cut_among_many(monkeypatch):
    """A hall of more patches than there may be elements: its walls are cut all the same."""
    monkeypatch.setattr(budget, "MAX_ELEMENTS", 100)
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    boxes = [
        Body(PatchSet.box((0.1,) * 3, center=(x, y, -1))) for x in (-1, 0, 1) for y in range(-2, 3)
    ]
    boxes += [Body(PatchSet.box((0.1,) * 3, center=(x, 0.5, 0.5))) for x in (-1, -0.5, 0, 0.5, 1)]
    data = scene(setup(walls, *boxes))
    found = budget.Budget.of(data, 0.02)
    assert len(data.patches) == 126
    assert len(data.patches) < found.elements <= budget.PER_PATCH * 126
    assert (found.divisions[:6] > 1).any() and (found.divisions[6:] == 1).all()
