"""Scenes in which nothing reflects: what is not needed is skipped, and no number changes."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.model import CIESky, Ground, PatchSet, Sun
from patchlight.solver.model.result import luminous
from patchlight.solver.model.views import Camera
from patchlight.solver.simulation import Options, Simulation, kind_of, solve
from patchlight.solver.skipped import FOR_REFLECTED, reflects_nothing
from patchlight.solver.stages import Stages
from patchlight.solver.surfaces import Receivers
from patchlight.solver.unreflected import UnreflectedSimulation

from .fixtures_light import Body, ceiling, grid, rectangle, scene, setup

HEIGHT, HOLE = 2.7, (1.4, 2.6, 2.4, 3.6)
AT = np.array([(x, y, 0.8) for x in (0.4, 1.7, 3.1) for y in (0.5, 2.9, 5.2)])
CLEAR = CIESky(12, sun_altitude_deg=50.0, sun_azimuth_deg=130.0, diffuse_illuminance_lx=20_000.0)
SUN = Sun(50.0, 130.0, normal_illuminance_lx=60_000.0)


def room(rho=0.0, **more):
    """A room 4 x 6 x 2.7 m of black sheets, open in the roof."""
    x0, x1, y0, y1 = HOLE
    walls = (
        rectangle((0, 0, 0), (4, 0, 0), (4, 6, 0), (0, 6, 0)),
        rectangle((0, 0, 0), (0, 0, HEIGHT), (4, 0, HEIGHT), (4, 0, 0)),
        rectangle((0, 6, 0), (4, 6, 0), (4, 6, HEIGHT), (0, 6, HEIGHT)),
        rectangle((0, 0, 0), (0, 6, 0), (0, 6, HEIGHT), (0, 0, HEIGHT)),
        rectangle((4, 0, 0), (4, 0, HEIGHT), (4, 6, HEIGHT), (4, 6, 0)),
    )
    roof = (
        ceiling(0, x0, 0, 6, HEIGHT),
        ceiling(x1, 4, 0, 6, HEIGHT),
        ceiling(x0, x1, 0, y0, HEIGHT),
        ceiling(x0, x1, y1, 6, HEIGHT),
    )
    more = {"sky": CIESky(5, zenith_luminance_cd_m2=1.0), "sensors": [grid("plane", AT)], **more}
    return scene(setup(*walls, *roof), rho=rho, **more)


def ball(**more):
    """A black ball over a plate, under a clear sky with its sun, and the ground about it."""
    plate = rectangle((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))
    parts = setup(plate, Body(PatchSet.sphere((0.2, 0.1, 1.2), 0.6)))
    points = np.array([(x, y, 0.01) for x in (-1.7, -0.6, 0.4, 1.1) for y in (-0.9, 0.3, 1.3)])
    more = {
        "sky": CLEAR,
        "sun": SUN,
        "ground": Ground(0.2),
        "sensors": [grid("low", points)],
        **more,
    }
    return scene(parts, rho=0.0, **more)


def whole(data, accuracy):
    """The same by a simulation that looks for all that might be reflected."""
    return Simulation(data, accuracy, "auto", Stages(), Options()).run()


def test_light_through_a_roof_is_that_of_the_opening():
    """An even sky through a rectangle overhead: four corners of Howell's B-4."""
    x0, x1, y0, y1 = HOLE

    def corner(a, b):
        a, b = a / (HEIGHT - 0.8), b / (HEIGHT - 0.8)
        one, two = np.hypot(1.0, a), np.hypot(1.0, b)
        return (a / one * np.arctan(b / one) + b / two * np.arctan(a / two)) / 2.0

    x, y = AT[:, 0], AT[:, 1]
    expected = sum(
        sign * corner(px - x, py - y)
        for sign, px, py in ((1, x1, y1), (-1, x0, y1), (-1, x1, y0), (1, x0, y0))
    )
    found = solve(room(), accuracy=0.1).sensors["plane"].illuminance_lx
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("data", [room(), room(sky=CLEAR, sun=SUN), ball()])
def test_numbers_are_those_of_a_whole_simulation(data):
    found, expected = solve(data, accuracy=0.1), whole(data, 0.1)
    for name, sensors in expected.sensors.items():
        own = found.sensors[name]
        np.testing.assert_allclose(own.illuminance_lx, sensors.illuminance_lx, rtol=1e-12)
        np.testing.assert_allclose(own.error_lx, sensors.error_lx, rtol=1e-9)
        assert set(own.components) == set(sensors.components)
    assert set(found.components) == set(expected.components) and found.converged
    assert found.balance.residual_fraction == pytest.approx(0.0, abs=1e-12)
    # Each element by its own error, and all of them together far better.
    light = [luminous(sum(r.components.values())) @ r.elements.areas for r in (found, expected)]
    assert light[0] == pytest.approx(light[1], rel=0.02)
    assert found.balance.entered_lm == pytest.approx(light[0], rel=1e-9)
    assert found.balance.absorbed_by_material == {"material 0": pytest.approx(light[0])}


def test_nothing_is_exchanged_and_why_is_said():
    found = solve(room(), accuracy=0.1)
    for name in FOR_REFLECTED:
        assert found.skipped[name] == "no surface reflects or emits light"
        assert name not in found.stages
    assert not any(name.startswith("pairs") for name in found.counters)
    assert found.row_sums.shape == (len(found.elements),) and np.isnan(found.row_sums).all()
    assert not found.exitance.any() and found.counters["unknowns"] >= 4 * len(found.elements)


@pytest.mark.parametrize(
    "data, accuracy, order, every",
    [
        (room(), 0.1, 12, 1),
        (room(sky=CLEAR), 0.02, 12, 2),
        (ball(sun=None), 0.1, 4, 4),
        (room(sky=None, sun=SUN), 0.1, 12, 1),
        (ball(sky=None, ground=None), 0.02, 12, 1),
    ],
)
def test_errors_of_elements_hold(data, accuracy, order, every):
    """Against 144 nodes an element instead of four, or 16, at 95 % of the elements."""
    found = solve(data, accuracy=accuracy)
    run = Simulation(data, accuracy, "auto", Stages(), Options())
    solver, _ = run.start()
    some = np.arange(0, len(found.elements), every)
    fine = Receivers.with_nodes(found.elements, some, order)
    expected = luminous(sum(solver.outside(fine, run.budget).direct.values()))
    off = np.abs(luminous(sum(found.components.values()))[some] - expected)
    rounding = 1e-6 * expected.max()  # of those that hardly see any light
    assert (off <= found.element_error_lx[some] + rounding).mean() >= 0.95
    assert np.average(found.element_error_lx[some]) < 0.1 * np.average(expected)


def test_what_needs_form_factors_gets_them():
    """Reflecting or shining surfaces, pictures, and many surfaces under a sky."""
    dark = room()
    assert kind_of(dark, "default") is UnreflectedSimulation
    assert reflects_nothing(dataclasses.replace(dark, sky=None))
    camera = Camera((1.0, 1.0, 1.5), (3.0, 3.0, 1.0), name="view", size=(8, 6))
    lamp = scene(setup(ceiling(0, 1, 0, 1, 2)), rho=0.0, lamps=[(0, "lamp", 100.0)])
    rows = [rectangle((k, 0, 0), (k + 0.5, 0, 0), (k + 0.5, 1, 0), (k, 1, 0)) for k in range(101)]
    many = scene(setup(*rows), rho=0.0, sun=SUN)
    for data in (
        room(0.001), dataclasses.replace(dark, cameras=(camera,)), lamp,
        dataclasses.replace(many, sky=CLEAR),
    ):  # fmt: skip
        assert not reflects_nothing(data)
        assert kind_of(data, "default") is Simulation
    assert reflects_nothing(many)  # of the sun each point knows for itself
