"""Which lines of sight what has moved may be in the way of."""

import numpy as np


def places(*balls):
    """What stood, or stands, at balls, each a part of one patch."""
    from patchlight.solver.kernels.shafts import Places

    one = np.array([(0, 1)])
    return Places(np.array(balls), one, np.array(balls), one, np.array(balls))


def test_a_seat_in_between_is_met_and_one_behind_is_not():
    """A receiver that looks up, what it sees above, and balls beside, between and behind."""
    from patchlight.solver.kernels.shafts import Seen, find_touched_pairs

    def touched(ball, *, see=1.0, out=False, flat=False, square=0.0, up=1.0):
        """Whether the element of 1 m² at height 4 is touched, and its row."""
        half = 0.5 * square
        corners = [(-half, -half, 4.0), (-half, half, 4.0), (half, half, 4.0), (half, -half, 4.0)]
        seen = Seen(
            np.array([[0.0], [0.0], [4.0], [max(0.5, 1.5 * half)]]),
            np.array([[0.0, 0.0, -1.0, -4.0] if flat else [0.0, 0.0, 0.0, -np.inf]]),
            np.array([corners if flat else np.zeros((4, 3))]),
        )
        pairs, again = np.zeros((1, 1), dtype=bool), np.zeros(1, dtype=bool)
        find_touched_pairs(
            np.zeros((1, 1, 3)),
            np.array([[[0.0, 0.0, up]]]),
            np.zeros(1),
            np.array([[see]], dtype=np.float32),
            seen,
            places(ball),
            np.array([out]),
            pairs,
            again,
        )
        assert again[0] or not pairs[0, 0]
        return bool(pairs[0, 0]), bool(again[0])

    met, missed = (True, True), (False, False)
    assert touched([0.0, 0.0, 2.0, 0.1]) == met
    # The shaft is 0.5 / 4 of its height wide: at 2 it reaches to 0.25, and never below 0.
    assert touched([0.3, 0.0, 2.0, 0.1]) == met and touched([0.5, 0.0, 2.0, 0.1]) == missed
    assert touched([0.0, 0.0, -0.2, 0.1]) == missed and touched([0.0, 0.0, -0.05, 0.1]) == met
    assert touched([0.0, 0.0, 2.0, 0.1], up=-1.0) == missed
    assert touched([0.0, 0.0, 2.0, 0.1], see=0.0) == missed
    # What sees out sees any ball before it, if not in this element's shaft.
    assert touched([3.0, 0.0, 1.0, 0.1], out=True) == (False, True)
    assert touched([3.0, 0.0, 1.0, 0.1]) == missed
    assert touched([0.0, 0.0, -1.0, 0.5], out=True) == missed
    assert touched([0.0, 0.0, 6.0, 0.5]) == missed
    # Just above the element: near enough to its sphere, but behind its plane.
    assert touched([0.0, 0.0, 4.3, 0.2]) == met
    assert touched([0.0, 0.0, 4.3, 0.2], flat=True) == missed
    assert touched([0.0, 0.0, 3.8, 0.2], flat=True) == met
    # In the cone about a square of 2 m, which is 0.5 m wide on both sides at half of its height, or
    # 0.75 m as a sphere has it, but beside its pyramid.
    ball = [0.65, 0.0, 2.0, 0.1]
    assert touched(ball, flat=True, square=2.0) == missed
    assert touched(ball, square=2.0) == met
    assert touched([0.55, 0.0, 2.0, 0.1], flat=True, square=2.0) == met
