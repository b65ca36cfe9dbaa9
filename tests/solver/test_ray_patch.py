"""Ray against one patch: closed forms, an independent root search, edges, extreme scales."""

import math

import numpy as np
import pytest
from patchlight.solver.kernels.ray_patch import (
    FLAT_QUAD,
    GENERAL,
    HIT,
    MISS,
    WORK,
    classify_patches,
    ray_patch,
    ray_patch_any,
)
from patchlight.solver.model import PatchSet
from patchlight.solver.model.arrays import frozen
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, evaluate, sub_net


def cast(net, origin, direction, *, kind=GENERAL, t_min=0.0, t_max=1e9):
    return ray_patch(frozen(net), kind, *origin, *direction, t_min, t_max, np.empty(WORK))


def cast_all(patches, origin, direction, **bounds):
    """All patches one by one, without a tree: nearest (t, patch, facing)."""
    kinds = classify_patches(patches.control_points)
    best = (math.inf, -1, 0)
    for p, net in enumerate(patches.control_points):
        status, t, _, _, facing = cast(net, origin, direction, kind=kinds[p], **bounds)
        assert status in (MISS, HIT)
        if status == HIT and t < best[0]:
            best = (t, p, facing)
    return best


def random_rays(rng, n, radius, target):
    """Rays from a sphere of ``radius`` to points within ``target`` of the centre."""
    origins = rng.normal(size=(n, 3))
    origins *= radius / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-target, target, size=(n, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_sphere(scale):
    rng = np.random.default_rng(1)
    patches = PatchSet.sphere((0.0, 0.0, 0.0), scale)
    for o, d in zip(*random_rays(rng, 300, 2.5 * scale, 1.2 * scale), strict=False):
        b, c = o @ d, o @ o - scale**2
        discriminant = b * b - c
        t, _, facing = cast_all(patches, o, d)
        if discriminant > 0.0:
            root = math.sqrt(discriminant)
            # Rounding grows like 1/cosine at grazing hits.
            assert abs(t + b + root) * root <= 1e-13 * scale**2
            assert facing == 1
        else:
            assert t == math.inf


def test_cylinder_from_inside_and_outside():
    rng = np.random.default_rng(2)
    patches = PatchSet.cylinder((0, 0, -1), (0, 0, 1), 0.5)
    for inside in (True, False):
        for o, d in zip(*random_rays(rng, 200, 0.3 if inside else 2.0, 0.6), strict=False):
            a, b, c = d[:2] @ d[:2], o[:2] @ d[:2], o[:2] @ o[:2] - 0.25
            discriminant = b * b - a * c
            roots = []
            if discriminant > 0.0:
                roots = [(-b + s * math.sqrt(discriminant)) / a for s in (-1, 1)]
            roots = [t for t in roots if t > 0.0 and abs(o[2] + t * d[2]) <= 1.0]
            t, _, facing = cast_all(patches, o, d)
            if roots:
                assert abs(t - min(roots)) * math.sqrt(discriminant) <= 1e-12
                n = (o + t * d)[:2] @ d[:2]
                assert facing == (1 if n < 0.0 else -1)
            else:
                assert t == math.inf


def test_torus():
    rng = np.random.default_rng(3)
    major, minor = 1.0, 0.35
    patches = PatchSet.torus((0, 0, 0), (0, 0, 1), major, minor)
    for o, d in zip(*random_rays(rng, 200, 3.0, 1.2), strict=False):
        # (|x|² + R² − r²)² = 4 R² (x² + y²) along the ray
        q = np.polynomial.Polynomial([o @ o + major**2 - minor**2, 2 * (o @ d), 1.0])
        xy = np.polynomial.Polynomial([o[:2] @ o[:2], 2 * (o[:2] @ d[:2]), d[:2] @ d[:2]])
        roots = (q * q - 4 * major**2 * xy).roots()
        real = sorted(r.real for r in roots if abs(r.imag) < 1e-7 and r.real > 0.0)
        t, _, _ = cast_all(patches, o, d)
        if not real:
            assert t == math.inf
        elif len(real) == 1 or real[1] - real[0] > 1e-3:
            # polynomial roots are the less accurate side of the comparison
            assert t == pytest.approx(real[0], abs=1e-10)


def newton_hits(net, o, d, t_min=0.0):
    """Sorted distances of all hits found by Newton from 20 x 20 starts, an independent search."""
    n1 = np.cross(d, [1.0, 0.3, 0.2])
    n1 /= np.linalg.norm(n1)
    n2 = np.cross(d, n1)
    nets = np.stack(
        [net[..., :3] @ n - (o @ n) * net[..., 3] for n in (n1, n2)], axis=-1
    )  # fmt: skip
    u, v = (a.ravel() for a in np.meshgrid(*[(np.arange(20) + 0.5) / 20] * 2))
    for _ in range(40):
        bu, bv, du, dv = (
            bernstein(u),
            bernstein(v),
            bernstein_derivative(u),
            bernstein_derivative(v),
        )
        f = np.einsum("ni,nj,ijk->nk", bu, bv, nets)
        fu = np.einsum("ni,nj,ijk->nk", du, bv, nets)
        fv = np.einsum("ni,nj,ijk->nk", bu, dv, nets)
        det = fu[:, 0] * fv[:, 1] - fv[:, 0] * fu[:, 1]
        step_u = (fv[:, 1] * f[:, 0] - fv[:, 0] * f[:, 1]) / det
        step_v = (fu[:, 0] * f[:, 1] - fu[:, 1] * f[:, 0]) / det
        limit = np.minimum(1.0, 0.2 / np.maximum(np.hypot(step_u, step_v), 1e-300))
        u, v = np.clip(u - limit * step_u, -0.5, 1.5), np.clip(v - limit * step_v, -0.5, 1.5)
    inside = (u > 0) & (u < 1) & (v > 0) & (v < 1) & (np.linalg.norm(f, axis=1) < 1e-12)
    t = (evaluate(net, u[inside], v[inside]) - o) @ d
    return np.sort(t[t > t_min])


@pytest.mark.parametrize("ratio", [1.0, 30.0, 1e4])
def test_random_bicubic_against_root_search(ratio):
    rng = np.random.default_rng(4)
    hits = 0
    for _ in range(30):
        net = np.empty((4, 4, 4))
        grid = np.stack(np.meshgrid(*[np.arange(4) / 3] * 2, indexing="ij"), axis=-1)
        net[..., :2] = grid + 0.15 * rng.normal(size=(4, 4, 2))
        net[..., 2] = 0.5 * rng.normal(size=(4, 4))
        net[..., 3] = ratio ** rng.uniform(0.0, 1.0, size=(4, 4))
        net[..., :3] *= net[..., 3:]
        origins, directions = random_rays(rng, 8, 3.0, 1.0)
        for o, d in zip(origins + [0.5, 0.5, 0.0], directions, strict=False):
            expected = newton_hits(net, o, d)
            status, t, u, v, _ = cast(net, o, d)
            if status == MISS:
                assert expected.size == 0
                continue
            assert status == HIT
            point = evaluate(net, u, v)
            assert np.linalg.norm(point - o - t * d) <= 1e-11
            if expected.size:
                assert t <= expected[0] + 1e-10
                hits += 1
    assert hits > 30


def test_nearest_of_several_hits_and_facing_filter():
    # A half pipe along y in one patch, met by a ray along x: in through the outside, out again.
    arc = PatchSet.cylinder((0, -1, 0), (0, 1, 0), 1.0).control_points
    work = np.empty(WORK)
    near, far = [], []
    for net in arc:
        status, t, _, _, facing = cast(net, (3.0, 0.1, 0.2), (-1.0, 0.0, 0.0))
        if status == HIT:
            (near if t < 3.0 else far).append((t, facing))
        for wanted in (1, -1):
            found = ray_patch_any(
                net, GENERAL, 3.0, 0.1, 0.2, -1.0, 0.0, 0.0, 0.0, 1e9, wanted, work
            )
            assert (found == HIT) == (status == HIT and facing == wanted)
    depth = math.sqrt(1.0 - 0.04)
    assert near == [(pytest.approx(3.0 - depth, abs=1e-14), 1)]
    assert far == [(pytest.approx(3.0 + depth, abs=1e-14), -1)]


def test_two_hits_in_one_patch():
    net = PatchSet.from_bezier(
        [[[(i / 3, j / 3, (0, 2, 2, 0)[i]) for j in range(4)] for i in range(4)]]
    ).control_points[0]
    # z = 6 u (1 − u), x = u: the height 1 is reached at u = (3 ∓ √3) / 6.
    first = (3.0 - math.sqrt(3.0)) / 6.0
    status, t, u, v, facing = cast(net, (-1.0, 0.5, 1.0), (1.0, 0.0, 0.0))
    assert (status, facing) == (HIT, 1)
    assert (t, u, v) == pytest.approx((1.0 + first, first, 0.5), abs=1e-14)
    _, t, _, _, facing = cast(net, (-1.0, 0.5, 1.0), (1.0, 0.0, 0.0), t_min=1.0 + first + 1e-9)
    assert (t, facing) == (pytest.approx(2.0 - first, abs=1e-14), -1)
    # Tangent at the crest, just below and just above it.
    assert cast(net, (-1.0, 0.5, 1.5 - 1e-12), (1.0, 0.0, 0.0))[0] == HIT
    assert cast(net, (-1.0, 0.5, 1.5 + 1e-12), (1.0, 0.0, 0.0))[0] == MISS
    assert cast(net, (-1.0, 0.5, 1.5), (1.0, 0.0, 0.0))[0] in (MISS, HIT)


@pytest.mark.parametrize("shape", ["sphere", "torus", "bilinear"])
def test_no_ray_slips_through_shared_edges(shape):
    rng = np.random.default_rng(5)
    if shape == "sphere":
        patches = PatchSet.sphere((0.3, -0.2, 0.1), 1.0).refined()
    elif shape == "torus":
        patches = PatchSet.torus((0.3, -0.2, 0.1), (1, 2, 3), 1.0, 0.4).refined()
    else:
        patches = PatchSet.from_bilinear(
            [[(0, 0, 0), (1, 0, 0.3), (1.1, 1, -0.2), (0, 1, 0.1)]]
        ).refined().refined()  # fmt: skip
    inner = np.array([0.3, -0.2, 0.1])
    for _ in range(400):
        p = rng.integers(len(patches))
        s, side = rng.uniform(), rng.integers(4)
        u, v = [(s, 0.0), (1.0, s), (s, 1.0), (0.0, s)][side]
        target = evaluate(patches.control_points[p], u, v)
        if shape == "bilinear":
            if min(target[0], target[1], 1.0 - target[0], 1.0 - target[1]) < 1e-3:
                continue
            o = target + [*rng.uniform(-1, 1, size=2), rng.uniform(0.5, 2)]
        else:
            o = inner + 0.1 * rng.normal(size=3) if shape == "sphere" else 5 * rng.normal(size=3)
        t, _, _ = cast_all(patches, o, target - o)
        assert t <= 1.0 + 1e-9


def test_sphere_pole():
    for patches in (PatchSet.sphere((0, 0, 0), 1.0), PatchSet.sphere((0, 0, 0), 1.0).refined()):
        for off in (0.0, 1e-15, 1e-12, 1e-9, 1e-6):
            for d in ((0.0, 0.0, -1.0), (0.3, 0.2, -1.0)):
                o = np.array([off, off, 1.0]) - 2.0 * np.array(d)
                t, _, facing = cast_all(patches, o, d)
                assert (t, facing) == (pytest.approx(2.0, abs=3e-6), 1)


def test_grazing_the_generators_of_a_cylinder_is_bounded():
    patches = PatchSet.cylinder((0, 0, 0), (0, 0, 1), 1.0)
    for off in (-1e-12, 0.0, 1e-15, 1e-12):
        for angle in (0.0, 0.3, 0.25 * math.pi):
            o = (1.0 + off) * np.array([math.cos(angle), math.sin(angle), 0.0]) + [0, 0, 5.0]
            for net in patches.control_points:
                status, t, _, _, _ = cast(net, o, (0.0, 0.0, -1.0))
                assert status == MISS or 4.0 - 1e-9 <= t <= 5.0 + 1e-9


def test_flat_patch_seen_edge_on_has_nothing_to_hit():
    disk = PatchSet.disk((0, 0, 0), 1.0, (0, 0, 1))
    kinds = classify_patches(disk.control_points)
    for net, kind in zip(disk.control_points, kinds, strict=False):
        assert cast(net, (-3.0, 0.1, 0.0), (1.0, 0.0, 0.0), kind=kind)[0] == MISS
        assert cast(net, (-3.0, 0.1, 0.5), (1.0, 0.0, 0.0), kind=kind)[0] == MISS


def test_nearly_edge_on_still_hits():
    disk = PatchSet.disk((0, 0, 0), 1.0, (0, 0, 1))
    for tilt in (1e-3, 1e-6, 1e-9):
        d = np.array([math.cos(tilt), 0.0, -math.sin(tilt)])
        t, _, facing = cast_all(disk, np.array([0.2, 0.3, 0.0]) - 2.0 * d, d)
        # the position along the ray is known to rounding over tilt
        assert (t, facing) == (pytest.approx(2.0, abs=1e-14 / tilt), 1)


def test_kinds():
    assert classify_patches(PatchSet.box((1, 2, 3)).control_points).tolist() == [FLAT_QUAD] * 6
    assert classify_patches(PatchSet.sphere((0, 0, 0), 1).control_points).tolist() == [GENERAL] * 8
    disk = classify_patches(PatchSet.disk((5, 4, 3), 1, (1, 2, 3)).control_points)
    assert disk.tolist() == [FLAT_QUAD] + [GENERAL] * 4
    quads = PatchSet.from_bilinear(
        [
            [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
            [(0, 0, 0), (1, 0, 0), (1, 1, 0.1), (0, 1, 0)],  # saddle
            [(0, 0, 0), (1, 0, 0), (0.2, 0.2, 0), (0, 1, 0)],  # concave corner
            [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 0)],  # triangle
            [(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)],  # bow tie
            [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)],  # no area
        ]
    )
    expected = [FLAT_QUAD, GENERAL, GENERAL, FLAT_QUAD, GENERAL, GENERAL]
    assert classify_patches(quads.control_points).tolist() == expected


def test_flat_path_agrees_with_the_general_one():
    rng = np.random.default_rng(6)
    square = PatchSet.from_bilinear([[(0, 0, 0), (1, 0, 0), (1.3, 1, 0), (0.2, 0.7, 0)]])
    net = square.control_points[0]
    weights = np.outer([1, 2, 1, 3], [1, 1, 2, 1]).astype(float)
    # Weights that are a product in i and j keep straight edges and the plane.
    rational = net / net[..., 3:] * weights[..., None]
    for candidate in (net, rational, sub_net(net, 0.0, 0.5, 0.25, 1.0)):
        assert classify_patches(candidate[None])[0] == FLAT_QUAD
        for o, d in zip(*random_rays(rng, 200, 3.0, 1.2), strict=False):
            a = cast(candidate, o, d)
            b = cast(candidate, o, d, kind=FLAT_QUAD)
            assert (a[0], a[4]) == (b[0], b[4])
            if a[0] == HIT:
                assert a[1:4] == pytest.approx(b[1:4], abs=1e-10)


def test_compiled_code_is_this_source():
    net = PatchSet.sphere((0, 0, 0), 1.0).control_points[5]
    arguments = (net, GENERAL, 3.0, 0.1, 0.2, -1.0, 0.0, 0.0, 0.0, 10.0)
    compiled = ray_patch(*arguments, np.empty(WORK))
    python = ray_patch.py_func(*arguments, np.empty(WORK))
    assert compiled == pytest.approx(python, abs=1e-14)


def test_two_roots_on_one_parameter_line():
    """From a point on its axis a sphere is met twice on one meridian, near the outline."""
    ball = PatchSet.sphere((0, 0, 0), 1.0)
    rng = np.random.default_rng(8)
    origin = np.array([0.0, 0.0, -4.0])
    # Between the directions of the equator and of the outline both roots lie in one octant.
    angles = rng.uniform(math.atan(0.25) + 1e-6, math.asin(0.25) - 1e-6, 500)
    turns = rng.uniform(0.0, 2.0 * math.pi, 500)
    for angle, turn in zip(angles, turns, strict=True):
        d = np.array([math.cos(turn), math.sin(turn), 0.0]) * math.sin(angle)
        d[2] = math.cos(angle)
        half = math.sqrt(1.0 - (4.0 * math.sin(angle)) ** 2)
        t, _, facing = cast_all(ball, origin, d)
        assert (t, facing) == (pytest.approx(4.0 * math.cos(angle) - half, abs=1e-11), 1)
