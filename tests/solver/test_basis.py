"""Light that varies biquadratically over elements: moments, halves, and what it is worth."""

import numpy as np
import pytest
from patchlight.solver import budget
from patchlight.solver.budget import Budget
from patchlight.solver.errors import InputError
from patchlight.solver.exchange import make_sources
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet
from patchlight.solver.model.bezier import gauss_rule
from patchlight.solver.simulation import solve
from patchlight.solver.surfaces import Receivers
from patchlight.solver.unknowns import Unknowns, composite

from .fixtures_light import Body, area_rule, ceiling, grid, rows, scene, setup

BOX = Body(PatchSet.box((2, 3, 2.5), inward=True))


def biquadratic(u, v):
    return 1.0 + 2.0 * u - 0.7 * u**2 + u * v - 0.5 * u**2 * v**2 + 0.3 * v**2


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.15, 0.5, 4.0])
def test_moments_of_a_lamp_that_shines_biquadratically(height):
    """Against a Gauss rule of 60 x 60 points: exact to 1e-9 from a seventh of the side away."""
    patch = ceiling(0.0, 1.0, 0.0, 1.0, height)
    point, normal = np.array([0.3, -0.2, 0.0]), np.array([0.0, 0.0, 1.0])
    elements = make_elements(patch, np.zeros(1, bool), np.ones((1, 2), np.int64), nodes=3)
    unknowns = Unknowns.of(elements, "biquadratic")
    found = rows(setup(patch), point, normal, trace=False)
    receivers = Receivers.of_points(point[None], normal[None], np.ones(1), np.array([-1]))
    sources = make_sources(elements, patch.control_points, np.full(1, 1e-4))
    factors = unknowns.factors(found, receivers, sources, 1e-7)
    assert factors.shape == (1, 9)
    t = gauss_rule(3)[0]
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    at, normals, areas = area_rule(patch, 60)
    s, r = (g.ravel() for g in np.meshgrid(gauss_rule(60)[0], gauss_rule(60)[0], indexing="ij"))
    to = at - point
    r2 = (to**2).sum(axis=1)
    kernel = (to @ normal) * -(to * normals).sum(axis=1) / (np.pi * r2**2) * areas
    # The rule for near elements is made for an error of 1e-7 of smooth kernels; measured 1e-6.
    assert float(factors[0] @ biquadratic(u, v)) == pytest.approx(
        float(kernel @ biquadratic(s, r)), rel=1e-5
    )


def test_halves_know_what_is_biquadratic():
    elements = make_elements(BOX.patches, np.zeros(6, bool), np.ones((6, 2), np.int64), nodes=3)
    unknowns = Unknowns.of(elements, "biquadratic")
    assert len(unknowns) == 54 and unknowns.halves_of == 36
    t, fine = gauss_rule(3)[0], composite(3, 2)[0]
    coarse, wanted = (
        biquadratic(*(g.ravel() for g in np.meshgrid(n, n, indexing="ij"))) for n in (t, fine)
    )
    np.testing.assert_allclose(unknowns.between_halves() @ coarse, wanted, atol=1e-12)


def test_fewer_elements_may_have_more_nodes(monkeypatch):
    given = scene(setup(BOX))
    assert Budget.of(given, 0.1, "biquadratic").basis == "biquadratic"
    few = Budget.of(given, 0.1).elements
    monkeypatch.setattr(budget, "VARYING_ELEMENTS", 2 * few)
    assert Budget.of(given, 0.1, "bilinear").basis == "bilinear"
    assert Budget.of(given, 0.1, "biquadratic").basis == "bilinear"
    monkeypatch.setattr(budget, "VARYING_ELEMENTS", few - 1)
    assert Budget.of(given, 0.1, "biquadratic").basis == "bilinear"  # of which many are packed


def test_a_basis_that_does_not_exist():
    with pytest.raises(InputError, match="basis = 'cubic': constant, bilinear, biquadratic"):
        solve(scene(setup(BOX)), basis="cubic")
    with pytest.raises(InputError, match="balanced_mesh = 'yes': True or False"):
        solve(scene(setup(BOX)), balanced_mesh="yes")


@pytest.mark.parametrize("basis", ["constant", "bilinear", "biquadratic"])
def test_a_furnace_is_even(basis):
    """M / (1 − ρ) everywhere: constants are in every basis, and rows add up to 1."""
    given = scene(setup(BOX), lamps=[(0, "walls", 100.0)])
    result = solve(given, accuracy=0.2, basis=basis)
    assert result.settings["basis"] == basis
    np.testing.assert_allclose(result.illuminance_lx, 200.0, rtol=1e-6)


def test_biquadratic_light_is_better_close_to_edges():
    """3 cm from the edges of a room below a ceiling that shines, on one mesh: half the error."""
    floor = PatchSet.box((4, 4, 3), inward=True)
    top = int(np.argmax(floor.evaluate(0.5, 0.5)[:, 2]))
    walls = Body(floor.take([p for p in range(6) if p != top]))
    lamp = Body(floor.take([top]))
    points = [(1.97, y, z) for y in (0.0, 1.0, 1.97) for z in (-1.47, -0.5)]
    near = grid("edges", np.array(points) - [0.001, 0, 0], (-1.0, 0.0, 0.0))
    given = scene(setup(walls, lamp), rho=0.7, lamps=[(1, "top", 100.0)], sensors=[near])

    def found(accuracy, basis):
        return solve(given, accuracy=accuracy, basis=basis).sensors["edges"].illuminance_lx

    truth = found(0.005, "biquadratic")
    off = [np.abs(found(0.2, b) / truth - 1).max() for b in ("bilinear", "biquadratic")]
    assert off[1] < 0.5 * off[0] < 0.05
