"""Signed volume and vector area of patches, by Gauss quadrature of the divergence theorem."""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, gauss_rule

from .compare import cross, length


def volume_and_vector(nets: FloatArray, *, order: int = 8) -> tuple[float, FloatArray, float]:
    """Volume ⅓ ∮ x·n dA, vector area ∮ n dA (3,) and area of nets (n, 4, 4, 4)."""
    x, w = gauss_rule(order)
    b, d = bernstein(x), bernstein_derivative(x)
    bases = np.stack([np.kron(b, b), np.kron(d, b), np.kron(b, d)])
    weights = np.outer(w, w).reshape(-1, 1)
    points = nets[:, 0, 0, :3] / nets[:, 0, 0, 3:]
    origin = points.mean(axis=0)
    volume, vector, area = 0.0, np.zeros(3), 0.0
    for start in range(0, len(nets), 512):
        part = nets[start : start + 512]
        h, hu, hv = bases[:, None] @ part.reshape(-1, 16, 4)
        weight = h[..., 3:]
        p = h[..., :3] / weight
        pu = (hu[..., :3] - hu[..., 3:] * p) / weight
        pv = (hv[..., :3] - hv[..., 3:] * p) / weight
        n = cross(pu, pv) * weights
        volume += float(((p - origin) * n).sum()) / 3.0
        vector += n.sum(axis=(0, 1))
        area += float(length(n).sum())
    return volume, vector, area


def vector_areas(nets: FloatArray, *, order: int = 6) -> FloatArray:
    """Vector areas ∫ n dA (n, 3) of nets (n, 4, 4, 4), from their boundaries: ½ ∮ x × dx."""
    x, w = gauss_rule(order)
    x, w = np.concatenate([0.5 * x, 0.5 + 0.5 * x]), np.concatenate([0.5 * w, 0.5 * w])
    b, d = bernstein(x), bernstein_derivative(x)
    origin = (nets[:, 0, 0, :3] / nets[:, 0, 0, 3:])[:, None]
    total = np.zeros((len(nets), 3))
    sides = ((nets[:, :, 0], 1.0), (nets[:, 3], 1.0), (nets[:, :, 3], -1.0), (nets[:, 0], -1.0))
    for side, sign in sides:
        h, slope = b @ side, d @ side
        p = h[..., :3] / h[..., 3:]
        dp = (slope[..., :3] - slope[..., 3:] * p) / h[..., 3:]
        total += 0.5 * sign * np.einsum("q,nqk->nk", w, cross(p - origin, dp))
    return total
