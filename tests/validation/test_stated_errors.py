"""Stated errors hold at 95 % of the points of the scenes whose light is known."""

import numpy as np
import pytest

#: What solves in little time at the accuracies asked for.
QUICK = (
    "A4",
    "B",
    "C2_rho50",
    "C2_rho80",
    "C3",
    "C3_surf",
    "CIE_5.3",
    "CIE_5.7",
    "D2",
    "D2_clear",
    "G",
    "Ward",
    "dome",
    "spheres",
)
#: Root mean square below which the true error is none to speak of.
NONE = 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.3, 0.1])
def test_stated_errors_hold(accuracy):
    """In every scene, not only in all of them together, and are no more than ten times too large.

    That is the median of the scenes' medians; where errors of one sign happen to cancel, a scene
    may have more.
    """
    from references import reference
    from stated_errors import cover

    over = []
    for name in QUICK:
        one = reference(name)
        found = cover(one, accuracy, one.truth())
        assert found.covered >= 0.95, found
        assert found.rms_true <= accuracy, found
        if found.rms_true > NONE:
            assert found.stated_to_true <= 20.0, found
            over.append(found.stated_to_true)
        else:
            assert found.rms_stated <= 10.0 * NONE, found
    assert np.median(over) <= 10.0, over


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["bilinear", "constant"])
def test_stated_errors_hold_below_a_lamp_that_hides_what_it_lights(basis):
    """Before what elements send was told by what is seen of them, a third were off by more."""
    from patchlight.pipeline import simulate
    from references import reference
    from stated_errors import compared

    one = reference("G")
    for accuracy in (0.03, 0.02):
        result = simulate(one.scene(), accuracy=accuracy, basis=basis, cache=False)
        found = result.sensors["sensors"]
        told = compared(found.illuminance_lx, found.error_lx, one.truth(), one.doubt)
        assert told["covered"] >= 0.95, (accuracy, told)


@pytest.mark.parametrize(
    ("name", "accuracy"),
    [
        # Silhouettes of a tube, curved elements from afar, a bent lamp near few sensors, and a disc
        # whose light is even on the sky and not on a plane.
        ("A4", 0.1),
        ("A3", 0.03),
        ("C2_rho50", 0.03),
        ("C2_rho80", 0.3),
        ("D3", 0.3),
        ("D3", 0.001),
    ],
)
def test_stated_errors_of_rules_hold(name, accuracy):
    """At 95 %, and they are not more than ten times the true ones in the median."""
    from patchlight.pipeline import simulate
    from references import reference
    from stated_errors import compared

    one = reference(name)
    found = simulate(one.scene(), accuracy=accuracy, cache=False).sensors["sensors"]
    figures = compared(found.illuminance_lx, found.error_lx, one.truth(), one.doubt)
    assert figures["covered"] >= 0.95, figures
    assert figures["stated_to_true"] <= 10.0, figures


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
