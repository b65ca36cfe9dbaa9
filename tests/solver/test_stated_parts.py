"""What stated errors are made of: rules for unoccluded factors, and the mesh."""

from types import SimpleNamespace

import numpy as np
import pytest
from patchlight.solver import PatchSet, rule_error
from patchlight.solver.budget import FAR, FAR_OF_MANY
from patchlight.solver.exchange import form_factor_matrix, make_sources
from patchlight.solver.mesh import make_elements
from patchlight.solver.mesh_error import NEAR, OF_VARIED, doubt_at
from patchlight.solver.simulation import solve
from patchlight.solver.some_sources import some_sources

from .fixtures_light import Body, ceiling, grid, scene, setup

SQUARE = PatchSet.from_bilinear(np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], float))


def doubt(height, factor, *, change=0.0, moved=0.0, spread=0.0, far=FAR):
    """Doubt of a point over the middle of a square metre."""
    elements = make_elements(SQUARE, np.zeros(1, bool), np.ones((1, 2), np.int64))
    still = np.zeros(1)
    finer = SimpleNamespace(moved=np.array([moved]), spread=np.array([spread]), sampled_sent=still)
    points, factors = np.array([[0.5, 0.5, height]]), np.array([[factor]])
    return float(doubt_at(points, factors, elements, finer, np.array([change]), far)[0])


@pytest.mark.parametrize("far", [FAR, FAR_OF_MANY])
def test_change_counts_more_next_to_elements(far):
    assert doubt(100.0, 1e-4, change=-3.0, far=far) == pytest.approx(3.0 * far, rel=1e-6)
    # An element that fills half of what is seen, and is near.
    assert doubt(1e-3, 0.5, change=-3.0, far=far) == pytest.approx(3.0 * NEAR)
    # At one width of it n = (1/4)², and ν = 2 F n.
    between = far + (NEAR - far) * 2.0 * 0.2 / 16.0
    assert doubt(1.0, 0.2, change=3.0, far=far) == pytest.approx(3.0 * between)


def test_what_is_in_another_place_matters_with_the_square_of_the_distance():
    assert doubt(0.1, 0.4, spread=2.0) == pytest.approx(OF_VARIED * 0.4 * 2.0)
    assert doubt(2.0, 0.1, spread=2.0) == pytest.approx(OF_VARIED * 0.1 * 2.0 / 16.0)
    # Light that is off on all of the element counts wherever that is.
    assert doubt(9.0, 0.1, moved=2.0) == pytest.approx(OF_VARIED * 0.1 * 2.0)


BALL = PatchSet.sphere((0, 0, 2), 0.5)


def beside_a_ball(count=40):
    """Sensors close to a luminous ball, and what they get: closed form R² h / d³."""
    random = np.random.default_rng(4)
    out = random.normal(size=(count, 3))
    out *= (0.5 * (1.0 + 10.0 ** random.uniform(-3.0, 0.3, count)) / np.linalg.norm(out, axis=1))[
        :, None
    ]
    toward = -out / np.linalg.norm(out, axis=1)[:, None]
    points = out + (0.0, 0.0, 2.0)
    exact = 1000.0 * 0.25 / (out**2).sum(axis=1)
    sensors = grid("g", points, toward)
    made = scene(setup(Body(BALL)), lamps=[(0, "lamp", 1000.0)], sensors=[sensors])
    return made, exact


def test_errors_of_rules_are_measured(monkeypatch):
    made, exact = beside_a_ball()
    found = solve(made, accuracy=0.3).sensors["g"]
    off = np.abs(found.illuminance_lx - exact)
    assert (off <= found.error_lx + 1e-9 * exact).mean() >= 0.95, off / found.error_lx
    # The rules alone would be said to leave 6e-4.
    assert np.median(found.error_lx / exact) <= 1e-4
    # Looked at on eight sensors only, the others get what covers 95 % of those.
    monkeypatch.setattr(rule_error, "PAIRS", 1)
    some = solve(made, accuracy=0.3).sensors["g"]
    looked = np.unique(np.linspace(0, len(exact) - 1, rule_error.SENSORS).round().astype(int))
    np.testing.assert_array_equal(some.error_lx[looked], found.error_lx[looked])
    relative = some.error_lx / some.illuminance_lx
    others = np.delete(relative, looked)
    np.testing.assert_allclose(others, np.quantile(relative[looked], 0.95, method="higher"))


def test_rules_that_take_the_same_points_tell_nothing():
    """From afar a ball is summed over as many points at any accuracy."""
    random = np.random.default_rng(9)
    out = random.normal(size=(30, 3))
    out *= (random.uniform(2.0, 10.0, 30) / np.linalg.norm(out, axis=1))[:, None]
    aside = np.cross(out, random.normal(size=(30, 3)))
    # Some see the ball in part, past their horizon.
    tilt = np.arcsin(np.minimum(0.5 / np.linalg.norm(out, axis=1), 1.0)) * random.uniform(-1, 1, 30)
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    toward = -out / np.linalg.norm(out, axis=1)[:, None]
    normals = np.sin(tilt)[:, None] * toward + np.cos(tilt)[:, None] * aside
    sensors = grid("g", out + (0.0, 0.0, 2.0), normals)
    made = scene(setup(Body(BALL)), lamps=[(0, "lamp", 1000.0)], sensors=[sensors])
    found = solve(made, accuracy=0.1).sensors["g"]
    exact = solve(made, accuracy=1e-3).sensors["g"].illuminance_lx
    off = np.abs(found.illuminance_lx - exact)
    assert (off / exact).max() >= 1e-6
    assert (off <= found.error_lx).mean() >= 0.9, off / found.error_lx


def test_what_most_of_the_error_comes_of_is_looked_at_from_everywhere(monkeypatch):
    """Few sensors are near to a bent lamp: what those miss is not what all others do."""
    points = np.random.default_rng(8).uniform((-1.9, -1.4, 0.1), (1.9, 1.4, 1.7), (150, 3))
    lamp = PatchSet.disk((0, 0, 1.8), 0.3, (0, 0, -1))
    made = scene(
        setup(Body(PatchSet.box((4, 3, 2), center=(0, 0, 1), inward=True)), lamp),
        materials=[0.02, 0.0],
        lamps=[(1, "lamp", 1000.0)],
        sensors=[grid("g", points)],
    )
    direct = "lamp.direct"
    exact = solve(made, accuracy=0.01).sensors["g"].components[direct]
    told = solve(made, accuracy=0.3).sensors["g"]
    monkeypatch.setattr(rule_error, "PAIRS_BY_SIGHT", 0)
    usual = solve(made, accuracy=0.3).sensors["g"]
    assert (np.abs(told.components[direct] - exact) <= told.error_lx).mean() >= 0.95
    assert np.median(told.error_lx / usual.error_lx) <= 0.7


def test_some_sources_are_seen_as_among_all():
    elements = make_elements(BALL, np.zeros(8, bool), np.full((8, 2), 2, np.int64))
    count = len(elements)
    sources = make_sources(elements, BALL.control_points, np.full(count, 1e-4))
    which = np.array([0, 3, 4, 9, 21, count - 1])
    points = np.random.default_rng(1).normal(size=(20, 1, 3)) + (0.0, 0.0, 2.0)
    up, ones = np.tile([0.6, 0.0, 0.8], (20, 1, 1)), np.ones((20, 1))
    at = points, up, ones, np.full(20, -1)
    for eps in (1e-3, 1e-6):
        every, some = (
            form_factor_matrix(*at, s, setup(BALL).blockers, eps=eps, trace=False).factors
            for s in (sources, some_sources(sources, which))
        )
        assert every.any()
        np.testing.assert_array_equal(some, every[:, which])


def test_an_open_tube_hides_nothing_of_its_outside():
    """Where it turns away, the parts before it stand for no shadow."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(0.1, 2.0, 6), np.linspace(0.2, 2.0, 7)))
    tube = PatchSet.cylinder((-1.0, 0.0, 2.0), (1.0, 0.0, 2.0), 0.15)
    points = np.column_stack([x, y, np.full(len(x), 1.8)])
    made = scene(setup(Body(tube, False)), lamps=[(0, "lamp", 1000.0)], sensors=[grid("g", points)])
    found, plain = (
        solve(made, accuracy=0.1, visibility=how).sensors["g"].illuminance_lx
        for how in ("auto", "none")
    )
    # Chords of the own outline are cut by each other: 2.5e-4 where they cast shadows.
    np.testing.assert_allclose(found, plain, rtol=1e-5)


def test_straight_edges_leave_no_error():
    """Polygons are integrated in closed form: single precision is what is left."""
    points = np.random.default_rng(5).uniform((-1, -1, 0), (1, 1, 1.5), (20, 3))
    made = scene(
        setup(Body(ceiling(-1.0, 1.0, -1.0, 1.0, 2.0))),
        lamps=[(0, "lamp", 1000.0)],
        sensors=[grid("g", points)],
    )
    found = solve(made, accuracy=0.3).sensors["g"]
    assert (found.error_lx <= 1e-6 * found.illuminance_lx).all()


@pytest.mark.parametrize("furnished", [False, True])
def test_rules_are_measured_on_some_sensors(furnished, monkeypatch):
    """Where nothing hides anything, rows are unoccluded themselves: they are not found again."""
    asked, find = [], rule_error.form_factor_matrix

    def spy(nodes, *args, **how):
        asked.append((len(nodes), how["eps"]))
        return find(nodes, *args, **how)

    monkeypatch.setattr(rule_error, "form_factor_matrix", spy)
    bodies = [Body(PatchSet.box((4, 3, 2), inward=True))]
    if furnished:
        bodies.append(Body(PatchSet.box((1, 1, 1), center=(0, 0, -0.5))))
    points = np.random.default_rng(6).uniform((-1.9, -1.4, 0.1), (1.9, 1.4, 0.9), (200, 3))
    made = scene(setup(*bodies), lamps=[(0, "lamp", 1000.0)], sensors=[grid("g", points)])
    found = solve(made, accuracy=0.3).sensors["g"]
    count = rule_error.MOST_SENSORS
    assert [m for m, _ in asked] == [count] * (2 if furnished else 1)
    assert (found.error_lx > 0.0).all()
