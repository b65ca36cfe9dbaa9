"""Phong's lobe: closed forms under cones of light, convergence, hiding, balance of energy."""

import math

import numpy as np
import pytest
from patchlight.solver import specular_radiance
from patchlight.solver.errors import InputError
from patchlight.solver.model import PatchSet

UP = (0.0, 0.0, 1.0)


def cone(half_angle, height=2.0, axis=UP):
    """A disc that fills the cone of directions about an axis, seen from the origin."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return PatchSet.disk(height * axis, height * math.tan(half_angle), -axis)


@pytest.mark.parametrize("exponent", [1.0, 10.0, 50.0, 1000.0])
@pytest.mark.parametrize("half_angle", [0.01, 0.2, 0.7])
def test_cone_about_the_mirrored_view(exponent, half_angle):
    # ∫ cosⁿα dω = 2π (1 − cosⁿ⁺¹a) / (n + 1); at normal incidence cosθ adds one power.
    how = {"specular": 0.3, "exponent": exponent, "accuracy": 1e-7}
    c = math.cos(half_angle)
    at = (np.zeros((1, 3)), UP, UP, cone(half_angle), 5.0)
    exact = 5.0 * 0.3 * (1.0 - c ** (exponent + 1.0))
    assert specular_radiance(*at, method="nn93", **how)[0] == pytest.approx(exact, rel=2e-6)
    exact = 5.0 * 0.3 * (1.0 - c ** (exponent + 2.0))
    assert specular_radiance(*at, **how)[0] == pytest.approx(exact, rel=2e-6)


@pytest.mark.parametrize("method", ["default", "nn93"])
def test_cone_about_an_oblique_view(method):
    # The cone stays above the horizon: cosθ = cosα cosθ0 + … whose rest cancels about the axis.
    tilt, a, n = 0.8, 0.3, 40.0
    axis = (math.sin(tilt), 0.0, math.cos(tilt))
    view = (-math.sin(tilt), 0.0, math.cos(tilt))
    found = specular_radiance(
        np.zeros((1, 3)), UP, view, cone(a, axis=axis), 1.0,
        exponent=n, accuracy=1e-7, method=method,
    )  # fmt: skip
    c = math.cos(a)
    exact = (1.0 - c ** (n + 2.0)) * math.cos(tilt) if method == "default" else 1.0 - c ** (n + 1.0)
    assert found[0] == pytest.approx(exact, rel=2e-6)


def test_errors_fall_with_the_accuracy():
    rng = np.random.default_rng(5)
    points = rng.uniform(-0.5, 0.5, (20, 3)) * (1, 1, 0)
    views = rng.uniform(-1, 1, (20, 3)) + (0, 0, 2)
    lamp = PatchSet.torus((0.3, 0.2, 1.5), (0.2, 0.1, 1.0), 0.5, 0.1)
    how = {"exponent": 30.0}
    exact = specular_radiance(points, UP, views, lamp, 1.0, accuracy=1e-6, **how)
    scale = exact.max()
    errors = [
        np.abs(specular_radiance(points, UP, views, lamp, 1.0, accuracy=eps, **how) - exact).max()
        for eps in (3e-2, 3e-3)
    ]
    assert errors[0] <= 3e-2 * scale and errors[1] <= 3e-3 * scale


def test_half_a_cone_is_hidden():
    # A blocker with its edge through the axis hides half of what is even about it.
    a, n = 0.2, 20.0
    half = PatchSet.from_bilinear([[(0, -9, 1), (9, -9, 1), (9, 9, 1), (0, 9, 1)]])
    found = specular_radiance(
        np.zeros((1, 3)), UP, UP, cone(a), 1.0, exponent=n, blockers=half, accuracy=1e-3
    )
    exact = 0.5 * (1.0 - math.cos(a) ** (n + 2.0))
    # Cells along the edge are quartered seven times: a hundredth of a percent of the disc.
    assert found[0] == pytest.approx(exact, rel=2e-3)


def test_all_directions_together_send_what_comes_in():
    # A hemisphere of luminance 1 at normal incidence: all of it, and less at grazing angles.
    dome = PatchSet.sphere((0, 0, 0), 3.0, inward=True)
    angles = np.radians([0.0, 30.0, 60.0, 85.0])
    views = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    found = specular_radiance(np.zeros((4, 3)), UP, views, dome, 1.0, exponent=20, accuracy=1e-5)
    assert found[0] == pytest.approx(1.0, abs=2e-4)
    assert (np.diff(found) < 0.0).all() and found[3] < 0.7
    # Without the receiver's cosine nothing is lost but what is below the horizon.
    nn93 = specular_radiance(
        np.zeros((4, 3)), UP, views, dome, 1.0, exponent=20, accuracy=1e-5, method="nn93"
    )
    assert (nn93 <= 1.0 + 1e-4).all() and nn93[3] > found[3]


@pytest.mark.parametrize(
    "bad",
    [
        {"exponent": 0.5},
        {"specular": 1.5},
        {"method": "phong"},
        {"accuracy": 0.0},
        {"luminance": [1.0, 2.0, 3.0]},
        {"views": (0.0, 0.0, 0.0)},
    ],
)
def test_wrong_values_are_named(bad):
    how = {"luminance": 1.0, "views": UP} | bad
    with pytest.raises(InputError, match=next(iter(bad))):
        specular_radiance(np.zeros((1, 3)), UP, how.pop("views"), cone(0.2), **how)


@pytest.mark.parametrize("bands", [1, 3, 20])
def test_blocks_of_highlights_have_whole_parents_and_are_bounded(bands):
    """What is kept of a block is by points, groups and bands; a parent's quarters are together."""
    from types import SimpleNamespace

    from patchlight.solver import glossy_sensors as g

    groups = ["a", "b", "c", "d", "e", "f", "g"]
    own = SimpleNamespace(second=SimpleNamespace(groups=groups, bands=bands))
    parents = np.repeat(np.arange(20_000), np.random.default_rng(1).integers(1, 145, 20_000))
    end = 0
    for rows in g.SensorLobes._blocks(own, parents):
        assert rows[0] == end and (np.diff(rows) == 1).all()
        assert end == 0 or parents[end] != parents[end - 1]
        assert (len(rows) - 144) * 4 * len(groups) * bands <= g._VALUES
        end = rows[-1] + 1
    assert end == len(parents)
    assert not list(g.SensorLobes._blocks(own, parents[:0]))
