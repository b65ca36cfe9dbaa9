"""What is known of patches: shape flags, neighbours, convex bodies and cavities."""

import numpy as np
import pytest
from patchlight.solver.kernels.nets import CONCAVE, CONVEX, PLANAR
from patchlight.solver.model import PatchSet
from patchlight.solver.topology import (
    adjacency,
    bounding_spheres,
    make_blockers,
    normal_cones,
    shape_flags,
)

from .fixtures_light import Body, ceiling, closed_cylinder, rectangle, setup, turned

SHAPES = {
    "plane": (PatchSet.box((1, 2, 3)), PLANAR),
    "disk": (PatchSet.disk((0, 0, 0), 1.0, (0, 0.6, 0.8)), PLANAR),
    "ball": (PatchSet.sphere((5, 0, 0), 0.3), CONVEX),
    "bowl": (PatchSet.sphere((5, 0, 0), 0.3, inward=True), CONCAVE),
    "rod": (PatchSet.cylinder((0, 0, 0), (1, 2, 3), 0.1), CONVEX),
    "tube": (PatchSet.cylinder((0, 0, 0), (1, 2, 3), 0.1, inward=True), CONCAVE),
    "spike": (PatchSet.cone((0, 0, 0), (0, 0, 2), 0.5, 0.0), CONVEX),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_flags(name, scale):
    patches, flag = SHAPES[name]
    move = turned(0.7)
    move[:3] *= scale
    assert (shape_flags(patches.moved(move).control_points) == flag).all()


def test_saddles_have_no_flag():
    torus = PatchSet.torus((0, 0, 0), (0, 0, 1), 2.0, 0.5)
    flags = shape_flags(torus.control_points)
    inner = np.hypot(*torus.evaluate(0.5, 0.5)[:, :2].T) < 2.0
    assert inner.sum() == 8
    assert (flags[inner] == 0).all()
    assert (flags[~inner] == CONVEX).all()


def test_bounding_spheres_hold_the_surface():
    for patches, _ in SHAPES.values():
        spheres = bounding_spheres(patches.control_points)
        t = np.linspace(0, 1, 9)
        points = patches.evaluate(*np.meshgrid(t, t)).reshape(len(patches), -1, 3)
        away = np.linalg.norm(points - spheres[:, None, :3], axis=2).max(axis=1)
        assert (away <= spheres[:, 3] * (1 + 1e-12)).all()


def test_normal_cones_hold_the_normals():
    t = np.linspace(0.01, 0.99, 15)
    for patches, _ in SHAPES.values():
        cones = normal_cones(patches.control_points)
        normals = patches.normals(*np.meshgrid(t, t)).reshape(len(patches), -1, 3)
        cosine = np.einsum("pk,pnk->pn", cones[:, :3], normals)
        sine = np.sqrt(np.maximum(0, 1 - cosine**2))
        undecided = cones[:, 3] >= 1
        held = (sine <= np.minimum(cones[:, 3:], 1.0) + 1e-7) & (cosine > 0)
        assert held[~undecided].all()


def test_box_is_closed_on_itself():
    box = PatchSet.box((1, 2, 3), center=(9, 9, 9))
    adjacent = adjacency(box.control_points, np.zeros(6, int))
    assert (adjacent >= 0).all()
    for p, row in enumerate(adjacent):
        assert len(set(row)) == 4 and p not in row


def test_neighbours_belong_to_one_solid():
    """Boxes side by side share a face's edges, but not as one solid."""
    parts = setup(Body(PatchSet.box((1, 1, 1))), Body(PatchSet.box((1, 1, 1), center=(1, 0, 0))))
    adjacent = parts.blockers.adjacent
    assert (adjacent[:6] < 6).all() and (adjacent[6:] >= 6).all()


@pytest.mark.parametrize("radius", [1e-8, 1e-6, 1e-3])
def test_opposite_sides_of_a_thin_pole_are_two(radius):
    """Its sides are closer to each other than the tolerance that a scene of its length allows."""
    pole = PatchSet.cylinder((-9.0, 0.3, 1.0), (9.0, 0.3, 1.0), radius)
    adjacent = adjacency(pole.control_points, np.zeros(4, int))
    assert adjacent.tolist() == [[-1, (k + 1) % 4, -1, (k - 1) % 4] for k in range(4)]


def test_sphere_has_no_neighbour_at_its_poles():
    adjacent = adjacency(PatchSet.sphere((0, 0, 0), 1.0).control_points, np.zeros(8, int))
    assert ((adjacent < 0).sum(axis=1) == 1).all()


def test_three_patches_on_one_edge_have_no_neighbour_there():
    a = rectangle((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    b = rectangle((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))
    c = rectangle((0, 0, 0), (1, 0, 0), (1, -1, 0), (0, -1, 0))
    nets = PatchSet.concatenated(a, b, c).control_points
    assert (adjacency(nets, np.zeros(3, int)) == -1).all()


def test_refined_patches_stay_neighbours():
    parts = PatchSet.sphere((0, 0, 0), 1.0).refined()
    adjacent = adjacency(parts.control_points, np.zeros(len(parts), int))
    assert (adjacent < 0).sum() == 16  # the collapsed sides at the poles


@pytest.mark.parametrize(
    ("body", "bulging", "hollow"),
    [
        (Body(PatchSet.box((1, 2, 3))), True, False),
        (Body(PatchSet.box((1, 2, 3), inward=True)), False, True),
        (Body(PatchSet.sphere((0, 0, 0), 1)), True, False),
        (Body(PatchSet.sphere((0, 0, 0), 1, inward=True)), False, True),
        (closed_cylinder((0, 0, 0), (0, 1, 1), 0.3), True, False),
        (Body(PatchSet.torus((0, 0, 0), (0, 0, 1), 2, 0.5)), False, False),
        (Body(PatchSet.torus((0, 0, 0), (0, 0, 1), 2, 0.5, inward=True)), False, False),
        (Body(PatchSet.box((1, 2, 3), inward=True), False), False, False),
        (ceiling(0, 1, 0, 1, 0), False, False),
    ],
)
def test_convexity(body, bulging, hollow):
    blockers = setup(body).blockers
    assert blockers.bulging.tolist() == [bulging]
    assert blockers.hollow.tolist() == [hollow]


@pytest.mark.parametrize(
    ("patches", "bulging"),
    [
        (PatchSet.cylinder((0, 0, 0), (0, 0, 2), 0.3), True),
        (PatchSet.cylinder((0, 0, 0), (0, 0, 2), 0.3, inward=True), False),
        (PatchSet.sphere((0, 0, 0), 1.0).take([0, 1, 2]), True),
        (ceiling(0, 1, 0, 1, 0), False),  # flat: nothing to tell
    ],
)
def test_open_surfaces_of_one_side_may_be_convex(patches, bulging):
    parts, one_sided = setup(patches), np.ones(len(patches), bool)
    told = make_blockers(*parts, one_sided=one_sided)
    assert told.bulging.tolist() == [bulging]
    assert not told.hollow[0]
    one_sided[0] = False
    assert not make_blockers(*parts, one_sided=one_sided).bulging[0]


def test_an_l_shaped_room_is_no_convex_cavity():
    """Floor plan: a 2 x 2 square without its quarter; walls, floor and ceiling as rectangles."""
    plan = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    walls = [
        rectangle((*a, 0), (*a, 1), (*b, 1), (*b, 0))
        for a, b in zip(plan, plan[1:] + plan[:1], strict=False)
    ]
    floors = [ceiling(0, 2, 0, 1, 0).flipped(), ceiling(0, 1, 1, 2, 0).flipped()]
    tops = [ceiling(0, 2, 0, 1, 1), ceiling(0, 1, 1, 2, 1)]
    room = Body(PatchSet.concatenated(*walls, *floors, *tops))
    assert not setup(room).blockers.hollow[0]
