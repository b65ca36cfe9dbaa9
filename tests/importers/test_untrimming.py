"""Pieces of the conversion by themselves: curves in (u, v), triangles, cells, batches of faces."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from patchlight.importers import from_cadquery
from patchlight.importers.assemble import diagonal
from patchlight.importers.cells import quality, straight_quality
from patchlight.importers.convert import convert_faces
from patchlight.importers.curves import Conic, Line
from patchlight.importers.extract import Edge, EdgeUse, Extractor, faces_of
from patchlight.importers.mesh import Mesh
from patchlight.importers.planar_domain import planar_domain
from patchlight.importers.projected import projected
from patchlight.importers.surfaces import Round, SplineSurface
from patchlight.importers.together import SurfaceBatch
from patchlight.importers.triangulate import areas, nudged, overlapping, signed_area

from .many_solids import SOLIDS

AXES = (np.zeros(3), *np.eye(3))


def test_a_wrong_curve_on_a_surface_is_replaced_by_feet_of_the_edge():
    # A circle of the unit sphere about a tilted axis; the file gives its chord in (u, v).
    sphere = Round(AXES, "sphere", 1.0)
    center = 0.5 * np.array([math.cos(0.4), 0.0, math.sin(0.4)])
    x = np.array([0.0, 1.0, 0.0]) * math.sqrt(0.75)
    circle = Conic("ellipse", center, x, np.cross(center / 0.5, x))
    ends = circle.evaluate(np.array([0.2, 1.4]))
    uv = np.stack([np.arctan2(ends[:, 1], ends[:, 0]), np.arcsin(ends[:, 2])], axis=1)
    # Its parameter runs from 2 to 5 while that of the edge runs from 0.2 to 1.4.
    direction = (uv[1] - uv[0]) / 3.0
    edge = Edge(0, circle, 0.2, 1.4, 1e-4)
    use = EdgeUse(edge, Line(uv[0] - 2.0 * direction, direction), 2.0, 5.0, False, False)
    t = np.linspace(0.0, 1.0, 101)
    wanted = circle.evaluate(0.2 + 1.2 * t)

    def away(curve):
        p = curve.evaluate(2.0 + 3.0 * t)
        return np.linalg.norm(sphere.points(p[:, 0], p[:, 1]) - wanted, axis=1).max()

    assert away(use.curve) > 0.05
    for tolerance in (1e-3, 1e-6, 1e-9):
        # Checked at three points a piece: between them the error may be a little larger.
        (better,) = projected([use], SurfaceBatch([sphere]), np.array([0]), np.array([tolerance]))
        assert away(better) < 3.0 * tolerance


def test_overlapping_boxes_are_those_of_all_pairs():
    rng = np.random.default_rng(5)
    for n, m in ((1, 1), (40, 60), (7, 200)):
        # Multiples of 0.1, so that many ends coincide.
        low, other = rng.integers(0, 10, (n, 2)) / 10.0, rng.integers(0, 10, (m, 2)) / 10.0
        high = low + rng.integers(0, 4, (n, 2)) / 10.0
        other_high = other + rng.integers(0, 4, (m, 2)) / 10.0
        i, j = overlapping(low, high, other, other_high)
        meet = (low[:, None] <= other_high).all(axis=2) & (other <= high[:, None]).all(axis=2)
        np.testing.assert_array_equal(
            np.unique(np.stack([i, j], axis=1), axis=0), np.argwhere(meet)
        )
        assert len(i) == meet.sum()


def test_rows_of_equal_holes_are_triangulated():
    """Vertices of equal holes lie on common lines, which ear clipping alone loses."""
    loops = [np.array([[0.0, 0.0], [21.0, 0.0], [21.0, 11.0], [0.0, 11.0]])]
    angle = -2.0 * np.pi * np.arange(8) / 8
    ring = 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    loops += [ring + [1.0 + i, 1.0 + j] for i in range(20) for j in range(10)]
    _, chord = circles(1)
    arcs = [[chord(p, q) for p, q in zip(x, np.roll(x, -1, axis=0), strict=True)] for x in loops]
    mesh = Mesh(chord)
    assert mesh.update(arcs)
    assert len(mesh.triangles) == len(mesh.points) - 2 + 2 * 200
    area = areas(mesh.points, np.array(mesh.triangles))
    assert area.min() > -1e-12  # three vertices on a line
    total = sum(signed_area(np.array([a.start for a in loop])) for loop in arcs)
    assert area.sum() == pytest.approx(total, rel=1e-12)


def test_quality_of_straight_cells_needs_no_samples():
    rng = np.random.default_rng(2)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    corners = corners + rng.uniform(-0.4, 0.4, (200, 4, 2))
    t = np.linspace(0.0, 1.0, 9)[:, None]
    step = np.roll(corners, -1, axis=1) - corners
    sampled = quality(corners[:, :, None] + t * step[:, :, None])
    exact = straight_quality(corners)
    # Samples are taken in the middle of an 8 x 8 grid and at the corners themselves.
    np.testing.assert_allclose(exact, sampled, atol=1e-9)


def test_surfaces_evaluated_together_are_those_evaluated_alone():
    rng = np.random.default_rng(3)
    surfaces = [Round(AXES, "torus", 2.0, 0.5), Round(AXES, "cone", 1.0, 0.0, 0.3)]
    for spans, period in ((2, None), (5, None), (3, 3.0)):
        pieces = rng.random((spans, 2, 4, 3, 4)) + [0.0, 0.0, 0.0, 1.0]
        knots = np.linspace(-1.0, 2.0, spans + 1)
        surfaces.append(SplineSurface(knots, np.array([0.0, 0.3, 1.0]), pieces, "bspline",
                                      (period, None)))  # fmt: skip
    which = np.array([4, 2, 0, 3, 2, 1, 4])
    # Outside the knots too: on open splines the end pieces go on, on periodic ones all repeat.
    u, v = rng.uniform(-2.0, 3.0, (7, 5)), rng.uniform(0.0, 1.0, (7, 5))
    together = SurfaceBatch(surfaces)
    for row, k in enumerate(which):
        alone = surfaces[k].evaluate(u[row], v[row])
        for a, b in zip(together.evaluate(which, u, v), alone, strict=True):
            np.testing.assert_allclose(a[row], b, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(together.points(which, u, v)[row], alone[0], rtol=1e-12,
                                   atol=1e-12)  # fmt: skip


@pytest.mark.parametrize("name", ["crossing cylinders", "torus sector", "three-section loft"])
def test_faces_converted_together_are_those_converted_alone(name):
    shape = SOLIDS[name]().val().wrapped
    size = diagonal(shape)
    extractor = Extractor(shape, 0.25e-4 * size)
    raws = [extractor.face(f) for f in faces_of(shape)]
    together = convert_faces(raws, 1e-4 * size, 1.0, size)
    for raw, face in zip(raws, together, strict=True):
        (alone,) = convert_faces([raw], 1e-4 * size, 1.0, size)
        assert (alone.exact, alone.reason) == (face.exact, face.reason)
        np.testing.assert_allclose(alone.nets, face.nets, rtol=0.0, atol=1e-12 * size)
        np.testing.assert_array_equal(alone.edges, face.edges)


def test_a_face_that_fails_leaves_the_others_alone():
    box = cq.Workplane().box(1, 2, 3).edges().fillet(0.2).val().wrapped
    extractor = Extractor(box, 1e-4)
    raws = [extractor.face(f) for f in faces_of(box)]
    curved = next(i for i, raw in enumerate(raws) if raw.surface.kind == "cylinder")
    raws[curved].surface = Round(AXES, "cylinder", math.nan)
    found = convert_faces(raws, 1e-4, 1.0, 4.0)
    assert not len(found[curved].nets) and found[curved].reason
    assert all(len(f.nets) and f.exact for i, f in enumerate(found) if i != curved)


def perforated(across, along):
    """A plate with rows of holes, 2 mm apart and of radius 0.7 mm."""
    corners = ((-1, -1), (2 * across - 1, -1), (2 * across - 1, 2 * along - 1), (-1, 2 * along - 1))
    border = cq.Wire.makePolygon([cq.Vector(*c) for c in corners], close=True)
    up = cq.Vector(0, 0, 1)
    holes = [
        cq.Wire.makeCircle(0.7, cq.Vector(2 * i, 2 * j), up)
        for i in range(across)
        for j in range(along)
    ]
    return cq.Solid.extrudeLinear(border, holes, up)


@pytest.mark.parametrize(
    "rows", [(6, 5), pytest.param((40, 25), marks=pytest.mark.slow)], ids=["30", "1000"]
)
def test_rows_of_holes_take_few_patches(rows):
    model = from_cadquery(perforated(*rows), cache=False)
    assert model.certificate.faces_failed == 0
    count = rows[0] * rows[1]
    # Four corners a hole and those of the border make at least (4 + 4 h − 2 + 2 h) / 2 = 3 h + 1
    # cells; a tenth more where the border needs corners beside the holes.
    for face in model.faces:
        assert face.area_error < 1e-6
        if face.kind == "plane" and face.patches > 1:
            assert face.patches <= 1.1 * (3 * count + 1) + 2 * sum(rows)


def scattered(count):
    """A plate with holes of radius 0.7 mm at random places, some walls 0.05 mm thin."""
    rng = np.random.default_rng(3)
    size = 1.9 * math.sqrt(count)
    centers = np.zeros((0, 2))
    while len(centers) < count:
        place = rng.uniform(0.0, size, 2)
        if not len(centers) or np.hypot(*(centers - place).T).min() > 1.45:
            centers = np.vstack([centers, place])
    corners = ((-1, -1), (size + 1, -1), (size + 1, size + 1), (-1, size + 1))
    border = cq.Wire.makePolygon([cq.Vector(*c) for c in corners], close=True)
    up = cq.Vector(0, 0, 1)
    return cq.Face.makeFromWires(
        border, [cq.Wire.makeCircle(0.7, cq.Vector(*c), up) for c in centers.tolist()]
    )


@pytest.mark.parametrize("count", [60, pytest.param(600, marks=pytest.mark.slow)])
def test_holes_at_random_places_take_few_patches(count):
    model = from_cadquery(scattered(count), cache=False)
    (face,) = model.faces
    assert face.exact and face.area_error < 1e-6
    # Five and five a hole are what is allowed; halving all arcs for the sake of a few takes more.
    assert face.patches <= 4 * count + 5


def circles(count):
    """Arcs of a square plate with a row of holes, a quarter each."""
    model = cq.Face.makeFromWires(
        cq.Wire.makePolygon([cq.Vector(*c) for c in ((0, 0), (9, 0), (9, 2), (0, 2))], close=True),
        [
            cq.Wire.makeCircle(0.6, cq.Vector(1 + 1.5 * k, 1), cq.Vector(0, 0, 1))
            for k in range(count)
        ],
    )
    (raw,) = [Extractor(model.wrapped, 1e-6).face(f) for f in faces_of(model.wrapped)]
    domain = planar_domain(raw, raw.surface)
    return domain.regions[0], domain.chord


def test_a_mesh_follows_its_boundary():
    loops, chord = circles(5)
    mesh = Mesh(chord)
    assert mesh.update(loops)
    first = set(mesh.triangles)
    # One arc of a hole and one side of the plate are halved.
    halved = [loops[0][0], loops[1][0]]
    loops = [
        [part for a in loop for part in (a.halves() if a in halved else (a,))] for loop in loops
    ]
    assert mesh.update(loops)
    points = [np.array([a.start for a in loop]) for loop in loops]
    count = sum(len(p) for p in points)
    area = areas(mesh.points, np.array(mesh.triangles))
    assert len(mesh.triangles) == count - 2 + 2 * 5
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(sum(signed_area(p) for p in points), rel=1e-12)
    # What is far away is still the same, and everything is what one gets from the start.
    assert len(first & set(mesh.triangles)) > 0.5 * len(first)
    again = Mesh(chord)
    assert again.update(loops)

    def places(m):
        return {frozenset(map(tuple, m.points[list(t)].round(9).tolist())) for t in m.triangles}

    assert len(places(mesh) - places(again)) <= 4 * 5  # diagonals of squares, which are as good


def test_a_side_that_no_triangle_has_is_triangulated_anew():
    loops, chord = circles(2)
    mesh = Mesh(chord)
    assert mesh.update(loops)
    wanted = sum(areas(mesh.points, np.array(mesh.triangles)))
    # The first side of the plate, between the vertices 0 and 1, is cut.
    mesh._moved = [t for t in mesh._moved if not {0, 1} <= set(t)]
    loops[0] = [*loops[0][0].halves(), *loops[0][1:]]
    assert mesh.update(loops)
    assert sum(areas(mesh.points, np.array(mesh.triangles))) == pytest.approx(wanted, rel=1e-12)


def test_an_unexpected_key_fails_one_face_and_not_the_file(monkeypatch):
    def fails(*_):
        raise KeyError((3, 5))

    monkeypatch.setattr(Mesh, "update", fails)
    plate = cq.Workplane().box(9, 2, 1).faces(">Z").workplane().hole(0.6)
    model = from_cadquery(plate, cache=False)
    failed = [f for f in model.faces if f.failed]
    assert 0 < len(failed) < len(model.faces)
    assert all(f.reason == "unexpected geometry (KeyError: (3, 5))" for f in failed)


def test_displaced_rows_are_no_rows():
    """Vertices of equal holes are numbered in equal steps: their displacements are not."""
    k = np.arange(400)
    points = nudged(np.stack([k % 20, k // 20], axis=1).astype(float))
    for step in (1, 2, 19, 20, 21):
        a, b, c = (points[k[: 400 - 2 * step] + n * step] for n in range(3))
        turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        straight = np.abs(turn) < 1e-3
        assert straight.any()
        assert np.abs(turn[straight]).min() > 1e-12
