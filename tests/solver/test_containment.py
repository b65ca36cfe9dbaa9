"""Inside and outside of solids: boxes, curved bodies, bodies that touch, air."""

import numpy as np
import pytest
from patchlight.solver.containment import Containment, Volumes, buried, inside_solids
from patchlight.solver.errors import InputError
from patchlight.solver.model import PatchSet

from .fixtures_bodies import scene_of


def random_points(n, extent, seed=1):
    return np.random.default_rng(seed).uniform(-extent, extent, size=(n, 3))


def test_box():
    points = random_points(2000, 1.0)
    inside = inside_solids(scene_of((PatchSet.box((1, 1.2, 0.8)), "solid")), points)
    assert (inside == (np.abs(points) < [0.5, 0.6, 0.4]).all(axis=1)).all()


def test_sphere_with_faces_that_come_close():
    points = random_points(2000, 1.2)
    shell = np.random.default_rng(2).normal(size=(500, 3))
    shell /= np.linalg.norm(shell, axis=1, keepdims=True)
    points = np.concatenate([points, shell * (1 + 1e-9), shell * (1 - 1e-9)])
    inside = inside_solids(scene_of((PatchSet.sphere((0, 0, 0), 1.0), "solid")), points)
    assert (inside == (np.linalg.norm(points, axis=1) < 1.0)).all()


def test_torus():
    points = random_points(2000, 1.5)
    torus = PatchSet.torus((0, 0, 0), (0, 0, 1), 1.0, 0.4)
    inside = inside_solids(scene_of((torus, "solid")), points)
    ring = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1.0, points[:, 2])
    assert (inside == (ring < 0.4)).all()


def test_cavity_is_not_material():
    # A room as one solid: outer box, and an inner shell whose normals look into the cavity.
    walls = PatchSet.concatenated(PatchSet.box((4, 4, 4)), PatchSet.box((3, 3, 3), inward=True))
    points = random_points(1000, 2.2)
    inside = inside_solids(scene_of((walls, "solid")), points)
    outer = (np.abs(points) < 2.0).all(axis=1)
    cavity = (np.abs(points) < 1.5).all(axis=1)
    assert (inside == (outer & ~cavity)).all()


def test_overlapping_and_nested_solids_are_judged_one_by_one():
    big, small = PatchSet.sphere((0, 0, 0), 1.0), PatchSet.box((0.4, 0.4, 0.4), (0.2, 0, 0))
    scene = scene_of((big, "solid"), (small, "solid"))
    points = random_points(1000, 1.2)
    tester = Containment(scene)
    parts = tester.parts_at(points)
    assert ((parts >= 0) == (np.linalg.norm(points, axis=1) < 1.0)).all()


def test_air_and_sheets_are_not_material():
    scene = scene_of(
        (PatchSet.box((4, 4, 4), inward=True), "air"),
        (PatchSet.sphere((1, 1, 1), 0.5), "solid"),
        (PatchSet.box((1, 1, 1), (-1, -1, -1)), "sheet"),
    )
    points = random_points(1000, 3.0)
    inside = inside_solids(scene, points)
    assert (inside == (np.linalg.norm(points - 1.0, axis=1) < 0.5)).all()


def test_touching_boxes_bury_their_common_face():
    left, right = PatchSet.box((1, 1, 1)), PatchSet.box((1, 0.5, 0.5), (1, 0, 0))
    scene = scene_of((left, "solid"), (right, "solid"))
    yz = np.random.default_rng(3).uniform(-0.5, 0.5, size=(400, 2))
    nodes = np.column_stack([np.full(400, 0.5), yz])
    normals = np.tile([1.0, 0.0, 0.0], (400, 1))
    covered = (np.abs(yz) < 0.25).all(axis=1)
    for distance in (1e-9, 1e-6, 1e-4):
        assert (buried(scene, nodes, normals, distance) == covered).all()
        # the small box's side of the same plane is wholly covered
        assert buried(scene, nodes[covered], -normals[covered], distance).all()
    # Free faces stay free.
    top = np.column_stack([yz, np.full(400, 0.5)])
    assert not buried(scene, top, np.tile([0.0, 0.0, 1.0], (400, 1)), 1e-6).any()


def test_gap_within_the_distance_counts_as_contact():
    for gap, distance, expected in ((1e-5, 1e-4, True), (1e-3, 1e-4, False), (-1e-5, 1e-4, True)):
        plate = PatchSet.box((1, 1, 1e-5), (0, 0, 0.5 + gap + 0.5e-5))  # thinner than the distance
        scene = scene_of((PatchSet.box((1, 1, 1)), "solid"), (plate, "solid"))
        found = buried(scene, [[0.1, 0.2, 0.5]], [[0.0, 0.0, 1.0]], distance)
        assert found.tolist() == [expected]


def test_shaft_in_a_hole_is_buried_on_both_curved_faces():
    def tube(radius, inward):
        return PatchSet.cylinder((0, 0, 0), (0, 0, 1), radius, inward=inward)

    caps = [PatchSet.disk((0, 0, z), 0.5, (0, 0, 2 * z - 1)) for z in (0, 1)]
    shaft = PatchSet.concatenated(tube(0.5, False), *caps)
    # The hole's patches are turned by 30°, so that the two surfaces share no control point.
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    hole = tube(0.5, True).moved(turn)
    rest = PatchSet.cylinder((0, 0, 0), (0, 0, 1), 1.0)
    scene = scene_of((shaft, "solid"), (PatchSet.concatenated(hole, rest), "solid"))
    angle = np.linspace(0, 2 * np.pi, 97)
    radial = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(97)])
    nodes = 0.5 * radial + [0, 0, 0.37]
    assert buried(scene, nodes, radial, 1e-6).all()
    assert buried(scene, nodes, -radial, 1e-6).all()


def test_furniture_on_the_floor_of_an_air_volume():
    room = PatchSet.box((4, 4, 3), (0, 0, 1.5), inward=True)
    table = PatchSet.box((1, 1, 1), (0.5, 0.3, 0.5))
    scene = scene_of((room, "air"), (table, "solid"))
    nodes = [[0.5, 0.3, 0.0], [-1.0, -1.0, 0.0], [0.5, 0.3, 0.0], [0.5, 0.3, 1.0]]
    normals = [[0, 0, 1.0], [0, 0, 1.0], [0, 0, -1.0], [0, 0, 1.0]]
    assert buried(scene, nodes, normals, 1e-6).tolist() == [True, False, True, False]


def test_own_concave_faces_are_free():
    torus = PatchSet.torus((0, 0, 0), (0, 0, 1), 1.0, 0.4)
    nodes = torus.evaluate(0.3, 0.6)
    assert not buried(scene_of((torus, "solid")), nodes, torus.normals(0.3, 0.6), 1e-7).any()


def test_air_volumes_are_found_by_their_inward_faces():
    points = random_points(500, 1.0)
    room = (PatchSet.box((1, 1.2, 0.8), inward=True), "air")
    volumes = Volumes.of_air(scene_of(room, (PatchSet.box((3, 3, 3)), "solid")))
    inside = (np.abs(points) < [0.5, 0.6, 0.4]).all(axis=1)
    np.testing.assert_array_equal(volumes.parts_at(points), np.where(inside, 0, -1))
    assert Volumes.of_air(scene_of((PatchSet.box((3, 3, 3)), "solid"))) is None


def test_bad_input():
    scene = scene_of((PatchSet.box((1, 1, 1)), "solid"))
    with pytest.raises(InputError, match="distance"):
        buried(scene, [[0, 0, 0.5]], [[0, 0, 1]], 0.0)
    with pytest.raises(InputError, match="points"):
        inside_solids(scene, [0.0, 0.0, 0.0])
    assert inside_solids(scene, np.zeros((0, 3))).shape == (0,)


def test_nothing_covers_the_wall_of_one_cavity():
    """The mesher knows without asking; beside another solid it asks."""
    from patchlight.solver.mesher import CONTACT, Mesher
    from patchlight.solver.stages import Stages

    from .fixtures_light import Body, scene, setup

    room = Body(PatchSet.box((4, 3, 2), inward=True))
    block = Body(PatchSet.box((1, 1, 1), center=(0, 0, -0.5)))
    x, n = np.array([[0.3, 0.2, -1.0], [1.5, 0.2, -1.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
    for bodies, expected in (((room,), [False, False]), ((room, block), [True, False])):
        parts = setup(*bodies)
        data = scene(parts)
        mesher = Mesher(data, parts.blockers, trace=True, stages=Stages())
        assert mesher.buried(x, n).tolist() == expected
        assert Containment(data).buried(x, n, CONTACT * 5.0).tolist() == expected
