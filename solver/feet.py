"""Where points that lie on a surface lie on it: Newton's iteration for the foot of each."""

from __future__ import annotations

import numpy as np

from .model.arrays import FloatArray
from .model.bezier import surface_points

#: Points at a time, each with a grid of points of its surface.
_BATCH = 4096


def normals_under(points: FloatArray, nets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Feet of points (m, 3) on nets (m, 4, 4, 4), one net a point.

    Returns
    -------
    normals : (m, 3) array
        Unit +normals there; 0 where the surface has none, at a side collapsed to a point.
    gaps : (m,) array
        Distances from the points. [m]
    """
    normals, gaps = np.zeros((len(points), 3)), np.zeros(len(points))
    for start in range(0, len(points), _BATCH):
        some = slice(start, start + _BATCH)
        normals[some], gaps[some] = _feet(points[some], nets[some])
    return normals, gaps


def _feet(x: FloatArray, nets: FloatArray) -> tuple[FloatArray, FloatArray]:
    t = np.linspace(0.0, 1.0, 9)
    u, v = (np.broadcast_to(g.ravel(), (len(x), 81)) for g in np.meshgrid(t, t, indexing="ij"))
    at, _, _ = surface_points(nets, u, v)
    nearest = np.argmin(np.linalg.norm(at - x[:, None], axis=2), axis=1)[:, None]
    u, v = np.take_along_axis(u, nearest, axis=1), np.take_along_axis(v, nearest, axis=1)
    for _ in range(20):
        at, su, sv = surface_points(nets, u, v)
        gap = x[:, None] - at
        uu, uv, vv = (np.einsum("mkc,mkc->mk", a, b) for a, b in ((su, su), (su, sv), (sv, sv)))
        gu, gv = np.einsum("mkc,mkc->mk", su, gap), np.einsum("mkc,mkc->mk", sv, gap)
        # At a pole one tangent vanishes and its part of the step with it.
        uu, vv = uu + 1e-14 * (uu + vv), vv + 1e-14 * (uu + vv)
        det = np.maximum(uu * vv - uv * uv, 1e-300)
        du, dv = (vv * gu - uv * gv) / det, (uu * gv - uv * gu) / det
        u, v = np.clip(u + du, 0.0, 1.0), np.clip(v + dv, 0.0, 1.0)
        if max(np.abs(du).max(), np.abs(dv).max()) <= 1e-14:
            break
    at, su, sv = surface_points(nets, u, v)
    normal = np.cross(su, sv)[:, 0]
    size = np.linalg.norm(normal, axis=1)
    spread = np.linalg.norm(su[:, 0], axis=1) * np.linalg.norm(sv[:, 0], axis=1)
    good = size > 1e-9 * np.maximum(spread, 1e-300)
    unit = np.where(good[:, None], normal / np.where(good, size, 1.0)[:, None], 0.0)
    return unit, np.linalg.norm(at[:, 0] - x, axis=1)
