"""What later runs take of the light of lamps with webs."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver import store
from patchlight.solver.model import Material, PatchSet, Photometry, Web
from patchlight.solver.simulation import solve
from patchlight.solver.web_light import WebLight
from patchlight.solver.webs import WebLamp

from .fixtures_light import Body, ceiling, grid, scene, setup

ACCURACY = 0.3
ROOM = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
LAMPS = [ceiling(x - 0.4, x + 0.4, -0.3, 0.3, 2.5) for x in (-0.8, 0.8)]
PLANE = grid("plane", [(x, y, 0.8) for x in (-1.2, 0.1, 1.3) for y in (-1.7, 0.2, 1.8)])


def room(*, rho=0.5, flux=(2000.0, 1800.0), at=(0.9, 1.2, 0.3), sharp=1.0):
    """Two lamps with webs over a seat."""
    seat = Body(PatchSet.box((0.5, 0.5, 0.4), center=at))
    lamps = [(1, "left", flux[0]), (2, "right", flux[1])]
    made = scene(setup(ROOM, *LAMPS, seat), lamps=lamps, sensors=[PLANE])
    gamma = np.arange(0.0, 91.0, 5.0)
    row = np.maximum(np.cos(np.radians(gamma)), 0.0) ** sharp
    web = Web.aimed(Photometry([0.0, 360.0], gamma, [row, row]), (0, 0, -1), (1, 0, 0))
    return dataclasses.replace(
        made,
        luminaires=tuple(dataclasses.replace(lamp, web=web) for lamp in made.luminaires),
        materials=tuple(Material(rho) for _ in made.materials),
    )


@pytest.fixture(autouse=True)
def nothing_kept():
    store.forget()
    yield
    store.forget()


@pytest.fixture
def asked(monkeypatch):
    """Receivers that lamps were looked at from, call by call."""
    calls = []
    for name in ("views", "traced"):
        own = getattr(WebLamp, name)

        def look(self, receivers, *args, own=own, **more):
            calls.append(len(receivers.nodes))
            return own(self, receivers, *args, **more)

        monkeypatch.setattr(WebLamp, name, look)
    return calls


def run(made, **options):
    return solve(made, accuracy=ACCURACY, cache=True, **options)


def direct(result):
    sensors = result.sensors["plane"]
    return np.array([sensors.components[f"{name}.direct"] for name in ("left", "right")])


@pytest.mark.parametrize("changed", [{"rho": 0.3}, {"flux": (900.0, 1800.0)}])
def test_no_lamp_is_looked_at_for_paint_and_dimming(asked, changed):
    run(room())
    asked.clear()
    again = run(room(**changed))
    assert not asked
    fresh = solve(room(**changed), accuracy=ACCURACY)
    # The same light; of a dimmed lamp, by rounding, that share of it.
    assert np.allclose(direct(again), direct(fresh), rtol=1e-13)


def test_grids_of_as_many_sensors_are_kept_apart(asked):
    shelf = grid("shelf", PLANE.points + [0.05, -0.05, 0.3])
    run(dataclasses.replace(room(), sensors=(PLANE, shelf)))
    asked.clear()
    run(dataclasses.replace(room(rho=0.4), sensors=(PLANE, shelf)))
    assert not asked


def test_another_web_is_another_lamp(asked):
    run(room())
    asked.clear()
    again = run(room(sharp=3.0))
    assert asked
    assert np.array_equal(direct(again), direct(solve(room(sharp=3.0), accuracy=ACCURACY)))


def test_a_moved_seat_is_looked_at_and_what_it_hides(asked):
    first = run(room())
    everything = sum(asked)
    asked.clear()
    elsewhere = room(at=(-1.2, 0.2, 0.45))  # below a sensor, and beside others
    again = run(elsewhere)
    assert 0 < sum(asked) < 0.5 * everything
    assert again.counters["web_rows_reused"] > 0
    fresh = solve(elsewhere, accuracy=ACCURACY)
    error = fresh.sensors["plane"].error_lx
    assert np.all(np.abs(direct(again) - direct(fresh)) <= error)
    assert not np.array_equal(
        first.sensors["plane"].illuminance_lx, again.sensors["plane"].illuminance_lx
    )


def test_light_of_a_brighter_lamp():
    light = WebLight(np.array([2.0]), np.array([0.25]), np.array([0.5])).times(3.0)
    assert (light.illuminance, light.variance, light.partly) == (6.0, 2.25, 1.5)
