"""Elements: sizes, nodes, areas and normals of sub-patches."""

import math

import numpy as np
import pytest
from patchlight.solver.errors import GeometryError
from patchlight.solver.mesh import MAX_TURN, divisions, make_elements, patch_extent
from patchlight.solver.model import PatchSet

from .fixtures_light import rectangle


def elements_of(patches, counts=None, **options):
    n = len(patches)
    counts = np.ones((n, 2), np.int64) if counts is None else np.asarray(counts)
    return make_elements(patches, np.zeros(n, bool), counts, **options)


@pytest.mark.parametrize("nodes", [1, 2, 3])
@pytest.mark.parametrize("cuts", [(1, 1), (2, 3)])
def test_areas_of_a_sphere(nodes, cuts):
    sphere = PatchSet.sphere((1, 2, 3), 0.5)
    elements = elements_of(sphere, np.tile(cuts, (8, 1)), nodes=nodes)
    assert len(elements) == 8 * cuts[0] * cuts[1]
    # Areas are integrated finely whatever the number of nodes.
    assert elements.areas.sum() == pytest.approx(math.pi, rel=1e-8)
    np.testing.assert_allclose(elements.weights.sum(axis=1), elements.areas, rtol=1e-12)
    assert (elements.weights > 0).all()


def test_nodes_lie_on_the_surface_inside_their_element():
    sphere = PatchSet.sphere((0, 0, 0), 2.0)
    elements = elements_of(sphere, np.full((8, 2), 3))
    radius = np.linalg.norm(elements.nodes, axis=2)
    np.testing.assert_allclose(radius, 2.0, rtol=1e-13)
    np.testing.assert_allclose(elements.normals, elements.nodes / 2.0, atol=1e-12)
    for box, net_index in zip(elements.boxes, elements.patch_index, strict=False):
        assert 0 <= box[0] < box[1] <= 1 and 0 <= box[2] < box[3] <= 1
        assert 0 <= net_index < 8


def test_flux_of_a_linear_field_is_exact():
    """2 x 2 Gauss nodes integrate what varies linearly over a plane element."""
    plane = rectangle((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))
    elements = elements_of(plane, [(2, 1)])
    field = 3.0 + 2.0 * elements.nodes[..., 0] - elements.nodes[..., 1]
    assert (field * elements.weights).sum() == pytest.approx(2 * 3 + 2 * 2 - 1, rel=1e-13)


def test_two_sided_patches_get_both_sides():
    plane = rectangle((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))
    elements = make_elements(plane, np.array([True]), np.array([[2, 2]]))
    assert len(elements) == 8
    assert list(elements.side) == [0] * 4 + [1] * 4
    np.testing.assert_allclose(elements.normals[:4, :, 2], 1.0)
    np.testing.assert_allclose(elements.normals[4:, :, 2], -1.0)


def test_nets_of_elements_are_the_surface():
    torus = PatchSet.torus((0, 0, 0), (0, 0, 1), 2.0, 0.5)
    elements = elements_of(torus, np.full((16, 2), 2))
    t = np.linspace(0, 1, 5)
    u, v = np.meshgrid(t, t, indexing="ij")
    p = PatchSet(elements.nets).evaluate(u, v)
    ring = np.hypot(p[..., 0], p[..., 1]) - 2.0
    np.testing.assert_allclose(np.hypot(ring, p[..., 2]), 0.5, atol=1e-12)


def test_divisions_follow_size_and_turn():
    plane = rectangle((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))
    assert divisions(plane, 0.5).tolist() == [[4, 2]]
    assert divisions(plane, 5.0).tolist() == [[1, 1]]
    lengths, turns = patch_extent(plane)
    np.testing.assert_allclose(lengths, [[2, 1]])
    assert np.abs(turns).max() < 1e-6
    # A quarter turn is cut in two although the size would allow one element.
    sphere = PatchSet.sphere((0, 0, 0), 1.0)
    counts = divisions(sphere, 2.0)
    assert (counts == 2).all()
    assert 0.5 * math.pi / counts.min() <= MAX_TURN


@pytest.mark.parametrize(
    ("patches", "turn"),
    [
        (PatchSet.sphere((0, 0, 0), 1.0), (90.0, 90.0)),
        (PatchSet.cylinder((0, 0, 0), (0, 0, 3), 0.5), (90.0, 0.0)),
        (PatchSet.torus((0, 0, 0), (0, 0, 1), 2.0, 0.5), (90.0, 90.0)),
    ],
)
def test_turns_of_whole_patches(patches, turn):
    """Up to the edges, but for a thousandth of the parameters on either side."""
    found = np.degrees(patch_extent(patches)[1])
    np.testing.assert_allclose(found, np.tile(turn, (len(patches), 1)), rtol=3e-3, atol=1e-9)


def test_small_elements_have_one_node():
    patches = PatchSet.concatenated(
        rectangle((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)),
        rectangle((0, 0, 1), (0.1, 0, 1), (0.1, 0.1, 1), (0, 0.1, 1)),
    )
    elements = elements_of(patches, small=0.1)
    assert (elements.weights > 0).sum(axis=1).tolist() == [4, 1]
    np.testing.assert_allclose(elements.nodes[1, 0], [0.05, 0.05, 1.0])
    np.testing.assert_allclose(elements.weights.sum(axis=1), [4.0, 0.01])


def test_nothing_to_cut():
    with pytest.raises(GeometryError, match="no surfaces"):
        elements_of(PatchSet.empty(), np.zeros((0, 2), np.int64))


def test_patch_without_area():
    line = rectangle((0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, 0))
    with pytest.raises(GeometryError, match="patch 0"):
        elements_of(line)
