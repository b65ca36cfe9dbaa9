"""Sun that comes in through an opening: what falls on the elements, and what they send on."""

import numpy as np
import pytest
from patchlight.pipeline import Material, PatchSet, Scene, SensorGrid, Sun, simulate
from patchlight.solver import budget, field, sun_means
from patchlight.solver.mesh import Boxes, make_elements
from patchlight.solver.model.sky import direction
from patchlight.solver.stages import Stages
from patchlight.solver.sun_means import _parts
from patchlight.solver.topology import make_blockers
from patchlight.solver.unknowns import Unknowns

from .test_year_light import quad, room

#: Area of the opening. [m²]
OPENING = 2.0 * 1.4
LEVEL = 80_000.0


def lit_by_sun(altitude, azimuth, accuracy, **options):
    scene = room(**options)
    scene.sun, scene.ground = Sun(altitude, azimuth, LEVEL), None
    return simulate(scene, accuracy=accuracy, cache=False)


def flux_inside(result):
    """Direct light of the sun on the sides that face the middle of the room. [lm]"""
    elements = result.elements
    inwards = np.array([1.5, 2.0, 1.35]) - elements.nodes.mean(axis=1)
    inside = (elements.normals.mean(axis=1) * inwards).sum(axis=1) > 0.0
    light = result.components["sun.direct"].sum(axis=1)
    return float((light * elements.areas)[inside].sum())


@pytest.mark.parametrize(("altitude", "azimuth"), [(35.0, 165.0), (20.0, 200.0), (50.0, 190.0)])
@pytest.mark.parametrize("accuracy", [0.05, 0.02])
def test_elements_get_what_comes_through_the_opening(altitude, azimuth, accuracy):
    """E_n cos θ A on floor and walls, wherever the edges of the patch cross elements.

    Some 60 parts lie along the patch, each told to a hundredth by 64 rays.
    """
    expected = LEVEL * -direction(altitude, azimuth)[1] * OPENING
    result = lit_by_sun(altitude, azimuth, accuracy)
    assert flux_inside(result) == pytest.approx(expected, rel=5e-3)
    assert result.counters["sun_means"] > 20


@pytest.mark.slow
def test_light_of_a_patch_after_reflections():
    """Within half of the accuracy asked for, of a run that is ten times as fine."""
    fine = lit_by_sun(20.0, 200.0, 0.002).sensors["plane"]
    for accuracy in (0.05, 0.02):
        found = lit_by_sun(20.0, 200.0, accuracy).sensors["plane"]
        off = np.abs(found.components["sun.indirect"] - fine.components["sun.indirect"])
        assert (off <= 0.5 * accuracy * found.illuminance_lx).all()
        mean = fine.components["sun.indirect"].mean()
        assert np.sqrt(np.mean(off**2)) < 5e-3 * mean


def test_meshes_are_cut_along_the_patch():
    """But not for sunny facades, which send nothing in."""
    assert lit_by_sun(35.0, 165.0, 0.02).counters["elements_added"] > 10
    assert lit_by_sun(35.0, 345.0, 0.02).counters["elements_added"] == 0


def test_colours_and_panes_keep_their_share():
    """Behind clear glass less, in the colour of the sun."""
    plain = lit_by_sun(35.0, 165.0, 0.05, color=True)
    behind = lit_by_sun(35.0, 165.0, 0.05, color=True, glass=True)
    share = flux_inside(behind) / flux_inside(plain)
    assert 0.75 < share < 0.92
    # What a pane keeps back all over is no edge.
    assert behind.counters["sun_means"] == pytest.approx(plain.counters["sun_means"], rel=0.1)
    light = plain.components["sun.direct"]
    some = light.max(axis=1) > 0.0
    ratios = light[some] / light[some].max(axis=1, keepdims=True)
    np.testing.assert_allclose(ratios, np.broadcast_to(ratios[:1], ratios.shape), rtol=1e-9)


@pytest.mark.parametrize(("x", "y"), [(0.31, 0.52), (0.8, -0.9)])
def test_sun_that_no_node_sees_comes_in(x, y):
    """Through a hole of 0.2 m in a wide roof, onto elements of more than a metre."""
    scene, h, w, wide = Scene(), 2.0, 0.2, 5.0
    scene.add(quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)), "floor")
    for k, (x0, x1, y0, y1) in enumerate(
        [(-wide, x, -wide, wide), (x + w, wide, -wide, wide), (x, x + w, -wide, y),
         (x, x + w, y + w, wide)]
    ):  # fmt: skip
        scene.add(quad((x0, y1, h), (x1, y1, h), (x1, y0, h), (x0, y0, h)), f"roof {k}")
    scene.add(SensorGrid([(0, 0, 0.5)], (0, 0, 1), name="plane"))
    scene.sun = Sun(80.0, 180.0, LEVEL)
    result = simulate(scene, accuracy=0.1, cache=False)
    flux = float((result.components["sun.direct"].sum(axis=1) * result.elements.areas).sum())
    # A spot of few of the 64 points of a part: it is known to a fifth, not to nothing.
    assert flux == pytest.approx(LEVEL * direction(80.0, 180.0)[2] * w * w, rel=0.2)


@pytest.mark.parametrize("width", [0.05, 0.03])
def test_sun_through_a_small_hole_is_all_the_light_there_is(width):
    """Holes under 6 cm were seen by no ray from the elements; the flux is what passes them."""
    scene, half, h, rho = Scene(), 2.0, 4.0, 0.5
    box = PatchSet.box((2 * half, 2 * half, h), (0, 0, 0.5 * h), inward=True)
    top = box.evaluate(0.5, 0.5).reshape(-1, 3)[:, 2] > 0.99 * h
    scene.add(box.take(np.flatnonzero(~top)), "walls")
    x, y = 0.13, 0.31
    w = 0.5 * width
    for k, (x0, x1, y0, y1) in enumerate(
        [(-half, x - w, -half, half), (x + w, half, -half, half), (x - w, x + w, -half, y - w),
         (x - w, x + w, y + w, half)]
    ):  # fmt: skip
        roof = quad((x0, y0, h), (x1, y0, h), (x1, y1, h), (x0, y1, h))
        scene.add(roof, f"roof {k}", two_sided=True)
        scene.assign(f"roof {k}", Material(rho))
    scene.assign("walls", Material(rho))
    scene.add(SensorGrid([(0, 0, 0.5)], (0, 0, 1), name="plane"))
    scene.sun = Sun(80.0, 150.0, LEVEL)
    result = simulate(scene, accuracy=0.05, cache=False)
    inside = result.elements.nodes.mean(axis=1)[:, 2] < 0.999 * h
    light = result.components["sun.direct"].sum(axis=1) * result.elements.areas
    entering = LEVEL * direction(80.0, 150.0)[2] * width**2
    assert light[inside].sum() == pytest.approx(entering, rel=0.25)


def test_means_are_the_same_however_many_are_told_at_a_time(monkeypatch):
    one = lit_by_sun(35.0, 165.0, 0.1).components["sun.direct"]
    monkeypatch.setattr(sun_means, "AT_A_TIME", 700)
    np.testing.assert_array_equal(one, lit_by_sun(35.0, 165.0, 0.1).components["sun.direct"])


def test_means_over_parts_do_not_depend_on_what_they_are_taken_from():
    """Gauss' weights of three nodes are not alike: parts are as wide as their node weighs."""
    data = room().freeze()
    elements = make_elements(
        data.patches, data.two_sided, np.ones((len(data.patches), 2), np.int64), nodes=3
    )
    whole = Unknowns.of(elements, "biquadratic")
    fine = whole.halved(elements, np.arange(0, len(elements), 2))
    taken = fine.take(np.arange(len(fine)))
    rows, parts = _parts(elements, fine)
    assert len(np.unique(np.round(np.diff(parts[:, :2]), 9))) == 4  # 5/18, 8/18, and their halves
    for one, other in zip(_parts(elements, taken), (rows, parts), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("room_for", [1, 40_000])
def test_blocks_hold_whole_elements(room_for, monkeypatch):
    """Light of halved elements is the same whatever number of rows a block has room for."""
    scene = room()
    scene.sun, scene.ground = Sun(35.0, 165.0, LEVEL), None
    data = scene.freeze()
    monkeypatch.setattr(budget, "MANY_ELEMENTS", 0)
    monkeypatch.setattr(field, "LEAST_ROWS", 7)
    asked = budget.Budget.of(data, 0.2)
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    solver = field.FieldSolver(data, blockers, trace=True, stages=Stages())
    solved = solver.solve(asked, Boxes.regular(asked.divisions, data.two_sided))
    elements = solved.surfaces.elements
    chosen = np.flatnonzero(solved.unknowns.can_halve(elements))
    fine = solved.unknowns.halved(elements, chosen)
    some = fine.take(fine.of_elements(chosen).ravel())
    whole, _ = solver._light_at(some, asked, solved)
    monkeypatch.setattr(field, "BLOCK_BYTES", room_for)
    parts, _ = solver.light_at(some, asked, solved)
    lux, told = (light.components["sun.direct"] for light in (parts, whole))
    # Along an edge the 64 rays of a part start anywhere in a sequence.
    assert lux.sum() == pytest.approx(told.sum(), rel=5e-3)
    assert np.abs(lux - told).max() < 0.05 * LEVEL
    # Straight and by way of mirrors, of which there are none.
    np.testing.assert_array_equal(parts.sun, lux)
