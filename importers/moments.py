"""Signed volume and vector area of patches, by Gauss quadrature of the divergence theorem."""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, gauss_rule


def volume_and_vector(nets: FloatArray, *, order: int = 8) -> tuple[float, FloatArray, float]:
    """Volume ⅓ ∮ x·n dA, vector area ∮ n dA (3,) and area of nets (n, 4, 4, 4)."""
    x, w = gauss_rule(order)
    b, d = bernstein(x), bernstein_derivative(x)
    points = nets[:, 0, 0, :3] / nets[:, 0, 0, 3:]
    origin = points.mean(axis=0)
    volume, vector, area = 0.0, np.zeros(3), 0.0
    for start in range(0, len(nets), 512):
        part = nets[start : start + 512]
        h = np.einsum("ai,bj,nijk->nabk", b, b, part, optimize=True)
        hu = np.einsum("ai,bj,nijk->nabk", d, b, part, optimize=True)
        hv = np.einsum("ai,bj,nijk->nabk", b, d, part, optimize=True)
        weight = h[..., 3:]
        p = h[..., :3] / weight
        pu = (hu[..., :3] - hu[..., 3:] * p) / weight
        pv = (hv[..., :3] - hv[..., 3:] * p) / weight
        n = np.cross(pu, pv) * (w[:, None] * w)[..., None]
        volume += float(np.einsum("nabk,nabk->", p - origin, n)) / 3.0
        vector += n.sum(axis=(0, 1, 2))
        area += float(np.linalg.norm(n, axis=-1).sum())
    return volume, vector, area
