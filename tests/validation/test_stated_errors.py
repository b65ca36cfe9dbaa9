"""Stated errors hold at 95 % of the points of the scenes whose light is known."""

import numpy as np
import pytest

#: What solves in little time at the accuracies asked for.
QUICK = ("C2_rho50", "C3", "C3_surf", "CIE_5.3", "D2", "dome", "spheres")


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.3, 0.1])
def test_stated_errors_hold(accuracy):
    """In every scene, not only in all of them together."""
    from references import reference
    from stated_errors import cover

    for name in QUICK:
        one = reference(name)
        found = cover(one, accuracy, one.truth())
        assert found.covered >= 0.95, found
        assert found.rms_true <= accuracy, found


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.3, 0.1])
def test_stated_errors_of_a_straight_shadow(accuracy):
    """What an edge hides of elements in a row has errors of one sign, which add up.

    They are stated as if each were by itself, and hold at fewer points than elsewhere; they are
    still no more than twice too small, and no more than ten times too large in the median.
    """
    from references import reference
    from stated_errors import cover

    one = reference("CIE_5.7")
    found = cover(one, accuracy, one.truth())
    assert found.covered >= 0.75 and found.needed <= 2.0, found
    assert found.stated_to_true <= 10.0, found


def test_a_row_of_the_table():
    """Covered, needed and quotients by hand: errors of 1 and 3 % where 2 % are stated."""
    from stated_errors import compared

    truth = np.array([1.0, 1.0, 1.0, 1.0, 1e-4])
    values = np.array([1.01, 0.99, 1.01, 1.03, 9.0])
    found = compared(values, np.full(5, 0.02), truth, doubt=0.0)
    assert found["points"] == 4 and found["covered"] == 0.75
    assert found["needed"] == pytest.approx(1.5)
    assert found["stated_to_true"] == pytest.approx(2.0)
    assert found["rms_true"] == pytest.approx(np.sqrt(12e-4 / 4))
    # Granted what the truth itself may be off, all are covered.
    assert compared(values, np.full(5, 0.02), truth, doubt=0.0101)["covered"] == 1.0
