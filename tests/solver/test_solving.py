"""Ways to solve for interreflection that must agree: iterated, taken apart, turned about."""

from __future__ import annotations

import numpy as np
import pytest
from patchlight.solver import radiosity
from patchlight.solver.errors import ConvergenceError, NumericsError
from patchlight.solver.exchange import products, transposed_products
from patchlight.solver.factorised import Factorised
from patchlight.solver.krylov import MAX_ITERATIONS, solve_all
from patchlight.solver.packed import PackedMatrix
from patchlight.solver.radiosity import RadiositySystem, check_absorbs
from patchlight.solver.spectral import radius_bound

N = 120


def closed(n=N, seed=1):
    """Factors of a closed scene: rows sum to 1, and some elements see little of each other."""
    rng = np.random.default_rng(seed)
    out = rng.random((n, n)) ** 6
    np.fill_diagonal(out, 0.0)
    return out / out.sum(axis=1, keepdims=True)


def lights(count, n=N, bands=1, seed=2):
    rng = np.random.default_rng(seed)
    return {f"light {k}": rng.random((n, bands)) * 10.0**-k for k in range(count)}


def exactly(factors, rho, direct):
    """Reflected exitance (n, b) by NumPy, band by band."""
    out = [
        np.linalg.solve(np.eye(len(factors)) - rho[:, [b]] * factors, rho[:, b] * direct[:, b])
        for b in range(rho.shape[1])
    ]
    return np.stack(out, axis=1)


@pytest.mark.parametrize("bands", [1, 3])
def test_all_groups_and_bands_are_solved_together(bands):
    factors, rho = closed(), np.random.default_rng(3).uniform(0.1, 0.9, (N, bands))
    system = RadiositySystem(factors, rho)
    direct = lights(3, bands=bands)
    found = system.solve(direct)
    for name, light in direct.items():
        # Residuals of 1e-9 of the source come back 1 / (1 − ρ) times at most.
        np.testing.assert_allclose(found[name], exactly(factors, rho, light), rtol=2e-8)
    alone = RadiositySystem(factors, rho)
    alone.solve({"light 0": direct["light 0"][:, :]})
    # One pass over the matrix serves them all.
    assert system.products <= alone.products + 2


def test_groups_superpose():
    factors, rho = closed(), np.full((N, 1), 0.7)
    direct = lights(4)
    apart = RadiositySystem(factors, rho).solve(direct)
    whole = RadiositySystem(factors, rho).solve({"all": sum(direct.values())})
    np.testing.assert_allclose(sum(apart.values()), whole["all"], rtol=1e-8)


def test_dark_groups_and_black_surfaces_take_no_products():
    system = RadiositySystem(closed(), np.full((N, 1), 0.5))
    found = system.solve({"lit": np.ones((N, 1)), "dark": np.zeros((N, 1))})
    assert not found["dark"].any() and found["lit"].all()
    black = RadiositySystem(closed(), np.zeros((N, 1)))
    assert not black.solve(lights(2))["light 1"].any()
    assert black.products == 0
    assert RadiositySystem(closed(), np.full((N, 1), 0.5)).solve({}) == {}


@pytest.mark.parametrize("rho", [0.3, 0.9, 0.999])
def test_decomposition_agrees_with_iteration(rho):
    factors = closed().astype(np.float32)
    reflectance = np.random.default_rng(4).uniform(0.9 * rho, rho, (N, 1))
    direct = np.random.default_rng(5).random((N, 40))
    found = Factorised(factors, reflectance[:, 0]).solve(direct)
    iterated = RadiositySystem(factors, reflectance).solve(
        {str(k): direct[:, [k]] for k in range(3)}
    )
    for k in range(3):
        np.testing.assert_allclose(found[:, k], iterated[str(k)][:, 0], rtol=1e-7)


def test_a_decomposition_serves_any_light():
    factors, rho = closed(), np.full(N, 0.6)
    kept = Factorised(factors, rho)
    for seed in (1, 2):
        light = np.random.default_rng(seed).random(N)
        expected = exactly(factors, rho[:, None], light[:, None])[:, 0]
        np.testing.assert_allclose(kept.solve(light), expected, rtol=1e-8)
    assert not kept.solve(np.zeros(N)).any()


def test_many_lights_are_decomposed_few_are_not(monkeypatch):
    factors = closed().astype(np.float32)
    reflectance = np.repeat(np.random.default_rng(6).uniform(0.2, 0.8, (N, 1)), 3, axis=1)
    reflectance[:, 2] *= 0.5  # two bands of one reflectance, and another
    direct = lights(radiosity.LU_AT_LEAST, bands=3)
    many = RadiositySystem(factors, reflectance)
    found = many.solve(direct)
    assert (many.decomposed, many.products) == (2, 0)
    few = RadiositySystem(factors, reflectance)
    for name in ("light 0", "light 5"):
        expected = few.solve({name: direct[name]})[name]
        np.testing.assert_allclose(found[name], expected, rtol=1e-7)
    assert few.decomposed == 0
    monkeypatch.setattr("patchlight.solver.radiosity.has_room", lambda _: False)
    short = RadiositySystem(factors, reflectance)
    np.testing.assert_allclose(short.solve(direct)["light 5"], found["light 5"], rtol=1e-7)
    assert short.decomposed == 0 and short.products > 0


@pytest.mark.parametrize("packed", [False, True])
def test_importance_is_the_system_turned_about(packed):
    """Σ w ρ E of the direct light is what the receivers gather of the solution."""
    factors = closed().astype(np.float32)
    if packed:
        kept = PackedMatrix(N)
        kept.append(factors)
        factors = kept
    rng = np.random.default_rng(7)
    rho, rows = rng.uniform(0.1, 0.9, (N, 3)), rng.random((4, N)) / N
    direct = lights(2, bands=3)
    system = RadiositySystem(factors, rho)
    system.tolerance = 1e-12
    reflected, weights = system.solve(direct), system.importance(rows)
    assert weights.shape == (4, N, 3)
    for name, light in direct.items():
        expected = products(rows, reflected[name])
        turned = np.einsum("snb,nb,nb->sb", weights, rho, light)
        np.testing.assert_allclose(turned, expected, rtol=1e-9)


@pytest.mark.parametrize(("sensors", "sides"), [(2, 5), (5, 2)])
def test_the_cheaper_of_both_ways_is_taken(sensors, sides):
    factors, rng = closed(), np.random.default_rng(8)
    rho, rows = rng.uniform(0.1, 0.9, (N, 1)), rng.random((sensors, N)) / N
    direct = rng.random((N, sides, 1))
    system = RadiositySystem(factors, rho)
    taken = []
    system.importance, turned = (
        lambda *a, **k: taken.append(1) or RadiositySystem.importance(system, *a, **k),
        system.importance,
    )
    found = system.indirect(rows, direct)
    assert bool(taken) == (sensors < sides)
    for k in range(sides):
        expected = rows @ exactly(factors, rho, direct[:, k])
        np.testing.assert_allclose(found[:, k], expected, rtol=1e-7)
    assert turned(rows).shape == (sensors, N, 1)


def test_transposed_products():
    rng = np.random.default_rng(9)
    matrix, values = rng.random((37, 3000)).astype(np.float32), rng.random((37, 2))
    expected = matrix.T.astype(float) @ values
    np.testing.assert_allclose(transposed_products(matrix, values), expected, rtol=1e-13)
    found = transposed_products(matrix, values[:, 0])
    np.testing.assert_allclose(found, expected[:, 0], rtol=1e-13)


def test_columns_are_done_each_when_it_is():
    """Systems of different operators: the identity needs no step, a full one some."""
    rng = np.random.default_rng(10)
    full = np.eye(30) - 0.9 * closed(30)
    right = rng.random((30, 3))
    right[:, 1] = 0.0

    def operate(x, columns):
        return np.stack(
            [x[:, k] if c == 0 else full @ x[:, k] for k, c in enumerate(columns)], axis=1
        )

    solved = solve_all(operate, right, tolerance=1e-12)
    np.testing.assert_allclose(solved.values[:, 0], right[:, 0], rtol=1e-12)
    assert not solved.values[:, 1].any()
    np.testing.assert_allclose(full @ solved.values[:, 2], right[:, 2], rtol=1e-10)


def test_spaces_that_are_used_up_end_the_iteration():
    """Two different eigenvalues: the second direction solves exactly, and there is no third."""
    level = np.where(np.arange(20) < 7, 2.0, 5.0)
    solved = solve_all(lambda x, _: level[:, None] * x, np.ones((20, 1)), tolerance=1e-15)
    np.testing.assert_allclose(solved.values[:, 0], 1.0 / level, rtol=1e-14)
    assert solved.products <= 5


def test_what_does_not_converge_is_named():
    """A cyclic shift moves the light on once a step: nothing is known before it has come round."""
    n = MAX_ITERATIONS + 50
    right = np.zeros((n, 1))
    right[0] = 1.0
    with pytest.raises(
        ConvergenceError, match=f"column 0: residual 1.0e.00 after {MAX_ITERATIONS}"
    ):
        solve_all(
            lambda x, _: np.roll(x, 1, axis=0), right, tolerance=1e-6, names=lambda c: f"column {c}"
        )


@pytest.mark.parametrize("rho", [0.99, 0.999])
def test_closed_scenes_of_high_reflectance(rho):
    """E = E_direct / (1 − ρ) everywhere, by each way."""
    factors, direct = closed().astype(np.float32), np.ones((N, 1))
    # Rows of single precision sum to 1 within 1e-7, which comes back ρ / (1 − ρ) times.
    wanted = {"rtol": 2e-7 / (1 - rho)}
    system = RadiositySystem(factors, np.full((N, 1), rho))
    assert system.radius == pytest.approx(rho, rel=1e-6)
    np.testing.assert_allclose(system.solve({"a": direct})["a"], rho / (1 - rho), **wanted)
    apart = Factorised(factors, np.full(N, rho)).solve(direct)
    np.testing.assert_allclose(apart, rho / (1 - rho), **wanted)
    found = system.indirect(factors[:1], np.repeat(direct[:, None], 2, axis=1))
    np.testing.assert_allclose(found, rho / (1 - rho), **wanted)


def test_radius_is_bounded_from_above_and_closely():
    """Two pairs of plates that send light to and fro: √(ab) of each."""
    pair = np.array([[0.0, 1.3, 0, 0], [0.5, 0.0, 0, 0], [0, 0, 0.0, 1.1], [0, 0, 0.7, 0.0]])
    exact = np.sqrt(0.77)
    found = radius_bound(lambda x: pair @ x, 4)
    assert exact <= found < 1.0 - 1e-6  # no closer than it takes
    # A bound is enough where rows sum to less than 1.
    count = []
    radius_bound(lambda x: count.append(1) or 0.5 * x, 3)
    assert len(count) == 1


def test_white_surfaces_that_see_out_by_others_are_solved():
    """A row that sums to more than 1 by its error is no reason to refuse an open scene."""
    factors = closed()
    factors[0] *= 1.01
    factors[1] *= 0.2
    system = RadiositySystem(factors, np.ones((N, 1)))
    assert system.radius < 1.0
    light = lights(1)
    found = system.solve(light)["light 0"]
    np.testing.assert_allclose(
        found, exactly(factors, np.ones((N, 1)), light["light 0"]), rtol=1e-6
    )


def test_a_white_cavity_beside_a_grey_one_is_refused():
    factors = np.zeros((2 * N, 2 * N))
    factors[:N, :N], factors[N:, N:] = closed(), closed()
    rho = np.repeat([[0.5], [1.0]], N, axis=0)
    with pytest.raises(NumericsError, match="never absorbed .spectral radius 1.0000"):
        check_absorbs(factors, rho)
    assert check_absorbs(factors[:N, :N], rho[:N]) == pytest.approx(0.5)


def test_each_band_is_judged_by_itself():
    """Red is white here, green there: in no band is there nothing that absorbs."""
    rho = np.ones((N, 2))
    rho[::2, 0] = rho[1::2, 1] = 0.5
    assert check_absorbs(closed(), rho) < 1.0
