"""Interreflection: furnaces, two-surface enclosures, and what has no solution."""

import numpy as np
import pytest
from patchlight.solver.closure import close_rows, rows_beyond_noise
from patchlight.solver.errors import NumericsError
from patchlight.solver.exchange import Rows
from patchlight.solver.model import PatchSet
from patchlight.solver.radiosity import check_absorbs, solve_radiosity
from patchlight.solver.simulation import solve

from .fixtures_light import Body, ceiling, grid, scene, setup

BOX = Body(PatchSet.box((4, 5, 2.7), inward=True))
SPHERE = Body(PatchSet.sphere((0, 0, 0), 1.0, inward=True))


def furnace(body, rho, exitance=100.0, **more):
    """A closed cavity whose whole wall shines: E / (1 − ρ) everywhere."""
    return scene(setup(body), rho=rho, lamps=[(0, "wall", exitance)], **more)


@pytest.mark.parametrize("body", [BOX, SPHERE], ids=["box", "sphere"])
def test_furnace(body):
    result = solve(furnace(body, 0.5), accuracy=0.05)
    # Row sums of convex cavities are 1 to the accuracy of the contour, 5e-4 of 0.05.
    np.testing.assert_allclose(result.exitance, 200.0, rtol=1e-4)


@pytest.mark.parametrize("rho", [0.2, 0.5, 0.8, 0.95])
def test_sphere_cavity(rho):
    """All points of a sphere see all others alike: the mean is exact for any light in it."""
    result = solve(furnace(SPHERE, rho), accuracy=0.05)
    # 1.5e-4 is asked of unoccluded factors; a row's error comes back ρ / (1 − ρ) times.
    np.testing.assert_allclose(result.row_sums, 1.0, atol=5e-5)
    np.testing.assert_allclose(result.exitance, 100.0 / (1 - rho), rtol=5e-5 * rho / (1 - rho))


@pytest.mark.parametrize("rho", [0.3, 0.9])
def test_sphere_with_one_lit_octant_has_a_uniform_indirect_part(rho):
    """E_indirect = ρ E_direct-mean / (1 − ρ) everywhere, E_direct = M / 8 everywhere."""
    parts = setup(SPHERE)
    parts = type(parts)(parts.patches, parts.closed, np.array([1, 0, 0, 0, 0, 0, 0, 0]))
    result = solve(scene(parts, rho=rho, lamps=[(1, "lamp", 800.0)]), accuracy=0.1)
    direct, indirect = result.components["lamp.direct"], result.components["lamp.indirect"]
    # 3e-3 is asked of form factors here, and a few of the nearest make up the direct light; the
    # indirect light comes by whole rows.
    np.testing.assert_allclose(direct, 100.0, rtol=3e-3)
    np.testing.assert_allclose(indirect, 100.0 * rho / (1 - rho), rtol=1e-4)


def test_coloured_furnace_is_solved_band_by_band():
    rho = (0.8, 0.5, 0.1)
    result = solve(furnace(BOX, rho), accuracy=0.1)
    assert result.exitance.shape[1] == 3
    for band, r in enumerate(rho):
        # Straight edges are exact: what GMRES leaves, 1e-9 of the source, at reflectance 0.8.
        np.testing.assert_allclose(result.exitance[:, band], 100.0 / (1 - r), rtol=1e-7)


def test_two_concentric_spheres():
    """Two-surface enclosure: the outer one shines, F21 = (r1/r2)², both reflect.

    With B1 = ρ1 B2 and B2 = M + ρ2 (F21 B1 + F22 B2), B2 is M / (1 − ρ2 (F21 ρ1 + F22)).
    """
    inner, outer = Body(PatchSet.sphere((0, 0, 0), 0.5)), SPHERE
    f21 = 0.25
    result = solve(
        scene(setup(inner, outer), materials=[0.7, 0.4], lamps=[(1, "lamp", 100.0)]), accuracy=0.1
    )
    b2 = 100.0 / (1 - 0.4 * (f21 * 0.7 + 1 - f21))
    part = result.surfaces["part1"]
    mean = np.average(part.exitance_lm_m2, weights=part.area_m2)
    # Errors of single factors are 1e-2 and more; in means what is left is that of whole rows.
    assert mean == pytest.approx(b2, rel=2e-4)
    part = result.surfaces["part0"]
    assert np.average(part.exitance_lm_m2, weights=part.area_m2) == pytest.approx(
        0.7 * b2, rel=2e-4
    )


def test_direct_and_indirect_add_up():
    lamp = ceiling(-0.5, 0.5, -0.5, 0.5, 1.3)
    sensors = grid("plane", [(0, 0, 0), (1.5, 2.0, -0.5), (-1.2, 0.3, 0.9)])
    result = solve(
        scene(setup(BOX, lamp), rho=0.5, lamps=[(1, "lamp", 3000.0)], sensors=[sensors]),
        accuracy=0.1,
    )
    plane = result.sensors["plane"]
    assert set(plane.components) == {"lamp.direct", "lamp.indirect"}
    np.testing.assert_allclose(sum(plane.components.values()), plane.illuminance_lx, rtol=1e-12)
    total = result.exitance[:, 0]
    lit = result.components["lamp.direct"] + result.components["lamp.indirect"]
    emitted = np.where(result.elements.patch_index == 6, 3000.0, 0.0)
    # GMRES leaves 1e-4 of the accuracy asked for, 1e-5 of the source.
    np.testing.assert_allclose(total, emitted + 0.5 * lit[:, 0], rtol=3e-5)


def test_balance_closes():
    """Reciprocity of the form factors is not built in; its failure is the residual."""
    lamp = ceiling(-0.5, 0.5, -0.5, 0.5, 1.3)
    result = solve(scene(setup(BOX, lamp), lamps=[(1, "lamp", 3000.0)]), accuracy=0.05)
    assert result.balance.emitted_lm == pytest.approx(3000.0, rel=1e-9)
    # More is warned of.
    assert abs(result.balance.residual_fraction) < 1e-3


def test_balance_closes_close_to_a_lamp():
    """0.2 m below the ceiling, where equal elements make 3 % of the flux out of nothing.

    What is left, a tenth of the accuracy, is warned of and counts in the errors.
    """
    lamp = Body(PatchSet.box((1.2, 0.6, 0.1), center=(0, 0, 1.05)))
    result = solve(scene(setup(BOX, lamp), lamps=[(1, "lamp", 1000.0)]), accuracy=0.03)
    assert abs(result.balance.residual_fraction) < 4e-3


def test_nothing_absorbs():
    with pytest.raises(NumericsError, match="no surface absorbs"):
        solve(furnace(BOX, 1.0), accuracy=0.2)


def test_open_scenes_may_reflect_everything():
    plate = ceiling(-1, 1, -1, 1, 2.0)
    floor = ceiling(-1, 1, -1, 1, 0.0).flipped()
    result = solve(scene(setup(plate, floor), rho=1.0, lamps=[(0, "lamp", 100.0)]), accuracy=0.2)
    assert np.isfinite(result.exitance).all()
    # Nothing is absorbed: all that was emitted, but for what the last gather leaves.
    assert result.balance.escaped_lm == pytest.approx(400.0, rel=1e-4)


def test_disconnected_rooms_do_not_touch():
    rooms = [Body(PatchSet.box((2, 2, 2), center=(x, 0, 0), inward=True)) for x in (-3.0, 3.0)]
    result = solve(
        scene(setup(*rooms), materials=[0.5, 0.8], lamps=[(0, "left", 100.0), (1, "right", 10.0)]),
        accuracy=0.2,
    )
    # Furnaces: what closing the rows leaves, measured 3e-5.
    np.testing.assert_allclose(result.surfaces["part0"].exitance_lm_m2, 200.0, rtol=1e-4)
    np.testing.assert_allclose(result.surfaces["part1"].exitance_lm_m2, 50.0, rtol=1e-4)


def test_system_by_hand():
    """Two plates that see half of each other: B1 = ρ E + ρ B2 / 2 and so on."""
    factors = np.array([[0.0, 0.5], [0.5, 0.0]])
    rho = np.array([[0.6], [0.2]])
    out, products = solve_radiosity(factors, rho, {"a": np.array([[10.0], [0.0]])})
    b1 = 6.0 / (1 - 0.25 * 0.12)
    np.testing.assert_allclose(out["a"][:, 0], [b1, 0.1 * b1], rtol=1e-9)
    assert products > 0


def test_black_receivers_need_no_products():
    out, products = solve_radiosity(np.ones((3, 3)) / 3, np.zeros((3, 1)), {"a": np.ones((3, 1))})
    assert products == 0
    assert not out["a"].any()


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.99, 0.999])
def test_closed_matrix(rho):
    factors = np.full((50, 50), 1 / 50)
    out, _ = solve_radiosity(factors, np.full((50, 1), rho), {"a": np.ones((50, 1))})
    # GMRES leaves 1e-9 of the source, which comes back 1 / (1 − ρ) times.
    np.testing.assert_allclose(out["a"], rho / (1 - rho), rtol=1e-9 / (1 - rho))


def test_share_sent_on():
    factors = np.array([[0.2, 0.7], [0.4, 0.5]])
    assert check_absorbs(factors, np.array([[0.5], [0.9]])) == pytest.approx(0.81)
    with pytest.raises(NumericsError, match="reflectance 1 everywhere"):
        check_absorbs(np.array([[0.5, 0.5], [0.5, 0.5]]), np.ones((2, 1)))


def test_cavity_at_high_reflectance_keeps_its_digits():
    """ρ = 0.99 amplifies a row's error by 99; rows are right to 2e-5 on average."""
    result = solve(furnace(SPHERE, 0.99), accuracy=0.02)
    np.testing.assert_allclose(result.row_sums, 1.0, atol=2e-4)
    assert np.average(result.exitance[:, 0]) == pytest.approx(1e4, rel=5e-3)
    assert abs(result.balance.escaped_lm) <= 5e-3 * result.balance.emitted_lm


@pytest.mark.slow
def test_sphere_cavity_to_its_goal():
    """Within 1e-4 at any reflectance up to 0.99."""
    result = solve(furnace(SPHERE, 0.99), accuracy=0.01)
    np.testing.assert_allclose(result.exitance, 1e4, rtol=1e-4)


def test_closed_rows_sum_to_their_totals():
    """The sampled factors take the defect in proportion to their variance; others stay."""
    factors = np.array([[0.5, 0.3, 0.19], [0.5, 0.3, 0.1], [0.0, 0.0, 0.0]])
    variances = np.array([[0.0, 3e-5, 1e-5], [0.0, 1e-8, 1e-8], [0.0, 0.0, 0.0]], np.float32)
    rows = Rows(factors, variances, {}, np.zeros((3, 5)))
    assert list(rows_beyond_noise(rows, 1.0, eps=0.0)) == [1]
    assert close_rows(rows, 1.0) == 2
    np.testing.assert_allclose(rows.factors[0], [0.5, 0.3075, 0.1925], rtol=1e-6)
    # Conditioning on the sum leaves σ² (1 − σ²/Σσ²).
    np.testing.assert_allclose(rows.variances[0], [0.0, 7.5e-6, 7.5e-6], rtol=1e-6)
    # Ten percent missing at a deviation of 1e-4: the deviations were wrong, and are raised.
    np.testing.assert_allclose(rows.factors[1], [0.5, 0.35, 0.15], rtol=1e-6)
    np.testing.assert_allclose(rows.variances[1].sum(), 0.5 * (0.1 / 4.0) ** 2, rtol=1e-6)
    assert (rows.factors[2] == 0.0).all()  # what gets no light has no total


def test_what_is_not_sampled_is_not_sure_either():
    """A defect of exact factors stays visible as their deviation."""
    rows = Rows(np.array([[0.4, 0.3]]), np.zeros((1, 2), np.float32), {}, np.zeros((1, 5)))
    close_rows(rows, 1.0, eps=1e-6)
    np.testing.assert_allclose(rows.factors.sum(), 1.0, rtol=1e-12)
    assert np.sqrt(rows.variances.max()) == pytest.approx(0.25 * 0.3 * 0.48, rel=1e-6)


def test_totals_that_are_sampled_take_their_share():
    """Half of the defect belongs to a total of the same variance."""
    rows = Rows(np.array([[0.5, 0.39]]), np.array([[0.0, 1e-4]], np.float32), {}, np.zeros((1, 5)))
    close_rows(rows, np.array([0.9]), spread=np.array([1e-4]))
    np.testing.assert_allclose(rows.factors, [[0.5, 0.395]], rtol=1e-6)
    assert rows.variances[0, 1] == pytest.approx(0.5e-4, rel=1e-5)


def test_closing_never_makes_a_factor_negative():
    """What is too small to take its share leaves it to the others."""
    variances = np.array([[1e-3, 1e-3, 0.0]], np.float32)
    rows = Rows(np.array([[0.001, 0.5, 0.6]]), variances, {}, np.zeros((1, 5)))
    close_rows(rows, 1.0)
    np.testing.assert_allclose(rows.factors, [[0.0, 0.4, 0.6]], atol=1e-12)


def test_closing_counts_sky_and_ground_among_the_elements():
    """The light of the sky changes as its form factor does."""
    outside = np.array([[50.0, 0.05, 0.04, 1.0, 1e-6]])  # 1000 cd/m², deviations 1e-3
    variances = np.array([[0.0, 1e-6]], np.float32)
    rows = Rows(np.array([[0.5, 0.405]]), variances, {}, outside)
    close_rows(rows, 1.0, outside=True)
    third = 0.005 / 3.0
    np.testing.assert_allclose(rows.factors, [[0.5, 0.405 + third]], rtol=1e-6)
    np.testing.assert_allclose(rows.outside[0, 1:3], [0.05 + third, 0.04 + third], rtol=1e-6)
    assert rows.outside[0, 0] == pytest.approx(1000.0 * (0.05 + third), rel=1e-6)
    assert rows.outside[0, 4] == pytest.approx(1e-6 * 2.0 / 3.0, rel=1e-6)


def test_what_cannot_be_halved_is_left_unseen():
    """Half of the floor lies under blocks that bury some nodes of most of its elements."""
    from patchlight.solver.budget import Budget
    from patchlight.solver.field import FieldSolver
    from patchlight.solver.iterated import _chosen
    from patchlight.solver.mesh import Boxes
    from patchlight.solver.stages import Stages

    lamp = ceiling(-0.5, 0.5, -0.5, 0.5, 1.3)
    found = []
    for size in (0.0, 1.9):
        block = [Body(PatchSet.box((size, 1.1, 0.4), center=(0.2, 0.1, -1.3)))] if size else []
        parts = setup(BOX, lamp, *block)
        data = scene(parts, lamps=[(1, "lamp", 3000.0)])
        solver = FieldSolver(data, parts.blockers, trace=True, stages=Stages())
        budget = Budget.of(data, 0.3)
        field = solver.solve(budget, Boxes.regular(budget.divisions, data.two_sided))
        whole = field.unknowns.can_halve(field.surfaces.elements)
        count = budget.gathered(len(field.unknowns)), budget.left_out
        chosen, unseen = _chosen(field, np.ones(len(whole)), count)
        assert set(chosen) <= set(np.flatnonzero(whole))
        found.append((whole.all(), unseen))
    (clear, nothing), (covered, some) = found
    assert clear and nothing == pytest.approx(0.0, abs=1e-12)
    assert not covered and 0.01 < some < 1.0
