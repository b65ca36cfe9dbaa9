"""Light of a year: each step is what a simulation under its sky and sun finds."""

import dataclasses

import numpy as np
import pytest
from patchlight.pipeline import (
    Glass,
    Ground,
    Material,
    PatchSet,
    PerezSky,
    Scene,
    SensorGrid,
    simulate,
)
from patchlight.solver.budget import Budget
from patchlight.solver.daylit import DaylitScene, coarse_elements
from patchlight.solver.dome_grid import dome_grid
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import frozen
from patchlight.solver.open_sky import OpenSky
from patchlight.solver.outside_light import Horizon
from patchlight.solver.perez import sun_of
from patchlight.solver.sky_series import SkySeries
from patchlight.solver.surfaces import Receivers
from patchlight.solver.topology import make_blockers
from patchlight.solver.year_light import light_in_steps

#: Overcast, a low and a high sun, a bright sky with a sun that does not come in, dusk, and night.
RADIATION = (
    # direct, diffuse [W/m²], altitude, azimuth [deg]
    (0.0, 150.0, 30.0, 120.0),
    (500.0, 80.0, 20.0, 170.0),
    (800.0, 100.0, 50.0, 200.0),
    (300.0, 250.0, 35.0, 20.0),
    (0.0, 10.0, 0.5, 260.0),
    (0.0, 0.0, -20.0, 330.0),
)

#: More places of the sun.
SUNS = np.array([[0.1, -0.8, 0.5], [0.3, -0.6, 0.6], [-0.4, -0.5, 0.5]])
SUNS /= np.linalg.norm(SUNS, axis=1, keepdims=True)


def quad(*corners):
    return PatchSet.from_bilinear(np.array([corners], float))


def room(glass=False, ball=False, color=False, turned=0.0, rho=0.5, spectral=False, terrain=False):
    """3 x 4 x 2.7 m with an opening 2 x 1.4 m to the south; ``turned`` from north [deg]."""
    scene = Scene(north_deg=turned)
    x, y, z, x0, x1, z0, z1 = 3.0, 4.0, 2.7, 0.5, 2.5, 0.9, 2.3
    walls = {
        "floor": ((0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)),
        "ceiling": ((0, 0, z), (0, y, z), (x, y, z), (x, 0, z)),
        "north": ((0, y, 0), (x, y, 0), (x, y, z), (0, y, z)),
        "west": ((0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z)),
        "east": ((x, 0, 0), (x, 0, z), (x, y, z), (x, y, 0)),
        "left": ((0, 0, 0), (x0, 0, 0), (x0, 0, z), (0, 0, z)),
        "right": ((x1, 0, 0), (x, 0, 0), (x, 0, z), (x1, 0, z)),
        "sill": ((x0, 0, 0), (x1, 0, 0), (x1, 0, z0), (x0, 0, z0)),
        "lintel": ((x0, 0, z1), (x1, 0, z1), (x1, 0, z), (x0, 0, z)),
    }
    for name, corners in walls.items():
        scene.add(quad(*corners), name, two_sided=True)
        scene.assign(name, Material((0.7, 0.5, 0.3) if color and name == "floor" else rho))
    if glass:
        scene.add(quad((x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)), "pane", two_sided=True)
        scene.assign("pane", Glass(0.006))
    if ball:
        scene.add(PatchSet.sphere((1.5, 1.0, 1.4), 0.25), "ball")
        scene.assign("ball", Material(0.3))
    grid = np.stack([g.ravel() for g in np.meshgrid([0.5, 1.5, 2.5], [0.5, 1.5, 2.5, 3.5], [0.8])])
    scene.add(SensorGrid(grid.T, (0.0, 0.0, 1.0), name="plane", spectral=spectral))
    scene.ground = Ground(0.2)
    if terrain:
        y0, z0 = -20.0, -0.5
        scene.add(quad((-20, y0, z0), (23, y0, z0), (23, 0, z0), (-20, 0, z0)), "lawn")
        scene.assign("lawn", Material((0.05, 0.3, 0.02)))
        scene.ground = Ground(None)
    return scene


def skies(radiation=RADIATION, factor=1.0):
    direct, diffuse, altitude, azimuth = np.array(radiation, float).T
    n = len(direct)
    return SkySeries.from_irradiance(
        altitude, azimuth, factor * direct, factor * diffuse, np.full(n, 10.97), np.ones(n)
    )


def under_sky_of(scene, step):
    """The scene under the sky of one step, with its sun."""
    direct, diffuse, altitude, azimuth = RADIATION[step]
    scene.sky = PerezSky(
        direct_normal_w_m2=direct,
        diffuse_horizontal_w_m2=diffuse,
        sun_altitude_deg=altitude,
        sun_azimuth_deg=azimuth,
    )
    if direct > 0.0:
        scene.sun = sun_of(scene.sky)
    return scene


def light_of(scene, series=None, accuracy=0.02):
    series = skies() if series is None else series
    suns = series.suns[series.sun_normal_lx > 0.0]
    found = DaylitScene.of(scene.freeze(), accuracy=accuracy).coefficients(suns=suns)
    return light_in_steps(found, series, np.arange(len(series)))


@pytest.mark.parametrize(
    ("kind", "steps", "accuracy"),
    [
        ("plain", (1,), 0.02),
        ("glass", (0,), 0.02),
        pytest.param("plain", range(5), 0.01, marks=pytest.mark.slow),
        pytest.param("glass", range(5), 0.01, marks=pytest.mark.slow),
        pytest.param("ball", range(5), 0.01, marks=pytest.mark.slow),
    ],
)
def test_each_step_is_a_simulation(kind, steps, accuracy):
    """Superposition: every part of the light within the accuracies of both.

    Of the whole an error of 0.02 is asked, and the simulation states its own, nearly all of it in
    what the sun's patch on the floor sends on. Here that is told to a twentieth.
    """
    options = {} if kind == "plain" else {kind: True, "color": kind == "glass"}
    found = light_of(room(**options))
    for step in steps:
        scene = under_sky_of(room(**options), step)
        result = simulate(scene, accuracy=accuracy).sensors["plane"]
        parts, whole = result.components, result.illuminance_lx
        off = np.abs(found.total[:, step] - whole)
        assert (off <= 0.02 * whole + result.error_lx).all()
        assert np.sqrt(np.mean((off / whole) ** 2)) < 0.01 + float(np.mean(result.error_lx / whole))
        mean = whole.mean()
        for name, values, bound in (
            ("sky.direct", found.sky_direct, 4e-3),
            ("sky.indirect", found.sky_indirect, 4e-3),
            # The simulation samples parts of the disc to its own accuracy, here it is exact.
            ("sun.direct", found.sun_direct, accuracy),
        ):
            if name in parts:
                np.testing.assert_allclose(values[:, step], parts[name], atol=bound * mean)
        if scene.sun is not None:
            told, own = found.sun_indirect[:, step].sum(), parts["sun.indirect"].sum()
            assert abs(told - own) <= 0.05 * own + result.error_lx.sum()
        ground = parts["ground.direct"] + parts["ground.indirect"]
        np.testing.assert_allclose(found.ground[:, step], ground, atol=4e-3 * mean)


@pytest.mark.parametrize(
    ("kind", "step"),
    [
        ("floor", 0),
        ("floor", 1),
        pytest.param("floor", 2, marks=pytest.mark.slow),
        pytest.param("lawn", 0, marks=pytest.mark.slow),
    ],
)
def test_melanopic_light_of_each_step_is_that_of_a_simulation(kind, step):
    """Under an overcast sky, there with a green ground outside, too, and sun on a reddish floor.

    What the sun's patch sends on is told to a twentieth, and the colour of the whole far better.
    """
    options = {"color": True, "spectral": True, "terrain": kind == "lawn"}
    found = light_of(room(**options))
    scene = under_sky_of(room(**options), step)
    result = simulate(scene, accuracy=0.02).sensors["plane"]
    assert found.melanopic_edi is not None and result.spectral is not None
    edi, expected = found.melanopic_edi[:, step], result.spectral.melanopic_edi_lx
    np.testing.assert_allclose(edi, expected, rtol=0.03)
    der, own = edi / found.total[:, step], result.spectral.melanopic_der
    np.testing.assert_allclose(der, own, rtol=4e-3)
    assert np.ptp(own) > 0.02  # more of it is reflected far from the window
    # Light is the same whether its spectrum is asked for or not.
    plain = light_of(room(**{**options, "spectral": False})).total[:, step]
    np.testing.assert_allclose(found.total[:, step], plain, rtol=0.01)


def test_melanopic_light_is_told_where_it_is_asked_for(plain):
    series = skies()
    assert light_in_steps(plain, series, np.arange(6)).melanopic_edi is None
    dark = light_of(room(spectral=True)).melanopic_edi[:, 5]
    np.testing.assert_array_equal(dark, np.zeros(len(dark)))


@pytest.fixture(scope="module")
def plain():
    series = skies()
    suns = np.concatenate([series.suns[series.sun_normal_lx > 0.0], SUNS])
    return DaylitScene.of(room().freeze(), accuracy=0.02).coefficients(suns=suns)


def test_night_is_dark(plain):
    found = light_in_steps(plain, skies(), np.array([5]))
    assert not found.total.any()


def test_light_goes_with_radiation(plain):
    """Twice the luminance everywhere is twice the light, part by part."""
    series = skies()
    twice = dataclasses.replace(
        series, sky_lx=frozen(2 * series.sky_lx), sun_normal_lx=frozen(2 * series.sun_normal_lx)
    )
    steps = np.arange(len(series))
    one, two = (light_in_steps(plain, s, steps) for s in (series, twice))
    for name in ("sky_direct", "sky_indirect", "sun_direct", "sun_indirect", "ground"):
        np.testing.assert_allclose(getattr(two, name), 2.0 * getattr(one, name), rtol=1e-12)


def test_steps_do_not_know_of_each_other(plain):
    series = skies()
    whole = light_in_steps(plain, series, np.arange(6)).total
    for step in range(6):
        np.testing.assert_allclose(
            light_in_steps(plain, series, np.array([step])).total[:, 0],
            whole[:, step],
            rtol=1e-12,
            atol=1e-9,
        )


def test_turned_with_its_weather():
    """A scene and its sky turned about the vertical: the cells differ, the light does not."""
    angle = 37.0
    turned = [(a, b, altitude, azimuth - angle) for a, b, altitude, azimuth in RADIATION]
    one = light_of(room())
    two = light_of(room(turned=angle), skies(turned))
    whole = one.total[:, :5]
    np.testing.assert_allclose(
        two.sky_direct[:, :5], one.sky_direct[:, :5], atol=2e-3 * whole.mean()
    )
    np.testing.assert_allclose(two.sun_direct, one.sun_direct, rtol=1e-9, atol=1e-6)
    off = two.total[:, :5] / whole - 1.0
    assert np.sqrt(np.mean(off**2)) < 0.01


def test_more_cells_change_little():
    """Direct light of the sky converges with the cells; the error falls with their square."""
    scene = room().freeze()
    series, steps = skies(), np.arange(4)
    daylit = DaylitScene.of(scene, accuracy=0.05)
    levels = [
        light_in_steps(
            daylit.coefficients(sky_parts=parts, beam_parts=1, sun_parts=1), series, steps
        ).sky_direct
        for parts in (1, 2, 4, 8)
    ]
    errors = [np.abs(level - levels[-1]).max() / levels[-1].mean() for level in levels[:-1]]
    assert errors[2] < 5e-3
    assert errors[0] > errors[1] > errors[2]
    assert errors[0] > 6.0 * errors[2]


def test_nothing_in_the_way_is_the_sky_itself():
    """In the open a level sensor gets all of sky and sun."""
    scene = Scene()
    scene.add(quad((0, 0, -5), (1, 0, -5), (1, 1, -5), (0, 1, -5)), "plate", two_sided=True)
    scene.assign("plate", Material(0.2))
    scene.add(SensorGrid([(0.5, 0.5, 1.0)], (0, 0, 1), name="roof"))
    scene.ground = Ground(0.0)
    series = skies()
    found = light_of(scene, series)
    np.testing.assert_allclose(found.sky_direct[0], series.sky_lx, rtol=1e-3, atol=1e-9)
    expected = series.sun_normal_lx * np.maximum(series.suns[:, 2], 0.0)
    np.testing.assert_allclose(found.sun_direct[0], expected, rtol=1e-9, atol=1e-9)


def test_closed_room_and_ground_that_is_not_said():
    """Nothing comes into a box; a plate that looks down gets the light of the usual ground."""
    box = Scene()
    box.add(PatchSet.box((2, 2, 2), inward=True), "box")
    box.add(SensorGrid([(0, 0, 0)], (0, 0, 1), name="inside"))
    assert not light_of(box, accuracy=0.2).total.any()
    plate = Scene()
    plate.add(quad((0, 0, 5), (1, 0, 5), (1, 1, 5), (0, 1, 5)), "plate", two_sided=True)
    plate.assign("plate", Material(0.0))
    plate.add(SensorGrid([(5.0, 5.0, 1.0)], (0, 0, -1), name="below"))
    series = skies()
    found = light_of(plate, series, accuracy=0.2)
    np.testing.assert_allclose(found.ground[0], 0.2 * series.level_lx, rtol=1e-3, atol=1e-9)
    assert not found.sky_direct.any()
    assert not found.sun_direct.any()


def test_many_open_directions_have_room():
    """The nodes of 9217 cells about a receiver in the open add up with none of them left to rays.

    Gauss' rule of two points, in panels of a degree: 1e-9 of an even sky.
    """
    scene = Scene()
    scene.add(quad((0, 0, -5), (1, 0, -5), (1, 1, -5), (0, 1, -5)), "plate", two_sided=True)
    data = scene.freeze()
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    points, normals = np.array([[0.5, 0.5, 1.0]] * 3), np.array([[0.0, 0.0, 1.0]] * 3)
    sky = OpenSky(data, blockers, trace=True)
    seen = sky.seen(points, normals, dome_grid(8), np.full(3, np.pi))
    assert not seen.by_rays.any()
    assert seen.scaled < 1e-8
    np.testing.assert_allclose(seen.weights[2].sum(), np.pi, rtol=1e-12)
    # What is a tenth too little of an even sky is told.
    off = sky.seen(points, normals, dome_grid(4), np.full(3, 0.9 * np.pi))
    assert off.scaled == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("ball", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_open_directions_under_a_narrow_sky(ball):
    """Weights of cells past flat edges and round a ball, against the exact dome of one sky."""
    data = room(ball=ball).freeze()
    data = dataclasses.replace(
        data,
        sky=PerezSky(
            direct_normal_w_m2=700.0,
            diffuse_horizontal_w_m2=120.0,
            sun_altitude_deg=35.0,
            sun_azimuth_deg=170.0,
        ),
    )
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    grid = data.sensors[0]
    horizon = Horizon(blockers, trace=True)
    receivers = Receivers.of_sensors(grid)
    how = {"eps": 1e-4, "cell_eps": 1e-6}
    even = horizon.light(receivers, None, ground=False, **how).sky.illuminance
    exact = horizon.light(receivers, data.sky, ground=False, **how).sky.illuminance
    cells = dome_grid(8)
    seen = OpenSky(data, blockers, trace=True).seen(grid.points, grid.normals, cells, even)
    sky = SkySeries.from_irradiance(
        *(np.array([v]) for v in (35.0, 170.0, 700.0, 120.0, 10.97, 1.0))
    )
    found = seen.weights @ sky.luminances(cells, np.array([0]))[:, 0]
    np.testing.assert_allclose(seen.scale, 1.0, atol=1e-2 if ball else 1e-3)
    np.testing.assert_allclose(found, exact, rtol=1e-2 if ball else 4e-3)


def test_sun_after_reflections_between_its_places(plain):
    off, own = plain.sun_error(SUNS)
    assert 0.0 < np.sqrt(off / own) < 0.08
    assert plain.sun_error(np.empty((0, 3))) == (0.0, 0.0)


def test_sensors_do_not_know_of_each_other():
    """Coefficients of some sensors are those of all, but for which rays of beams matter."""
    daylit = DaylitScene.of(room(color=True).freeze(), accuracy=0.2)
    whole = daylit.coefficients(suns=SUNS)
    for some in (slice(0, 5), slice(5, 12)):
        found = daylit.coefficients(some, suns=SUNS)
        np.testing.assert_array_equal(found.direct, whole.direct[some])
        np.testing.assert_array_equal(found.ground, whole.ground[some])
        # `beams.LEFT_OUT` of the light may come from surfaces left out, on either side.
        np.testing.assert_allclose(
            found.indirect.sum(axis=1), whole.indirect[some].sum(axis=1), rtol=1e-9
        )
        one, other = (c.sun_indirect(SUNS) for c in (found, whole))
        np.testing.assert_allclose(one, other[some], atol=5e-3 * other.max())


@pytest.mark.parametrize("glass", [False, True])
def test_daylight_factors_are_those_of_a_simulation(glass):
    scene = room(glass=glass)
    found = DaylitScene.of(scene.freeze(), accuracy=0.02).coefficients(suns=SUNS)
    scene.daylight_factor = True
    grid = simulate(scene, accuracy=0.02).sensors["plane"]
    np.testing.assert_allclose(found.daylight_factor(), grid.daylight.total, rtol=0.02)


def test_gloss_is_said():
    scene = room()
    scene.assign("floor", Material(0.1, specular=0.2))
    found = DaylitScene.of(scene.freeze(), accuracy=0.2)
    assert any("as if they were matt" in text for text in found.stages.warnings)


def test_what_is_not_known():
    scene = room()
    scene.assign("floor", Material(0.2, mirror=0.5))
    with pytest.raises(InputError, match="mirror = 0.5"):
        DaylitScene.of(scene.freeze())
    scene = room(glass=True)
    scene.assign("pane", Glass(0.006, diffuse=0.5))
    with pytest.raises(InputError, match="diffuse = 0.5"):
        DaylitScene.of(scene.freeze())
    scene = room()
    scene.grids.clear()
    with pytest.raises(InputError, match="no sensors"):
        DaylitScene.of(scene.freeze())


@pytest.mark.parametrize("accuracy", [0.3, 0.02])
def test_elements_that_are_coarse_for_a_room_are_told(accuracy):
    """Those of a lawn are as large as its window wall is wide."""
    told = [
        coarse_elements(data, Budget.of(data, accuracy).size)
        for data in (room(terrain=lawn).freeze() for lawn in (False, True))
    ]
    assert told[0] is None
    assert "43 x 24 x 3.2 m" in told[1] and "sun" in told[1]
