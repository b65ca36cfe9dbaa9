"""Shares of reflection: what a material may be made of, and what follows from it."""

import numpy as np
import pytest
from patchlight.solver.errors import InputError, PatchlightError
from patchlight.solver.model import Material


def test_shares_are_kept_apart_and_scattered_together():
    m = Material((0.1, 0.2, 0.3), specular=0.25, exponent=200, mirror=(0.4, 0.3, 0.2))
    assert np.allclose(m.scattered_bands, (0.35, 0.45, 0.55))
    assert np.allclose(m.mirror_bands, (0.4, 0.3, 0.2))
    assert m.is_glossy and m.is_mirror
    assert not Material(0.5).is_glossy and not Material(0.5).is_mirror


@pytest.mark.parametrize(
    "shares",
    [
        {"reflectance": 0.5, "specular": 0.4, "mirror": 0.2},
        {"reflectance": (0.2, 0.9, 0.1), "specular": 0.2},
        {"reflectance": 0.0, "mirror": 1.2},
        {"specular": -0.1},
        {"specular": 0.1, "exponent": 0.5},
        {"specular": 0.1, "exponent": float("nan")},
    ],
)
def test_more_than_all_light_or_less_than_none_is_an_error(shares):
    with pytest.raises(InputError, match="Material"):
        Material(**shares)
    assert issubclass(InputError, PatchlightError)


def test_all_light_may_be_reflected():
    Material(0.3, specular=0.3, mirror=0.4)


def test_grey_is_asked_of_every_share():
    assert Material(0.5, specular=0.1, mirror=0.2).is_grey
    assert not Material(0.5, specular=(0.1, 0.1, 0.2)).is_grey
    assert not Material(0.0, mirror=(0.9, 0.7, 0.4)).is_grey


def test_a_coloured_mirror_never_gives_more_than_is_left():
    m = Material((0.6, 0.0, 0.0), mirror=(0.4, 1.0, 1.0))
    assert m.luminous_mirror == pytest.approx(0.4)  # its luminance is 0.87, but red leaves 0.4
    assert Material(0.0, mirror=0.8).luminous_mirror == pytest.approx(0.8)
