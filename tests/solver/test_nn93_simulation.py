"""Scenes solved by the method of 1993: furnaces, shared corners, stated errors, what it lacks."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.errors import InputError, OutOfMemoryError
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import CIESky, Material, PatchSet
from patchlight.solver.model.bezier import gauss_rule
from patchlight.solver.simulation import solve
from patchlight.solver.vertices import Vertices, between_corners

from .fixtures_light import Body, ceiling, grid, scene, setup

BOX = PatchSet.box((2, 3, 2.5), inward=True)
PLANE = grid("plane", [(0.3, 0.4, -0.5), (-0.8, 1.0, -0.5), (0.0, 0.0, -0.5)])
#: Its kernels take most of a minute to compile.
compiled = pytest.mark.slow


def vertices_of(patches, count):
    n = len(patches)
    parts = scene(setup(Body(patches)))
    elements = make_elements(patches, np.zeros(n, bool), np.full((n, 2), count))
    return Vertices.of_elements(parts, elements), elements


def test_faces_of_a_box_share_no_corners():
    """Each of six faces of 2 x 2 elements has 3 x 3 corners of its own."""
    vertices, elements = vertices_of(BOX, 2)
    assert len(vertices) == 6 * 9
    for k in range(6):
        own = vertices.of[elements.patch_index == k]
        assert len(np.unique(own)) == 9
        assert (vertices.on[own] == k).all()
    assert vertices.blind.all()


def test_a_sphere_shares_corners_over_its_patches():
    patches = PatchSet.sphere((0, 0, 0), 1.0, inward=True)
    vertices, elements = vertices_of(patches, 2)
    corners = patches.evaluate(*(g.ravel() for g in np.meshgrid([0, 0.5, 1], [0, 0.5, 1])))
    # As many as there are different places; normals point inwards, to within the inset.
    places = np.unique(np.round(corners.reshape(-1, 3), 6), axis=0)
    assert len(vertices) == len(places) < 9 * len(patches)
    np.testing.assert_allclose(vertices.normals, -vertices.points, atol=1e-9)
    assert not vertices.blind.any()


def test_corners_of_one_place_are_told_apart_by_material():
    left, right = ceiling(-1, 0, -1, 1, 2), ceiling(0, 1, -1, 1, 2)
    both = setup(left, right)
    elements = make_elements(both.patches, np.zeros(2, bool), np.ones((2, 2), np.int64))
    assert len(Vertices.of_elements(scene(both), elements)) == 6
    assert len(Vertices.of_elements(scene(both, materials=[0.5, 0.2]), elements)) == 8


def test_form_factors_of_corners_are_added_up():
    vertices, elements = vertices_of(BOX, 2)
    shares = np.random.default_rng(1).random((3, len(elements), 4))
    light = np.random.default_rng(2).random(len(vertices))
    expected = np.einsum("mnk,nk->m", shares, light[vertices.of])
    np.testing.assert_allclose(vertices.added(shares) @ light, expected, rtol=1e-13)


def test_nodes_get_what_is_bilinear_between_corners():
    t = gauss_rule(2)[0]
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    corner = np.array([2.0, 5.0, 11.0, -1.0])  # 2 + 3 u − 3 v + 9 u v
    np.testing.assert_allclose(between_corners(2) @ corner, 2 + 3 * u - 3 * v + 9 * u * v)


@compiled
@pytest.mark.parametrize(("body", "tolerance"), [
    # Plane elements have exact factors; corners are looked at 1e-4 of an element from their edges.
    (BOX, 1e-3),
    # Polygons for arcs: chords of a hundredth of their length.
    (PatchSet.sphere((0, 0, 0), 1.5, inward=True), 2e-2),
])  # fmt: skip
def test_a_furnace_is_even(body, tolerance):
    """Where all emits M and reflects ρ, all is M / (1 − ρ): by the rows' sums alone."""
    parts = setup(Body(body))
    given = scene(parts, rho=0.5, lamps=[(0, "walls", 100.0)], sensors=[PLANE])
    result = solve(given, accuracy=0.1, method="nn93")
    assert any("errors are the difference" in line for line in result.warnings)
    assert result.settings["method"] == "nn93" and result.settings["basis"] == "corners"
    np.testing.assert_allclose(result.illuminance_lx, 200.0, rtol=tolerance)
    np.testing.assert_allclose(result.sensors["plane"].illuminance_lx, 200.0, rtol=tolerance)
    np.testing.assert_allclose(result.row_sums, 1.0, rtol=tolerance)


@compiled
def test_the_lobe_of_1993_is_the_one_that_is_used():
    """Ours keeps a furnace even; that of 1993 loses what it sends below the horizon."""
    glossy = Material(0.3, specular=0.2, exponent=5)
    given = scene(setup(Body(BOX)), lamps=[(0, "walls", 100.0)], sensors=[PLANE])
    given = dataclasses.replace(given, materials=(glossy,))
    ours = solve(given, accuracy=0.1).sensors["plane"].illuminance_lx
    theirs = solve(given, accuracy=0.1, method="nn93").sensors["plane"].illuminance_lx
    np.testing.assert_allclose(ours, 200.0, rtol=1e-3)
    # The glossy half of 40 % of the light loses some of itself, at grazing angles half.
    assert (theirs < 199.9).all() and (theirs > 180.0).all()


@compiled
def test_the_stated_error_holds_in_a_room_with_a_lamp():
    """A screen below the lamp throws a shadow; the default method tells the truth to 0.5 %."""
    lamp, screen = ceiling(-0.4, 0.4, -0.3, 0.3, 1.0), ceiling(-0.5, 0.1, -0.6, 0.5, 0.3)
    given = scene(
        setup(Body(BOX), lamp, screen), rho=0.5, lamps=[(1, "lamp", 4000.0)], sensors=[PLANE]
    )
    found = solve(given, accuracy=0.1, method="nn93").sensors["plane"]
    truth = solve(given, accuracy=0.005).sensors["plane"]
    off = np.abs(found.illuminance_lx - truth.illuminance_lx)
    assert (off <= found.error_lx + truth.error_lx).all()
    assert (off < 0.15 * truth.illuminance_lx).all()


@compiled
def test_patches_of_one_element_are_told():
    """Both meshes compared are the same there; unknowns are the corners, not the nodes."""
    lamp = ceiling(-0.2, 0.2, -0.2, 0.2, 1.0)
    given = scene(setup(Body(BOX), lamp), rho=0.5, lamps=[(1, "lamp", 4000.0)], sensors=[PLANE])
    found = solve(given, accuracy=0.5, method="nn93")
    assert any("one element on both meshes" in warning for warning in found.warnings)
    assert found.counters["unknowns"] < found.counters["nodes"]


@compiled
def test_elements_are_quartered_below_a_lamp():
    lamp = ceiling(-0.1, 0.1, -0.1, 0.1, -1.1)
    given = scene(setup(Body(BOX), lamp), lamps=[(1, "lamp", 4000.0)])
    result = solve(given, accuracy=0.2, method="nn93", balanced_mesh=True)
    assert result.counters["elements_added"] > 0 and result.settings["balanced_mesh"]
    elements = result.elements
    floor = np.abs(elements.nodes[..., 2] + 1.25).max(axis=1) < 1e-9
    near = np.hypot(*elements.nodes[floor].mean(axis=1)[:, :2].T) < 0.5
    # Elements of the same face get smaller towards the lamp.
    assert elements.areas[floor][near].max() < elements.areas[floor][~near].max()


@compiled
def test_the_open_sky_falls_on_corners_as_on_nodes():
    sky = CIESky(16, diffuse_illuminance_lx=10_000.0)
    given = scene(setup(ceiling(-1, 1, -1, 1, 0.0).flipped()), sky=sky)
    result = solve(given, accuracy=0.1, method="nn93")
    np.testing.assert_allclose(result.illuminance_lx, 10_000.0, rtol=1e-3)


@pytest.mark.parametrize("material", [Material(0.2, mirror=0.5)])
def test_what_the_method_lacks_is_refused(material):
    given = scene(setup(Body(BOX)), lamps=[(0, "walls", 100.0)])
    with pytest.raises(InputError, match="mirrors"):
        solve(dataclasses.replace(given, materials=(material,)), method="nn93")
    with pytest.raises(InputError, match="method = 'nn39': default or nn93"):
        solve(given, method="nn39")


@compiled
def test_matrices_that_do_not_fit_are_not_made(monkeypatch):
    monkeypatch.setattr("patchlight.solver.memory.available_bytes", lambda: 100_000)
    given = scene(setup(Body(BOX)), lamps=[(0, "walls", 100.0)])
    with pytest.raises(OutOfMemoryError, match=r"1993 with \d+ points and \d+ corners"):
        solve(given, accuracy=0.05, method="nn93")
