"""Sun that comes in through an opening: what falls on the elements, and what they send on."""

import numpy as np
import pytest
from patchlight.pipeline import Sun, simulate
from patchlight.solver.model.sky import direction

from .test_year_light import room

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
    light = plain.components["sun.direct"]
    some = light.max(axis=1) > 0.0
    ratios = light[some] / light[some].max(axis=1, keepdims=True)
    np.testing.assert_allclose(ratios, np.broadcast_to(ratios[:1], ratios.shape), rtol=1e-9)
