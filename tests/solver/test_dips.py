"""Contours of patches that dip below the horizon inside, and the insides of hollow quadrics."""

import numpy as np
import pytest
from patchlight.solver.kernels.contour import enclosed, horizon_tolerance, shift_net
from patchlight.solver.kernels.patch_factor import patch_factor
from patchlight.solver.kernels.quadric import hollow
from patchlight.solver.model import PatchSet
from patchlight.solver.model.bezier import sub_net
from patchlight.solver.quadrics import fit_quadrics
from patchlight.solver.topology import normal_cones

from .test_quadrics import BODIES


@pytest.mark.parametrize("height", [1e-6, 1e-3, 0.1])
@pytest.mark.parametrize(
    "patches",
    [
        PatchSet.sphere((0, 0, 0), 1.0, inward=True),
        PatchSet.cylinder((0, 0, -1), (0, 0, 1), 1.0, inward=True),
        PatchSet.cone((0, 0, -1), (0, 0, 1), 1.2, 0.8, inward=True),
        PatchSet.torus((0, 0, 0), (0, 0, 1), 2.0, 1.0, inward=True),
    ],
    ids=["sphere", "cylinder", "cone", "torus"],
)
def test_close_above_a_hollow_patch(patches, height):
    """What dips below the horizon within its boundary: a patch is the sum of its parts."""
    net = patches.control_points[0].copy()
    x, n = patches.take([0]).evaluate(0.4, 0.55), patches.take([0]).normals(0.4, 0.55)
    x, n = x.reshape(3) + height * n.reshape(3), n.reshape(3).copy()

    def factor(part):
        nets = np.ascontiguousarray(part)[None]
        s = np.empty((4, 4, 4))
        shift_net(nets[0], x, s)
        quadric = fit_quadrics(net[None])[0]
        known = normal_cones(nets)[0], 0, quadric, 1e-9, horizon_tolerance(x)
        return patch_factor(s, x, n, *known)

    ends = np.linspace(0.0, 1.0, 6)
    sides = list(zip(ends[:-1], ends[1:], strict=True))
    cells = [(*along_u, *along_v) for along_u in sides for along_v in sides]
    parts = sum(factor(sub_net(net, *cell)) for cell in cells)
    assert 0.0 < factor(net) < 1.0
    assert factor(net) == pytest.approx(parts, abs=1e-7)


def test_what_a_contour_encloses():
    assert enclosed(0.3, False, 1e-6) == 0.3
    assert enclosed(-0.7, False, 1e-6) == pytest.approx(0.3)  # the long way round
    assert enclosed(1.4, False, 1e-6) == pytest.approx(0.4)
    assert enclosed(-1e-7, False, 1e-6) == 0.0
    # Some of it below: the lower hemisphere counts −1 where all of it is filled.
    assert enclosed(-0.97, True, 1e-6) == pytest.approx(0.03)
    assert enclosed(0.03, True, 1e-6) == 0.03
    # Nearly all or nearly nothing: not told.
    assert enclosed(1e-7, True, 1e-6) == -1.0 and enclosed(-1e-7, True, 1e-6) == -1.0


@pytest.mark.parametrize("name", BODIES)
def test_hollow_quadrics(name):
    """Insides of spheres and cylinders; of cones only one half is, which the form does not tell."""
    for quadric in fit_quadrics(BODIES[name].control_points):
        assert hollow(quadric) == name.startswith("hollow")
