"""Patches on quadrics: which are, the side seen, and their exact silhouettes."""

import math

import numpy as np
import pytest
from patchlight.solver import PatchSet, point_form_factors
from patchlight.solver.kernels.contour import horizon_tolerance, shift_net
from patchlight.solver.kernels.nets import normal_cone
from patchlight.solver.kernels.patch_factor import patch_factor
from patchlight.solver.kernels.quadric import polar_plane, side_values
from patchlight.solver.model.bezier import tangents
from patchlight.solver.quadrics import fit_quadrics, heights_over, turned

from .test_contour import random_net

BODIES = {
    "sphere": PatchSet.sphere((1.0, 2.0, 3.0), 0.7),
    "hollow sphere": PatchSet.sphere((1.0, 2.0, 3.0), 0.7, inward=True),
    "cylinder": PatchSet.cylinder((0.0, 0.0, 0.0), (0.3, 0.2, 1.0), 0.4),
    "hollow cylinder": PatchSet.cylinder((0.0, 0.0, 0.0), (0.3, 0.2, 1.0), 0.4, inward=True),
    "cone": PatchSet.cone((0.0, 0.0, 0.0), (0.3, 0.2, 1.0), 0.4, 0.1),
    "pointed cone": PatchSet.cone((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.0),
    "thin pole": PatchSet.cylinder((0.0, 0.0, 0.0), (0.3, 0.2, 4.0), 1e-4),
}


def stretched():
    """An ellipsoid, turned: affine images of quadrics are quadrics."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    net = PatchSet.sphere((0.0, 0.0, 0.0), 1.0).control_points.copy()
    net[..., :3] = net[..., :3] @ (np.diag([1.0, 0.5, 0.2]) @ turn) + 0.3 * net[..., 3:]
    return net


@pytest.mark.parametrize("name", BODIES)
def test_surfaces_of_cad_are_quadrics(name):
    nets = BODIES[name].control_points
    quadrics = fit_quadrics(nets)
    assert (quadrics[:, 4, 3] > 0.0).all()
    u = np.linspace(0.05, 0.95, 7)
    for net, quadric in zip(nets, quadrics, strict=True):
        points, su, sv = tangents(net, u, u[::-1])
        size = 2.0 / quadric[4, 3]
        np.testing.assert_allclose(heights_over(quadric, points), 0.0, atol=1e-12 * size)
        out = np.cross(su, sv)
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        # A thousandth of the radius above the surface it is that height, to first order.
        step = 1e-3 * (1e-4 if name == "thin pole" else 0.1)
        above = heights_over(quadric, points + step * out)
        np.testing.assert_allclose(above, step, rtol=0.02)


def test_other_surfaces_are_not():
    rng = np.random.default_rng(2)
    nets = np.concatenate(
        [
            PatchSet.torus((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, 0.3).control_points,
            PatchSet.box((1.0, 2.0, 3.0)).control_points,  # planes: there is nothing to gain
            np.stack([random_net(rng) for _ in range(5)]),
        ]
    )
    assert not fit_quadrics(nets).any()


def test_an_ellipsoid_is_one():
    assert (fit_quadrics(stretched())[:, 4, 3] > 0.0).all()


@pytest.mark.parametrize("name", BODIES)
def test_side_seen_is_that_of_the_normals(name):
    """The Bernstein coefficients of the polar plane have the sign of the receiver's height."""
    rng = np.random.default_rng(3)
    nets = BODIES[name].control_points
    s, f, polar = np.empty((4, 4, 4)), np.empty((4, 4)), np.empty(4)
    u = np.linspace(0.1, 0.9, 5)
    for net, quadric in zip(nets, fit_quadrics(nets), strict=True):
        x = rng.normal(0.0, 3.0, 3)
        shift_net(net, x, s)
        assert polar_plane(quadric, x, polar)
        low, high, _ = side_values(s, polar, f)
        points, su, sv = tangents(net, u, u)
        height = np.einsum("mk,mk->m", x - points, np.cross(su, sv))
        at = np.concatenate([points - x, np.ones((5, 1))], axis=1) @ polar
        assert (np.sign(at) == np.sign(height)).all()
        assert not (low > 0.0 and at.min() <= 0.0) and not (high < 0.0 and at.max() >= 0.0)


def factors(nets, x, n, eps, quadrics):
    s, cone = np.empty((4, 4, 4)), np.empty(4)
    x, n = np.asarray(x, float), np.asarray(n, float)
    total = []
    for net, quadric in zip(nets, quadrics, strict=True):
        shift_net(net, x, s)
        normal_cone(s, cone)
        total.append(patch_factor(s, x, n, cone, 0, quadric, eps, horizon_tolerance(x)))
    return np.array(total)


def askew(count):
    rng = np.random.default_rng(4)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rng.normal(0.0, 2.0, (count, 3)) + (0.5, 1.0, 1.5), normals


def factors_at(nets, points, normals, fit):
    quadrics = fit(nets)
    return np.array(
        [factors(nets, x, n, 1e-9, quadrics) for x, n in zip(points, normals, strict=True)]
    )


@pytest.mark.parametrize("name", [*BODIES, "ellipsoid"])
def test_lies_in_proved_brackets(name):
    patches = PatchSet(stretched()) if name == "ellipsoid" else BODIES[name]
    points, normals = askew(20)
    exact = factors_at(patches.control_points, points, normals, fit_quadrics)
    proof = point_form_factors(points, normals, patches, accuracy=1e-4, visibility="none")
    # The accuracy asked for, and the absolute accuracy of brackets.
    assert (exact >= proof.low * (1.0 - 2e-9) - 2e-12).all()
    assert (exact <= proof.high * (1.0 + 2e-9) + 2e-12).all()


@pytest.mark.parametrize("name", ["sphere", "cylinder", "hollow cylinder", "cone", "ellipsoid"])
def test_equals_quartering(name):
    """The silhouette as a conic, and the one found by quartering and Newton's iteration."""
    nets = stretched() if name == "ellipsoid" else BODIES[name].control_points
    quadrics = fit_quadrics(nets)
    for x, n in zip(*askew(20), strict=True):
        exact = factors(nets, x, n, 1e-9, quadrics)
        other = factors(nets, x, n, 1e-9, np.zeros_like(quadrics))
        # Quartering leaves chords in the corners of silhouettes: eps^(1/4) there, fourth power.
        np.testing.assert_allclose(exact, other, rtol=1e-6, atol=2e-9)


@pytest.mark.parametrize("distance", [1.001, 1.1, 2.0, 30.0, 1e4])
@pytest.mark.parametrize("tilt", [0.0, 40.0, 80.0, 95.0])
def test_sphere_of_eight_patches(distance, tilt):
    """F of a sphere of radius r at distance d, tilted by θ [Howell B-43], to ten digits of itself.

    Far away, coordinates of size d have rounding d/r larger than those of the sphere.
    """
    sphere = PatchSet.sphere((0.0, 0.0, 0.0), 1.0)
    out = np.array([0.36, 0.48, 0.8])
    side = np.array([0.8, -0.6, 0.0])
    a = math.radians(tilt)
    n = -math.cos(a) * out + math.sin(a) * side
    found = point_form_factors(distance * out, n, sphere, accuracy=1e-9).value.sum()
    h = distance
    if a < math.pi / 2 - math.asin(1.0 / h):
        truth = math.cos(a) / h**2
    elif a >= math.pi / 2 + math.asin(1.0 / h):
        truth = 0.0
    else:
        root = math.sqrt(h * h - 1.0)
        c, s = math.cos(a), math.sin(a)
        truth = 0.5 - math.asin(min(root / (h * s), 1.0)) / math.pi
        truth += (
            c * math.acos(min(max(-root * c / s, -1.0), 1.0))
            - root * math.sqrt(max(1.0 - h * h * c * c, 0.0))
        ) / (math.pi * h * h)
    assert found == pytest.approx(truth, rel=max(1e-9, 3e-14 * h), abs=1e-13)


def test_whole_sphere_from_within():
    """From any point inside, a hollow sphere is all there is to see."""
    sphere = PatchSet.sphere((0.0, 0.0, 0.0), 1.0, inward=True)
    rng = np.random.default_rng(5)
    points = rng.normal(size=(20, 3))
    points *= 0.9 * rng.random((20, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    found = point_form_factors(points, rng.normal(size=(20, 3)), sphere, accuracy=1e-9)
    np.testing.assert_allclose(found.value.sum(axis=1), 1.0, atol=1e-10)


def test_turned_sees_the_other_side():
    nets = BODIES["sphere"].control_points
    quadrics = fit_quadrics(nets)
    other = turned(quadrics, np.array([True] * 4 + [False] * (len(nets) - 4)))
    np.testing.assert_array_equal(other[:4, :4], -quadrics[:4, :4])
    np.testing.assert_array_equal(other[4:], quadrics[4:])
    # The centre is inside: the backs are seen, or the fronts of the turned.
    polar, x = np.empty(4), np.array([1.0, 2.0, 3.0])
    for k, quadric in enumerate(other):
        polar_plane(quadric, x, polar)
        assert (polar[3] > 0.0) == (k < 4)
