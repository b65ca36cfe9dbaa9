"""Cells between edges of several cubics each: lines from joint to joint instead of two beside."""

from __future__ import annotations

import itertools

import cadquery as cq
import numpy as np
import pytest
from patchlight.importers import from_cadquery
from patchlight.importers.arcs import Chord, EdgeArc, EdgeSide
from patchlight.importers.cells import Cell
from patchlight.importers.chains import Piece
from patchlight.importers.curves import Line
from patchlight.importers.joined_arcs import BentArc
from patchlight.importers.quadrangulate import cells_of
from patchlight.importers.strips import joints, pieces, strips

ONE = np.ones(2)


def chord(p, q):
    return Chord(np.asarray(p, dtype=float), np.asarray(q, dtype=float), 0.0, ONE)


def net(p, q):
    out = np.ones((4, 4))
    out[:, :3] = np.append(p, 0.0) + np.arange(4)[:, None] / 3.0 * np.append(q - p, 0.0)
    return out


def edge(p, q, *at, index=7):
    """A straight edge from p to q in the plane, of one cubic between neighbouring shares."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    ends = [0.0, *at, 1.0]
    parts = [(a, b, net(p + a * (q - p), p + b * (q - p))) for a, b in itertools.pairwise(ends)]
    piece = Piece(0.0, 1.0, net(p, q), False, parts=parts if at else [])
    return EdgeArc.of(EdgeSide(Line(p, q - p), np.zeros(2), index), piece, ONE)


def square(below, above, turned=False):
    """The unit square between two edges with joints; of ``above`` from the right to the left."""
    four = (
        edge((0, 0), (1, 0), *below), chord((1, 0), (1, 1)),
        edge((1, 1), (0, 1), *above), chord((0, 1), (0, 0)),
    )  # fmt: skip
    return Cell((*four[3:], *four[:3])) if turned else Cell(four)


@pytest.mark.parametrize("turned", [False, True])
def test_neighbouring_joints_share_a_line(turned):
    # Seen from the left 0.25, 0.5 below and 0.2, 0.52, 0.9 above: the last one is alone.
    found = strips([square((0.25, 0.5), (0.1, 0.48, 0.8), turned)], chord)
    assert len(found) == 3
    k = int(turned)
    starts = [c.sides[k].start[0] for c in found]
    ends = [c.sides[k + 2].end[0] for c in found]
    np.testing.assert_allclose(starts, [0.0, 0.25, 0.5], atol=1e-15)
    np.testing.assert_allclose(ends, [0.0, 0.2, 0.52], atol=1e-15)
    assert [joints(c.sides[k]) for c in found] == [[], [], []]
    lone = [joints(c.sides[k + 2]) for c in found]
    assert lone[1:] == [[], []] or lone[:2] == [[], []]
    assert sum(map(len, lone)) == 1
    for a, b in itertools.pairwise(found):
        right, left = a.sides[(k + 1) % 4], b.sides[(k + 3) % 4]
        np.testing.assert_array_equal(right.p, left.q)
        np.testing.assert_array_equal(right.q, left.p)
    # The cubics themselves are the edge's, bit for bit.
    whole = square((0.25, 0.5), (0.1, 0.48, 0.8), turned).sides[k]
    np.testing.assert_array_equal(found[1].sides[k].net, whole.parts[1][2])


def test_joints_that_are_equal_far_apart_or_alone_are_left():
    for below, above in (((0.3,), (0.7,)), ((0.2,), (0.2,)), ((), (0.4,))):
        cell = square(below, above)
        assert strips([cell], chord) == [cell]


def test_lines_that_lean_too_much_are_left():
    # A flat cell: from 0.35 below to 0.45 above at a hundredth of the width the line leans by 84
    # degrees.
    below, above = edge((0, 0), (1, 0), 0.35), edge((1, 0.01), (0, 0.01), 0.55)
    cell = Cell((below, chord((1, 0), (1, 0.01)), above, chord((0, 0.01), (0, 0))))
    assert strips([cell], chord) == [cell]


def test_arcs_of_two_pieces_are_cut_where_these_meet_or_not():
    arc = BentArc(edge((0, 0), (1, 0), 0.5), edge((1, 0), (3, 0), 0.5, index=8), 1.0 / 3.0)
    assert joints(arc) == pytest.approx([1 / 6, 1 / 3, 2 / 3])
    one = pieces(arc, [arc.share])
    assert [p.edge for p in one] == [7, 8] and [len(p.parts) for p in one] == [2, 2]
    first, second = pieces(arc, [joints(arc)[0]])
    assert first.net is not None and isinstance(second, BentArc)
    np.testing.assert_allclose(second.at(np.array([0.0, second.share, 1.0]))[:, 0], [0.5, 1, 3])
    assert second.share == pytest.approx(0.2)


def test_five_sides_are_cut_from_a_corner_to_a_joint_across():
    # A house with a joint in its floor below the ridge.
    loop = [
        edge((0, 0), (2, 0), 0.25, 0.5, 0.75), chord((2, 0), (2, 1)),
        chord((2, 1), (1, 1.8)), chord((1, 1.8), (0, 1)), chord((0, 1), (0, 0)),
    ]  # fmt: skip
    cells = cells_of([loop], chord, planar=False)
    assert len(cells) == 2
    assert all(len([s for s in c.sides if s is not None]) == 4 for c in cells)
    lines = [s for c in cells for s in c.sides if isinstance(s, Chord)]
    inner = [s for s in lines if {tuple(s.p), tuple(s.q)} == {(1.0, 0.0), (1.0, 1.8)}]
    assert len(inner) == 2


def test_a_pillar_between_two_cylinders_takes_few_patches():
    # Between rims of one saddle above and another one, turned, below: 33 patches with straight
    # cuts at all joints.
    pillar = cq.Workplane().circle(1).extrude(8).translate((0, 0, -4))
    above = cq.Workplane("XZ").center(0, 4).circle(1.6).extrude(3, both=True)
    below = cq.Workplane("XZ").center(0, -4).circle(2.4).extrude(4, both=True)
    model = from_cadquery(pillar.cut(above).cut(below.rotate((0, 0, 0), (0, 0, 1), 17)))
    assert len(model.faces) == 3
    assert max(model.faces, key=lambda f: f.area_m2).patches <= 30
    for f in model.faces:
        assert f.angle_deg <= 1.0 and f.area_error < 1e-4 and f.reason == "trimmed curved surface"
