"""The tree against brute force, closed enclosures, and the rules of the façade."""

import math

import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.kernels.ray_patch import HIT, WORK, classify_patches, ray_patch
from patchlight.solver.model import PatchSet
from patchlight.solver.model.bezier import bernstein
from patchlight.solver.raycast import RayCaster


@pytest.fixture(scope="module")
def clutter():
    """Curved and flat bodies of very different sizes in a room."""
    rng = np.random.default_rng(1)
    sets = [PatchSet.box((4, 4, 4), inward=True)]
    for _ in range(12):
        centre, size = rng.uniform(-1.5, 1.5, size=3), 10 ** rng.uniform(-3, -0.5)
        sets.append(PatchSet.sphere(centre, size))
        sets.append(PatchSet.box((size, 2 * size, size), -centre))
        sets.append(PatchSet.torus(centre[::-1], rng.normal(size=3), 2 * size, size))
        sets.append(PatchSet.disk(-centre[::-1], size, rng.normal(size=3)))
    return PatchSet.concatenated(*sets)


def test_tree_agrees_with_brute_force(clutter):
    rng = np.random.default_rng(2)
    m = 300
    origins = rng.uniform(-1.99, 1.99, size=(m, 3))
    directions = rng.normal(size=(m, 3))
    hits = RayCaster(clutter).first_hit(origins, directions)
    assert hits.undecided == 0
    kinds = classify_patches(clutter.control_points)
    work = np.empty(WORK)
    for r in range(m):
        best = (math.inf, -1)
        for p, net in enumerate(clutter.control_points):
            status, t, _, _, _ = ray_patch(
                net, kinds[p], *origins[r], *directions[r], 0.0, 1e300, work
            )
            if status == HIT and t < best[0]:
                best = (t, p)
        assert hits.t[r] == pytest.approx(best[0], rel=1e-13)
        assert hits.patch[r] == best[1]


def test_any_hit_agrees_with_first_hit(clutter):
    rng = np.random.default_rng(3)
    origins = rng.uniform(-1.99, 1.99, size=(2000, 3))
    directions = rng.normal(size=(2000, 3))
    caster = RayCaster(clutter)
    for facing in (0, 1, -1):
        hits = caster.first_hit(origins, directions, facing=facing)
        found = np.isfinite(hits.t)
        assert (hits.facing[found] == facing).all() or facing == 0
        before = np.where(found, hits.t * (1 - 1e-9), 1e3)
        after = np.where(found, hits.t * (1 + 1e-9), 1e3)
        assert not caster.any_hit(origins, directions, t_max=before, facing=facing).any()
        assert (caster.any_hit(origins, directions, t_max=after, facing=facing) == found).all()


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_no_ray_leaves_a_closed_curved_body(offset):
    rng = np.random.default_rng(4)
    n = 20_000
    for body in (
        PatchSet.sphere((0, 0, 0), 1.0),
        PatchSet.torus((0, 0, 0), (1, 2, 3), 1.0, 0.4),
        PatchSet.box((2, 2, 2)).refined(),
        PatchSet.concatenated(
            PatchSet.cylinder((0, 0, -1), (0, 0, 1), 1.0),
            PatchSet.disk((0, 0, 1), 1.0, (0, 0, 1)),
            PatchSet.disk((0, 0, -1), 1.0, (0, 0, -1)),
        ),
    ):
        body = body.moved((offset, -offset, offset))
        start = body.evaluate(0.47, 0.53) - 0.05 * body.normals(0.47, 0.53)
        origins = start[rng.integers(len(body), size=n)]
        # Half of the rays go straight to points of patch edges.
        s = rng.uniform(size=n)
        edge = np.array([(0, 1, 2, 3)[k % 4] for k in range(n)])
        u = np.choose(edge, [s, np.ones(n), s, np.zeros(n)])
        v = np.choose(edge, [np.zeros(n), s, np.ones(n), s])
        rows = rng.integers(len(body), size=n)

        h = np.einsum("ni,nj,nijk->nk", bernstein(u), bernstein(v), body.control_points[rows])
        directions = h[:, :3] / h[:, 3:] - origins
        directions[::2] = rng.normal(size=(len(directions[::2]), 3))
        hits = RayCaster(body).first_hit(origins, directions)
        assert (hits.patch >= 0).all()
        assert hits.undecided <= 2


def test_same_answer_for_any_thread_count_and_repeat(clutter):
    import numba

    rng = np.random.default_rng(5)
    origins, directions = rng.uniform(-1, 1, size=(1000, 3)), rng.normal(size=(1000, 3))
    caster = RayCaster(clutter)
    a = caster.first_hit(origins, directions)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        b = caster.first_hit(origins, directions)
    finally:
        numba.set_num_threads(threads)
    for name in ("patch", "t", "u", "v", "facing"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()


def test_patch_order_does_not_matter(clutter):
    rng = np.random.default_rng(6)
    origins, directions = rng.uniform(-1, 1, size=(500, 3)), rng.normal(size=(500, 3))
    order = rng.permutation(len(clutter))
    a = RayCaster(clutter).first_hit(origins, directions)
    b = RayCaster(clutter.take(order)).first_hit(origins, directions)
    assert (order[b.patch] == a.patch).all()
    assert b.t == pytest.approx(a.t, rel=1e-14)


def test_rays_without_direction_or_target_miss():
    caster = RayCaster(PatchSet.box((1, 1, 1)))
    hits = caster.first_hit(
        [0.0, 0.0, 0.0], [[np.nan, 0, 0], [0, 0, 0], [np.inf, 0, 0], [0, 0, 1], [0, -0.0, 2]]
    )
    assert hits.patch.tolist() == [-1, -1, -1, 1, 1]
    assert hits.t.tolist() == [np.inf, np.inf, np.inf, 0.5, 0.25]
    assert np.isnan(hits.u[:3]).all() and hits.facing.tolist() == [0, 0, 0, -1, -1]
    empty = RayCaster(PatchSet.empty()).first_hit([0, 0, 0], [[0.0, 0.0, 1.0]])
    assert empty.patch.tolist() == [-1]
    with pytest.raises(InputError, match="directions"):
        caster.first_hit([0, 0, 0], [0, 0, 1])
    with pytest.raises(InputError, match="origins"):
        caster.first_hit(np.zeros((2, 3)), np.zeros((3, 3)))


def test_distance_bounds_are_open():
    caster = RayCaster(PatchSet.box((2, 2, 2)))
    ray = ([0.0, 0.0, 0.0], [[0.0, 0.0, 1.0]])
    assert caster.first_hit(*ray, t_max=1.0).patch[0] == -1
    assert caster.first_hit(*ray, t_max=1.0 + 1e-12).patch[0] == 1
    assert caster.first_hit(*ray, t_min=1.0).patch[0] == -1
    assert caster.first_hit(*ray, t_min=1.0 - 1e-12).patch[0] == 1
