"""Lines inside a face are the same on both sides, however the patches beside them were cut."""

from __future__ import annotations

import numpy as np
from patchlight.importers.arcs import Chord
from patchlight.importers.cuts import Cuts
from patchlight.importers.joints import mended
from patchlight.importers.quadrangulate import cells_of
from patchlight.solver.model.bezier import bernstein, split_matrix

ONE = np.ones(2)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def sides(corners):
    """Chords around a square, run in the direction of +s or +t."""
    a, b, c, d = np.asarray(corners, dtype=float)
    return [Chord(p, q, 0.0, ONE) for p, q in ((a, b), (b, c), (d, c), (a, d))]


def test_a_cut_of_one_cell_is_one_of_all_cells_of_its_strip():
    # Three squares in a row; the last one has its corners the other way round.
    row = [sides(SQUARE), sides(SQUARE + [1, 0]), sides(SQUARE[[2, 3, 0, 1]] + [2, 0])]
    cuts = Cuts({(0, 1): [np.array([0.3])]}, np.zeros(3, dtype=np.int64), row)
    whole = np.tile([0.0, 1.0, 0.0, 1.0], (3, 1))
    middles = cuts.middles(np.arange(3), whole)
    np.testing.assert_allclose(middles, [[0.5, 0.3], [0.5, 0.3], [0.5, 0.7]], rtol=1e-14)
    # Where no place is left inside, a box is halved.
    above = cuts.middles(np.array([1]), np.array([[0.0, 1.0, 0.3, 1.0]]))
    np.testing.assert_allclose(above, [[0.5, 0.65]], rtol=1e-14)


def test_nobody_else_is_cut_there():
    other_face = np.array([0, 1])
    row = [sides(SQUARE), sides(SQUARE + [1, 0])]
    cuts = Cuts({(0, 1): [np.array([0.3])]}, other_face, row)
    box = np.tile([0.0, 1.0, 0.0, 1.0], (2, 1))
    np.testing.assert_allclose(cuts.middles(np.arange(2), box), [[0.5, 0.3], [0.5, 0.5]])


def bumpy(seed, box):
    """Net over a box of the unit square that is off the plane by a little."""
    s0, s1, t0, t1 = box
    x = s0 + (s1 - s0) * np.arange(4) / 3.0
    y = t0 + (t1 - t0) * np.arange(4) / 3.0
    net = np.ones((4, 4, 4))
    net[..., 0], net[..., 1] = x[:, None], y[None, :]
    net[..., 2] = 1e-3 * np.random.default_rng(seed).random((4, 4))
    return net


def test_short_sides_follow_a_long_one_that_moves_itself():
    # The lower half is one patch; of the upper half the left part is one, and the right part,
    # whose side it meets, is two.
    box = np.array(
        [[0.0, 1.0, 0.0, 0.5], [0.0, 0.6, 0.5, 1.0], [0.6, 1.0, 0.5, 0.8], [0.6, 1.0, 0.8, 1.0]]
    )
    nets = np.array([bumpy(k, b) for k, b in enumerate(box)])
    zero = np.zeros(4, dtype=np.int64)
    mended(nets, np.arange(4), zero, zero, box, [sides(SQUARE)])
    long = nets[0][:, 3]
    for i, (a, b) in ((1, (0.0, 0.6)), (2, (0.6, 1.0))):
        np.testing.assert_allclose(nets[i][:, 0], split_matrix(a, b) @ long, atol=1e-14)
    upright = nets[1][3]
    for i, (a, b) in ((2, (0.0, 0.6)), (3, (0.6, 1.0))):
        np.testing.assert_allclose(nets[i][0], split_matrix(a, b) @ upright, atol=1e-14)


class Curved(Chord):
    """A chord that counts as a curve."""

    straight = False

    def halves(self):
        first, second = super().halves()
        return tuple(Curved(h.p, h.q, h.half, h.scale) for h in (first, second))


def test_ends_that_miss_each_other_a_little_cost_no_cells():
    # A pentagon whose sides end beside the start of the next one, as curves of the CAD kernel do.
    angle = 2.0 * np.pi * np.arange(5) / 5
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    off = 3e-8 * np.array([1.0, -1.0])
    loop = [Curved(corners[k], corners[(k + 1) % 5] + off, 0.0, ONE) for k in range(5)]
    cells = cells_of([loop], lambda p, q: Chord(p, q, 0.0, ONE), planar=False)
    assert len(cells) == 5 - 2 - 1  # three triangles, two of them paired


def test_corners_of_cells_stay_at_their_place():
    box = np.array([[0.0, 0.5, 0.0, 1.0], [0.5, 1.0, 0.0, 0.4], [0.5, 1.0, 0.4, 1.0]])
    nets = np.array([bumpy(k, b) for k, b in enumerate(box)])
    before = nets.copy()
    zero = np.zeros(3, dtype=np.int64)
    follows = mended(nets, np.arange(3), zero, zero, box, [sides(SQUARE)])
    assert follows == {1: [(0, 1)], 2: [(0, 1)]}
    np.testing.assert_array_equal(nets[0], before[0])
    # Only the joint moves, onto the long side.
    at = bernstein(np.array([0.4])) @ nets[0][3]
    np.testing.assert_allclose(nets[1][0, 3], at[0], atol=1e-14)
