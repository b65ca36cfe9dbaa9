"""Forty CadQuery solids: closed, watertight along edges, the same through a STEP file."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from patchlight.importers import from_cadquery, read_step
from patchlight.importers.assemble import diagonal
from patchlight.importers.moments import volume_and_vector
from patchlight.solver import form_factors

from .many_solids import SOLIDS

#: Cheap ones that between them have every kind of neighbourhood.
QUICK = (
    "frustum sector", "sphere minus box", "crossing cylinders", "cone minus cylinder",
    "torus sector", "three-section loft", "thread", "twist", "drafted",
)  # fmt: skip
MANY = [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in SOLIDS]


def sides(model):
    """Rational cubics (n, 4, 4) of all sides on edges, and their edges and faces."""
    nets = model.patches.control_points
    rows = np.stack([nets[:, :, 0], nets[:, 3], nets[:, :, 3], nets[:, 0]], axis=1)
    on = model.patches.edge_index >= 0
    face = np.broadcast_to(model.patches.face_index[:, None], on.shape)
    return rows[on], model.patches.edge_index[on], face[on]


def nearest(points, rows):
    """Distance of each point (m, 3) to the nearest of some cubics (n, 4, 4), by Newton's method."""
    from patchlight.solver.model.bezier import bernstein, bernstein_derivative

    t = np.linspace(0.0, 1.0, 33)
    h = bernstein(t) @ rows
    x = h[..., :3] / h[..., 3:]
    d = np.linalg.norm(x[:, :, None] - points, axis=-1)
    # Next to a joint the nearest sample may be one of the neighbour: several cubics are tried.
    near = np.argsort(d.min(axis=1), axis=0)[:3]
    away = np.full(len(points), np.inf)
    for number in near:
        row = rows[number]
        s = t[d[number, :, np.arange(len(points))].argmin(axis=1)]
        for _ in range(8):
            h = np.einsum("ni,nij->nj", bernstein(s), row)
            g = np.einsum("ni,nij->nj", bernstein_derivative(s), row)
            x = h[:, :3] / h[:, 3:]
            v = (g[:, :3] - g[:, 3:] * x) / h[:, 3:]
            step = ((points - x) * v).sum(1) / np.maximum((v * v).sum(1), 1e-300)  # not at poles
            s = np.clip(s + step, 0.0, 1.0)
        h = np.einsum("ni,nij->nj", bernstein(s), row)
        away = np.minimum(away, np.linalg.norm(h[:, :3] / h[:, 3:] - points, axis=1))
    return away


@pytest.mark.parametrize("name", MANY)
def test_solid_is_closed_and_watertight(name):
    shape = SOLIDS[name]()
    model = from_cadquery(shape)
    assert model.certificate.faces_failed == 0
    size = 1e-3 * diagonal(shape.val().wrapped)
    for face in model.faces:
        assert face.area_error < (1e-6 if face.exact else 1e-4), (face.number, face.kind)
        assert face.deviation_m <= 1e-4 * size
    rows, edges, faces = sides(model)
    for edge in np.unique(edges):
        own = edges == edge
        for face in np.unique(faces[own]):
            here, there = own & (faces == face), own & (faces != face)
            if not there.any():
                continue
            h = rows[here] * 1.0
            ends = (h[:, ::3, :3] / h[:, ::3, 3:]).reshape(-1, 3)
            h = np.array([0.125, 0.375, 0.375, 0.125]) @ h
            points = np.concatenate([ends, h[:, :3] / h[:, 3:]])
            # Both faces use parts of the same cubics, though a side may run along several edges;
            # Newton's method ends in rounding. Exact faces of splines keep their own border, which
            # the kernel's edges follow to 1e-7.
            away = np.minimum(nearest(points, rows[there]), nearest(points, rows[faces != face]))
            assert away.max() < 2e-7 * size, (edge, face)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SOLIDS))
def test_the_same_through_a_step_file(name, tmp_path):
    shape = SOLIDS[name]()
    path = tmp_path / "solid.step"
    cq.exporters.export(shape, str(path))
    direct, read = from_cadquery(shape), read_step(path)
    assert read.certificate.faces_failed == direct.certificate.faces_failed == 0
    exact = direct.certificate.faces_approximated == read.certificate.faces_approximated == 0
    # Both are within the tolerance of 1e-4 of the same shape; exact ones differ by the digits of
    # the file.
    limit = 1e-9 if exact else 1e-4
    volumes = [volume_and_vector(m.patches.control_points) for m in (direct, read)]
    assert volumes[1][2] == pytest.approx(volumes[0][2], rel=limit)
    assert volumes[1][0] == pytest.approx(volumes[0][0], rel=10.0 * limit)


@pytest.mark.slow
def test_nothing_shows_between_the_patches_of_a_solid():
    """Furnace: from every point inside a closed solid all directions end on its patches."""
    solid = from_cadquery(SOLIDS["sphere minus beam"]()).patches.flipped()
    sums = form_factors(solid, accuracy=1e-4).value.sum(axis=1)
    # Each factor is known to 1e-4 of the patch's own unoccluded one, which sum to at most 2.
    np.testing.assert_allclose(sums, 1.0, atol=2e-4)


def test_area_check_can_be_left_out():
    shape = SOLIDS["sphere minus box"]()
    checked, unchecked = (
        from_cadquery(shape, check_areas=check, cache=False) for check in (True, False)
    )
    assert np.isnan([f.area_error for f in unchecked.faces]).all()
    assert unchecked.certificate.area_seconds == 0.0 < checked.certificate.area_seconds
    np.testing.assert_array_equal(unchecked.patches.control_points, checked.patches.control_points)
