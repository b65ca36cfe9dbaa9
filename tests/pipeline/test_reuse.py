"""Changes after a first run, in scenes with glass, mirrors, gloss and uneven lamps: as a fresh run.

Rooms are small and coarse. Where the mesh is that of a fresh run, so is every bit of the result.
"""

from __future__ import annotations

import numpy as np
import pytest
from patchlight.pipeline import (
    CIESky,
    Emitter,
    Glass,
    Ground,
    Material,
    PatchSet,
    Scene,
    SensorGrid,
    Sun,
    forget,
    simulate,
)

from .window_room import opening, quad, window_room

ACCURACY = 0.3
POINTS = np.array([(0.4, 1.0, 0.8), (-0.9, 2.9, 0.8), (1.1, 3.4, 0.8)])
LAMP = {"flux_lm": 2000.0, "cct_k": 4000}
FACTORS = ("pairs_scanned", "pairs_traced", "pairs_without_blocker")


def room(
    *,
    rho=0.5,
    floor=None,
    glass=None,
    lamp=None,
    sky=None,
    sun=None,
    window=True,
    north=None,
    seat=(0.6, 2.2),
) -> Scene:
    """A room 3 x 4 x 2.5 m with a seat; in its wall y = 0 an opening 2 x 1 m from z = 1 m."""
    scene = window_room(3.0, 2.5, rho)
    if not window:
        scene.add(opening(), "shutter", two_sided=True)
        scene.assign("shutter", Material(rho))
    if floor is not None:
        scene.assign("floor", floor)
    if north is not None:
        scene.assign("north", north)
    scene.add(PatchSet.box((0.5, 0.5, 0.4), center=(*seat, 0.3)), "seat")
    if lamp is not None:
        scene.add(
            quad((-0.3, 1.8, 2.4), (-0.3, 2.4, 2.4), (0.3, 2.4, 2.4), (0.3, 1.8, 2.4)), "lamp"
        )
        scene.assign("lamp", lamp)
    if glass is not None:
        scene.add(opening(), "pane")
        scene.assign("pane", glass)
    scene.sky, scene.sun = sky, sun
    scene.ground = Ground(0.2) if sky is not None else None
    scene.add(SensorGrid(POINTS, np.tile((0.0, 0.0, 1.0), (3, 1)), name="points"))
    return scene


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch):
    """Nothing of another test; and all elements are halved, also at so loose an accuracy.

    Else those that were halved before are, which are not those that a fresh run would choose.
    """
    monkeypatch.setattr("patchlight.solver.budget.PIECES_ACCURACY", 1.0)
    forget()
    yield
    forget()


def run(scene, **options):
    return simulate(scene, accuracy=ACCURACY, **options)


def found(result) -> int:
    """Pairs whose form factors were found."""
    return sum(result.counters.get(name, 0) for name in FACTORS)


def same_bits(one, other):
    assert np.array_equal(one.elements.boxes, other.elements.boxes)
    assert np.array_equal(one.exitance, other.exitance)
    assert one.balance == other.balance
    for name, values in one.sensors["points"].components.items():
        assert np.array_equal(values, other.sensors["points"].components[name]), name
    assert np.array_equal(one.sensors["points"].error_lx, other.sensors["points"].error_lx)


def same_light(one, other):
    """To the bit where the meshes are the same, else within what both state."""
    if np.array_equal(one.elements.boxes, other.elements.boxes):
        same_bits(one, other)
    else:
        within_error(one, other)


def within_error(one, other):
    first, second = (r.sensors["points"] for r in (one, other))
    told = first.error_lx + second.error_lx
    assert (np.abs(first.illuminance_lx - second.illuminance_lx) <= told).all()


def changed(before, after):
    """A run after another one, and a fresh one."""
    first = run(before)
    again = run(after)
    own = run(after, cache=False)
    lux = first.sensors["points"].illuminance_lx
    assert not np.allclose(lux, own.sensors["points"].illuminance_lx, rtol=1e-3)
    # A mesh that does not do for the new light is made anew, and so are its rows.
    assert found(own) > 0
    assert found(again) < found(own) or not again.settings["mesh_of_earlier_run"]
    assert "rows_reused" not in own.counters
    return again, own


OVERCAST = CIESky(1, diffuse_illuminance_lx=10_000.0)
BRIGHTER = CIESky(1, diffuse_illuminance_lx=15_000.0)
CLEAR = CIESky(12, sun_altitude_deg=40.0, sun_azimuth_deg=200.0, diffuse_illuminance_lx=12_000.0)
SUN = Sun(40.0, 200.0, normal_illuminance_lx=60_000.0)
PANE = Glass(0.006)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({}, {"rho": 0.7}),
        pytest.param({}, {"floor": Material((0.5, 0.3, 0.2))}, marks=pytest.mark.slow),
        pytest.param({}, {"glass": Glass(0.012)}, marks=pytest.mark.slow),
        ({}, {"glass": Glass(transmittance=0.4)}),
        pytest.param(
            {"glass": Glass(0.006, diffuse=0.1)},
            {"glass": Glass(0.006, diffuse=0.5)},
            marks=pytest.mark.slow,
        ),
        ({}, {"sky": BRIGHTER}),
        pytest.param({}, {"sky": CLEAR}, marks=pytest.mark.slow),
        pytest.param({"sky": CLEAR}, {"sky": CLEAR, "sun": SUN}, marks=pytest.mark.slow),
        ({"lamp": Emitter(**LAMP)}, {"lamp": Emitter(**LAMP, dim=0.5), "rho": 0.4}),
    ],
    ids=["paint", "colour", "thicker", "darker", "diffusing", "brighter", "clear", "sun", "dimmed"],
)
def test_a_room_behind_glass(before, after):
    plain = {"glass": PANE, "sky": OVERCAST}
    again, own = changed(room(**plain | before), room(**plain | before | after))
    same_light(again, own)
    if not again.settings["mesh_of_earlier_run"]:
        assert "sun" in after  # that did not do for the new light
        return
    assert again.counters["rows_reused"] >= again.counters["unknowns"]
    assert again.counters.get("pairs_scanned", 0) == 0
    if "glass" not in after:
        assert "pairs_through_panes" not in again.counters


def test_a_pane_comes_and_goes():
    """What is no pane any more, or was none, leaves no row as it was."""
    rooms = [room(glass=PANE, sky=OVERCAST), room(sky=OVERCAST), room(sky=OVERCAST, window=False)]
    lux = [run(made).sensors["points"].illuminance_lx for made in (*rooms, *rooms)]
    for k, made in enumerate(rooms):
        own = run(made, cache=False).sensors["points"].illuminance_lx
        assert np.array_equal(lux[k], lux[k + 3])
        np.testing.assert_array_equal(lux[k], own)


MIRROR = Material(0.1, mirror=0.8)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({}, {"rho": 0.7}),
        ({}, {"north": Material(0.1, mirror=0.5)}),
        ({}, {"north": Material(0.3)}),
        ({"north": Material(0.3)}, {"north": MIRROR}),
        ({}, {"floor": Material(0.3, specular=0.3, exponent=30)}),
        pytest.param({}, {"sky": CLEAR, "sun": SUN}, marks=pytest.mark.slow),
        pytest.param(
            {"sky": CLEAR, "sun": SUN},
            {"sky": CLEAR, "sun": SUN, "rho": 0.3},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["paint", "duller", "none", "new", "glossy", "sky", "sunlit"],
)
def test_a_room_with_a_mirror(before, after):
    plain = {"north": MIRROR, "sky": OVERCAST}
    again, own = changed(room(**plain | before), room(**plain | before | after))
    # Sun patches may ask for another mesh.
    taken = again.settings["mesh_of_earlier_run"]
    assert taken or "sun" in after
    assert not taken or again.counters["rows_reused"] >= again.counters["unknowns"]
    same_light(again, own)
    if "rho" in after and taken:
        assert own.counters["mirror_rays"] > 0 and "mirror_rays" not in again.counters


def lit(profile=None, dim=1.0):
    return Emitter(**LAMP, dim=dim, profile=profile)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"lamp": lit((1, 1, 3, 3))}, {"lamp": lit((1, 1, 3, 3)), "rho": 0.45}),
        ({"lamp": lit((1, 1, 3, 3))}, {"lamp": lit((1, 1, 3, 3), dim=0.7)}),
        ({"lamp": lit((1, 1, 3, 3))}, {"lamp": lit((3, 3, 1, 1))}),
        ({"lamp": lit(lambda p: 1.0 + p[:, 0])}, {"lamp": lit(lambda p: 1.0 - p[:, 0])}),
        ({"lamp": lit()}, {"lamp": lit((1, 1, 3, 3))}),
        ({"lamp": lit((1, 1, 3, 3)), "north": MIRROR}, {"lamp": lit(), "north": MIRROR}),
    ],
    ids=["paint", "dimmed", "turned", "function", "uneven", "even"],
)
def test_lamps_that_are_not_even(before, after):
    again, own = changed(room(window=False, **before), room(window=False, **before | after))
    within_error(again, own)
    if np.array_equal(again.elements.boxes, own.elements.boxes):
        same_bits(again, own)


def test_a_profile_that_changes_more_gets_its_own_mesh():
    """A mesh that was made for an even lamp does not tell steps of its light."""
    steps = lit(np.tile((0.1, 0.1, 0.1, 6.0, 0.1), (5, 1)))
    run(room(window=False, lamp=lit()))
    again, own = (run(room(window=False, lamp=steps), cache=cache) for cache in (True, False))
    assert again.counters["elements_added_for_profiles"] > 0
    assert not again.settings["mesh_of_earlier_run"]
    same_bits(again, own)


def test_what_is_kept_stays_as_it_was():
    """No run alters what it was given: the first scene, after others, to the bit once more."""
    rooms = [
        room(glass=PANE, sky=OVERCAST, lamp=lit((1, 1, 3, 3))),
        room(glass=Glass(0.02), sky=CLEAR, lamp=lit((1, 1, 3, 3), dim=0.3), rho=0.3),
        room(glass=PANE, sky=BRIGHTER, sun=SUN, lamp=lit((1, 2, 3, 4)), seat=(0.5, 2.4)),
    ]
    first = [run(made) for made in rooms]
    for made, before in zip(rooms, first, strict=True):
        same_light(run(made), before)


def test_a_mesh_for_daylight_is_none_for_lamps():
    """Where lamps are new the mesh is cut for them; where the sky is new at its horizon lines."""
    dark, lamp = room(sky=OVERCAST), room(sky=OVERCAST, lamp=lit())
    run(dark)
    assert not run(lamp).settings["mesh_of_earlier_run"]
