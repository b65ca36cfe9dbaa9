"""Exact control nets (p, 4, 4, 4) of elementary surfaces, +normal outward.

A 90-degree arc is a rational quadratic with middle weight cos 45°; raised to degree 3 it stays
exact [1, sec. 13.6]. Products of arcs and segments give the surfaces of revolution.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GeometryError
from .arrays import FloatArray, check_finite, check_shape, unit_vector

#: Degree elevation of a quadratic and of a line to a cubic, as (4, 3) and (4, 2) matrices.
_FROM_QUADRATIC = np.array([[1, 0, 0], [1 / 3, 2 / 3, 0], [0, 2 / 3, 1 / 3], [0, 0, 1]])
_FROM_LINE = np.array([[1, 0], [2 / 3, 1 / 3], [1 / 3, 2 / 3], [0, 1]])


def arc(start_angle: float, end_angle: float) -> FloatArray:
    """Rational cubic (4, 3) = (w cos, w sin, w) of the unit circle; less than 180 degrees."""
    half = 0.5 * (end_angle - start_angle)
    mid = 0.5 * (start_angle + end_angle)
    quadratic = np.array(
        [
            [math.cos(start_angle), math.sin(start_angle), 1.0],
            [math.cos(mid), math.sin(mid), math.cos(half)],  # (x, y) / w lies on the tangents
            [math.cos(end_angle), math.sin(end_angle), 1.0],
        ]
    )
    return np.asarray(_FROM_QUADRATIC @ quadratic)


def frame(axis: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Right-handed unit vectors (e1, e2, e3) with e3 along ``axis``."""
    e3 = unit_vector("axis", axis)
    helper = np.zeros(3)
    helper[int(np.argmin(np.abs(e3)))] = 1.0
    e1 = np.cross(helper, e3)
    e1 /= np.linalg.norm(e1)
    return e1, np.cross(e3, e1), e3


def frames(axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors e1, e2 (n, 3) that with unit ``axes`` (n, 3) are right-handed."""
    helper = np.where(np.abs(axes[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    e1 = np.cross(helper, axes)
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    return np.asarray(e1), np.asarray(np.cross(axes, e1))


def places_on_disk(count: int) -> tuple[FloatArray, FloatArray]:
    """Radius and angle [rad] (count,) of places of equal area on the unit disk, spread evenly."""
    k = np.arange(count, dtype=np.float64)
    angles = math.pi * (3.0 - math.sqrt(5.0)) * k
    return np.sqrt((k + 0.5) / count), angles


def _placed(nets: FloatArray, center: ArrayLike, axis: ArrayLike) -> FloatArray:
    """Nets given in the frame of ``axis`` moved to ``center``."""
    e1, e2, e3 = frame(axis)
    c = np.asarray(center, dtype=np.float64)
    check_shape("center", c, (3,))
    check_finite("center", c)
    out = np.empty_like(nets)
    w = nets[..., 3:]
    out[..., :3] = nets[..., :3] @ np.array([e1, e2, e3]) + w * c
    out[..., 3:] = w
    return out


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise GeometryError(f"{name} = {value}: must be a positive number")
    return float(value)


def _revolved(profile: FloatArray) -> FloatArray:
    """Surface of revolution about z of a cubic ``profile`` (4, 3) = (w r, w z, w), v along it."""
    nets = []
    for quarter in range(4):
        a = arc(0.5 * math.pi * quarter, 0.5 * math.pi * (quarter + 1))
        net = np.empty((4, 4, 4))
        net[..., 0] = a[:, None, 0] * profile[None, :, 0]
        net[..., 1] = a[:, None, 1] * profile[None, :, 0]
        net[..., 2] = a[:, None, 2] * profile[None, :, 1]
        net[..., 3] = a[:, None, 2] * profile[None, :, 2]
        nets.append(net)
    return np.array(nets)


def bilinear(corners: FloatArray) -> FloatArray:
    """Bilinear patches from corners (p, 4, 3) at (u, v) = (0,0), (1,0), (1,1), (0,1)."""
    check_shape("corners", corners, (None, 4, 3))
    check_finite("corners", corners)
    nets = np.ones((len(corners), 4, 4, 4))
    t = np.arange(4) / 3.0
    u, v = t[:, None, None], t[None, :, None]
    c0, c1, c2, c3 = (corners[:, k][:, None, None, :] for k in range(4))
    nets[..., :3] = (1 - v) * ((1 - u) * c0 + u * c1) + v * ((1 - u) * c3 + u * c2)
    return nets


def sphere(center: ArrayLike, radius: float) -> FloatArray:
    """Eight octants of a sphere, collapsed at the poles."""
    r = _positive("radius", radius)
    nets = []
    for start in (-0.5 * math.pi, 0.0):
        a = arc(start, start + 0.5 * math.pi)
        profile = np.stack([r * a[:, 0], r * a[:, 1], a[:, 2]], axis=-1)
        # cos(±90°) is not zero in floating point: put the poles on the axis exactly.
        profile[0 if start < 0.0 else -1, 0] = 0.0
        nets.append(_revolved(profile))
    return _placed(np.concatenate(nets), center, (0.0, 0.0, 1.0))


def cone(start: ArrayLike, end: ArrayLike, start_radius: float, end_radius: float) -> FloatArray:
    """Lateral surface of a cylinder or cone in four patches."""
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    for name, p in (("start", a), ("end", b)):
        check_shape(name, p, (3,))
        check_finite(name, p)
    height = float(np.linalg.norm(b - a))
    if height == 0.0:
        raise GeometryError("cone or cylinder: start and end are the same point")
    for name, value in (("start_radius", start_radius), ("end_radius", end_radius)):
        if not (math.isfinite(value) and value >= 0.0):
            raise GeometryError(f"{name} = {value}: must not be negative")
    if start_radius == 0.0 and end_radius == 0.0:
        raise GeometryError("cone or cylinder: both radii are zero")
    line = np.array([[start_radius, 0.0, 1.0], [end_radius, height, 1.0]])
    return _placed(_revolved(_FROM_LINE @ line), a, b - a)


def torus(
    center: ArrayLike, axis: ArrayLike, major_radius: float, minor_radius: float
) -> FloatArray:
    """Torus in sixteen patches."""
    major, minor = _positive("major_radius", major_radius), _positive("minor_radius", minor_radius)
    if minor >= major:
        raise GeometryError(f"minor_radius = {minor}: must be less than major_radius = {major}")
    nets = []
    for quarter in range(4):
        a = arc(0.5 * math.pi * quarter, 0.5 * math.pi * (quarter + 1))
        nets.append(
            _revolved(np.stack([major * a[:, 2] + minor * a[:, 0], minor * a[:, 1], a[:, 2]], -1))
        )
    return _placed(np.concatenate(nets), center, axis)


def disk(center: ArrayLike, radius: float, normal: ArrayLike) -> FloatArray:
    """Flat disc in five patches: a square core and four sectors with exact circular arcs."""
    r = _positive("radius", radius)
    core = 0.5 * r
    corners = [(core * math.cos(q), core * math.sin(q)) for q in _diagonals()]
    flat = np.zeros((1, 4, 3))
    flat[0, :, :2] = corners
    nets = [bilinear(flat)]
    for k, angle in enumerate(_diagonals()):
        inner = np.array([[*corners[k], 0.0, 1.0], [*corners[(k + 1) % 4], 0.0, 1.0]])
        inner_cubic = _FROM_LINE @ inner
        a = arc(angle, angle + 0.5 * math.pi)
        outer = np.zeros((4, 4))
        outer[:, :2], outer[:, 3] = r * a[:, :2], a[:, 2]
        # u along the radius, v along the arc: ∂u × ∂v is +z. Ruled in homogeneous coordinates.
        nets.append(np.einsum("il,ljk->ijk", _FROM_LINE, np.array([inner_cubic, outer]))[None])
    return _placed(np.concatenate(nets), center, normal)


def _diagonals() -> list[float]:
    return [(-0.75 + 0.5 * k) * math.pi for k in range(4)]


def box(size: ArrayLike, center: ArrayLike) -> FloatArray:
    """Six faces of an axis-parallel box, +normal outward."""
    s, c = np.asarray(size, dtype=np.float64), np.asarray(center, dtype=np.float64)
    check_shape("size", s, (3,))
    check_shape("center", c, (3,))
    check_finite("center", c)
    for k in range(3):
        _positive(f"size[{k}]", float(s[k]))
    h = 0.5 * s
    unit = np.array(
        [
            [(-1, -1, -1), (-1, 1, -1), (1, 1, -1), (1, -1, -1)],
            [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
            [(-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)],
            [(1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1)],
            [(-1, 1, -1), (-1, -1, -1), (-1, -1, 1), (-1, 1, 1)],
            [(1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)],
        ],
        dtype=np.float64,
    )
    return bilinear(unit * h + c)
