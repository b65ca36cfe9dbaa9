"""White light in linear sRGB."""

import subprocess
import sys

import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.model.bands import LUMINANCE_WEIGHTS
from patchlight.solver.spectra import cct_to_rgb


def chromaticity(rgb):
    """x, y of linear sRGB by the matrix of IEC 61966-2-1."""
    matrix = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.array(matrix) @ rgb
    return xyz[:2] / xyz.sum()


@pytest.mark.parametrize(
    ("cct_k", "x", "y"),
    [
        (2856.0, 0.4476, 0.4074),  # illuminant A
        (5003.0, 0.3457, 0.3585),  # D50
        (5503.0, 0.3324, 0.3474),  # D55
        (6504.0, 0.3127, 0.3290),  # D65
        (7504.0, 0.2990, 0.3149),  # D75
    ],
)
def test_standard_illuminants(cct_k, x, y):
    # CIE 015 tabulates four digits; illuminant A uses an older c2, worth about 1 K here.
    assert chromaticity(cct_to_rgb(cct_k)) == pytest.approx([x, y], abs=2.5e-4)


def test_luminance_is_one_and_nothing_is_negative():
    for cct_k in (1000.0, 1500.0, 2000.0, 2700.0, 3999.9, 4000.0, 6500.0, 25000.0):
        rgb = cct_to_rgb(cct_k)
        assert rgb @ LUMINANCE_WEIGHTS == pytest.approx(1.0, abs=1e-14)
        assert (rgb >= 0.0).all()
        assert not rgb.flags.writeable


def test_warm_is_red_and_cold_is_blue():
    ratio = [cct_to_rgb(t)[0] / max(cct_to_rgb(t)[2], 1e-9) for t in (2000, 3000, 5000, 9000)]
    assert ratio == sorted(ratio, reverse=True)


def test_out_of_range():
    with pytest.raises(InputError, match="cct_k = 900"):
        cct_to_rgb(900.0)
    with pytest.raises(InputError, match="nan"):
        cct_to_rgb(float("nan"))


def test_importing_loads_no_heavy_library():
    code = (
        "import sys, patchlight.solver.spectra, patchlight.solver.skies, "
        "patchlight.solver.containment, patchlight.solver.camera, patchlight.solver.raycast; "
        "print([m for m in ('colour', 'numba', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
