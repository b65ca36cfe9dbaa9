"""Receivers near each other in one plane that share a row."""

import numpy as np
import pytest
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet
from patchlight.solver.shared_rows import shared_rows
from patchlight.solver.surfaces import Receivers


def receivers(*bodies, nodes=1):
    patches = PatchSet.concatenated(*bodies)
    n = len(patches)
    elements = make_elements(patches, np.zeros(n, bool), np.ones((n, 2), int), nodes=nodes)
    solids = np.repeat(np.arange(len(bodies)), [len(b) for b in bodies])
    return Receivers.of_elements(elements), solids


@pytest.mark.parametrize("normal", [(0, 0, 1), (0.3, -0.5, 0.8)])
def test_the_patches_of_a_disk_share_the_row_of_its_middle(normal):
    points, solids = receivers(PatchSet.disk((0.3, 0.2, 0.1), 0.025, normal))
    row = shared_rows(points, solids, 0.3)
    assert len(np.unique(row)) == 1
    np.testing.assert_allclose(points.nodes[row[0], 0], (0.3, 0.2, 0.1), atol=1e-12)


def test_only_neighbours_in_one_plane_of_one_solid_share():
    disks = [
        PatchSet.disk((0, 0, 0), 0.02, (0, 0, 1)),
        PatchSet.disk((0.001, 0, 0), 0.02, (0, 0, 1)),  # another solid
    ]
    row = shared_rows(*receivers(*disks), 0.3)
    assert set(row[:5]).isdisjoint(row[5:])
    assert len(np.unique(row)) == 2
    # One solid: above one another, back to back, and far apart.
    parts = [
        PatchSet.disk((0, 0, 0), 0.02, (0, 0, 1)),
        PatchSet.disk((0, 0, 0.001), 0.02, (0, 0, 1)),
        PatchSet.disk((0, 0, 0), 0.02, (0, 0, -1)),
        PatchSet.disk((2, 0, 0), 0.02, (0, 0, 1)),
    ]
    row = shared_rows(*receivers(PatchSet.concatenated(*parts)), 0.3)
    assert len(np.unique(row)) == 4
    assert (np.unique(row // 5) == np.arange(4)).all()


def test_round_surfaces_and_elements_of_several_nodes_keep_their_rows():
    points, solids = receivers(PatchSet.cylinder((0, 0, 0), (0, 0, 0.7), 0.025))
    np.testing.assert_array_equal(shared_rows(points, solids, 0.3), np.arange(len(solids)))
    points, solids = receivers(PatchSet.disk((0, 0, 0), 0.025, (0, 0, 1)), nodes=2)
    np.testing.assert_array_equal(shared_rows(points, solids, 0.3), np.arange(len(solids)))
    points, solids = receivers(PatchSet.disk((0, 0, 0), 0.025, (0, 0, 1)))
    np.testing.assert_array_equal(shared_rows(points, solids, 0.0), np.arange(len(solids)))
