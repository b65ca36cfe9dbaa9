"""Faces with many holes: corners between neighbours, limits that grow with them."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from patchlight.importers import assemble, from_cadquery
from patchlight.importers.cells import quality, samples_of
from patchlight.importers.chains import chain
from patchlight.importers.convert import MISSED
from patchlight.importers.curved_domain import curved_domain, turned_hole
from patchlight.importers.edge_gaps import Measure, measured
from patchlight.importers.extract import Extractor, faces_of
from patchlight.importers.joined_arcs import BentArc
from patchlight.importers.mesh import _segment
from patchlight.importers.side_curves import Parted
from patchlight.importers.triangulate import signed_area

from .many_solids import shade

W = cq.Workplane


def drilled(angle_deg):
    """The outer face of a cylinder with a hole whose seam is turned by an angle, and its domain."""
    drill = cq.Solid.makeCylinder(0.3, 3.0, cq.Vector(1, 0, 0), cq.Vector(1, 0, 0))
    drill = drill.rotate(cq.Vector(0, 0, 0), cq.Vector(1, 0, 0), angle_deg)
    body = W().circle(2.0).extrude(2.0, both=True).rotate((0, 0, 0), (0, 0, 1), 100.0).cut(W(drill))
    extractor = Extractor(body.val().wrapped, 1e-6)
    raws = [extractor.face(face) for face in faces_of(body.val().wrapped)]
    raw = next(r for r in raws if getattr(r.surface, "radius", 0.0) == pytest.approx(2.0))
    measured([Measure(raw)])
    return raw, curved_domain(raw, raw.surface)


def corners_deg(loop):
    """Directions of the corners of a loop from its middle, within a quarter of a turn. [deg]"""
    p = np.array([a.start for a in loop])
    d = p - p.mean(axis=0)
    return np.degrees(np.arctan2(d[:, 1], d[:, 0])) % 90.0


def test_holes_have_their_corners_between_rows():
    _, domain = drilled(0.0)
    hole = domain.regions[0][1]
    assert len(hole) == 4  # not five, though the curve turns a little more than once around
    away = corners_deg(hole)
    assert np.minimum(away, 90.0 - away).max() < 3.0
    turned = turned_hole(hole)
    assert np.abs(corners_deg(turned) - 45.0).max() < 5.0
    assert turned_hole(turned) is turned
    # Corners that are there already stay.
    other = drilled(45.0)[1].regions[0][1]
    assert turned_hole(other) is other


def test_an_arc_of_two_pieces_runs_along_both():
    raw, domain = drilled(0.0)
    hole = domain.regions[0][1]
    turned = turned_hole(hole)
    s = np.linspace(0.0, 1.0, 101)
    fine = [np.concatenate([a.at(s)[:-1] * a.scale for a in loop]) for loop in (hole, turned)]
    # Polygons of 400 points of one and the same curve: 1e-4 of what they enclose.
    assert signed_area(fine[0]) == pytest.approx(signed_area(fine[1]), rel=1e-4)
    for arc, after in zip(turned, [*turned[1:], turned[0]], strict=True):
        assert isinstance(arc, BentArc)
        assert np.abs(arc.end - after.start).max() < 1e-12
        back = arc.reversed()
        assert np.abs(back.at(1.0 - s) - arc.at(s)).max() < 1e-12
        starts, ends, nets = (np.array(x) for x in zip(*arc.parts, strict=True))
        assert starts[0] == 0.0 and ends[-1] == 1.0 and (starts[1:] == ends[:-1]).all()
        parts = Parted({7: (starts, ends, nets)})
        own, rows = parts.rows(np.array([3, 7]))
        assert rows.tolist() == [1]
        uv = arc.at(s)
        on_surface = raw.surface.points(uv[:, 0], uv[:, 1])
        # The chain is within 1e-6 of the edge, and points along it within four times that.
        assert np.linalg.norm(parts.points(own, s[None])[0] - on_surface, axis=1).max() < 5e-6
    assert all(chain(use.edge) for uses in raw.loops for use in uses)


@pytest.mark.slow
def test_a_perforated_shade_is_within_tolerance():
    model = from_cadquery(shade(6, 24), cache=False)
    faces = [f for f in model.faces if f.patches > 100]
    assert len(faces) == 2
    for face in faces:
        assert face.reason != MISSED and face.angle_deg <= 1.0
        assert face.deviation_m < 1e-4 * 5e-3 and face.area_error < 1e-4
        # Four cells a hole meet its four corners, cut where pieces of its edge meet.
        assert face.patches <= 6 * 144


def test_the_check_of_the_kernel_is_left_out_of_many_loops(monkeypatch):
    plate = W().box(4, 4, 1).faces(">Z").workplane().rarray(1, 1, 3, 3).hole(0.4)
    assert not any(
        "left out" in note for note in from_cadquery(plate, cache=False).certificate.notes
    )
    monkeypatch.setattr(assemble, "MOST_LOOPS", 9)
    model = from_cadquery(plate, cache=False)
    assert any("10 boundary loops" in note for note in model.certificate.notes)
    # Nothing else vouches for the faces where areas are not checked.
    model = from_cadquery(plate, cache=False, check_areas=False)
    assert not any("left out" in note for note in model.certificate.notes)


@pytest.mark.parametrize("half_deg", [10, 60, 90, 110])
def test_quality_of_a_cell_between_a_curve_and_its_chord(half_deg):
    """Both of its other sides are points: none of its corners has an angle that counts."""
    half = np.radians(half_deg)
    angle = np.linspace(-half, half, 9)
    curve = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    chord = np.linspace(curve[-1], curve[0], 9)
    sides = [curve, np.repeat(curve[-1:], 9, axis=0), chord, np.repeat(curve[:1], 9, axis=0)]
    # Between tangents at the ends (sines of both angles) and straight across in the middle.
    assert quality(np.array([sides]))[0] > 0.4 * min(1.0, 2.0 * np.sin(half))
    assert quality(np.array([sides])[:, :, :, ::-1])[0] < 0.0


def test_three_sides_on_a_smooth_curve_and_its_chord_are_a_segment():
    _, domain = drilled(0.0)
    # Inside of the hole, for which its arcs run the other way.
    arcs = [a.reversed() for a in domain.regions[0][1][::-1]]
    first, second = arcs[0], arcs[1].halves()[0]
    scale = first.scale
    back = domain.chord(second.end / scale, first.start / scale)
    for turn in range(3):
        sides = [first, second, back]
        cell = _segment(sides[turn:] + sides[:turn])
        bent, *rest = cell.sides
        assert isinstance(bent, BentArc) and rest == [None, back, None]
        # The joint is where the lengths of a quarter and an eighth of a circle meet.
        assert bent.share == pytest.approx(2.0 / 3.0, abs=0.02)
        assert quality(samples_of([cell]))[0] > 0.4
    corner = domain.chord(first.end / scale, second.end / scale)
    assert _segment([first, corner, back]) is None
