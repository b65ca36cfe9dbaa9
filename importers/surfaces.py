"""Surfaces as arrays: points and first derivatives at many parameters at once.

Every surface has ``kind`` (a word of `Face.kind`), ``periods`` (u, v; None when not periodic),
``angular`` (whether u and v are angles of a circle) and ``evaluate(u, v) -> P, P_u, P_v``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from . import nurbs
from .curves import BSpline, Curve

Frame = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Points = tuple[FloatArray, FloatArray, FloatArray]
TURN = 2.0 * np.pi


class Surface:
    """Base of all surfaces."""

    kind = "other"
    periods: tuple[float | None, float | None] = (None, None)
    angular: tuple[bool, bool] = (False, False)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        raise NotImplementedError

    @property
    def exact_spline_lines(self) -> bool:
        """Whether splines that are lines of constant u or v bound exact patches."""
        return False

    def points(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Points only (..., 3)."""
        return self.evaluate(u, v)[0]

    def speeds(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """|P_u| and |P_v| (...,)."""
        _, pu, pv = self.evaluate(u, v)
        return np.linalg.norm(pu, axis=-1), np.linalg.norm(pv, axis=-1)

    def jacobian_variable(self) -> str:
        """Which parameters |P_u × P_v| depends on: "", "u", "v" or "uv"."""
        return "uv"


@dataclass(slots=True)
class Plane(Surface):
    """origin + u x + v y."""

    frame: Frame
    kind = "plane"
    exact_spline_lines = True

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        o, x, y, _ = self.frame
        p = o + u[..., None] * x + v[..., None] * y
        return p, np.broadcast_to(x, p.shape), np.broadcast_to(y, p.shape)

    def jacobian_variable(self) -> str:
        return ""


@dataclass(slots=True)
class Round(Surface):
    """Cylinder, cone, sphere or torus: a meridian (radius ρ(v), height ζ(v)) turned about z."""

    frame: Frame
    kind: str
    radius: float = 1.0
    minor: float = 0.0
    angle: float = 0.0

    @property
    def periods(self) -> tuple[float | None, float | None]:  # type: ignore[override]
        return (TURN, TURN if self.kind == "torus" else None)

    @property
    def angular(self) -> tuple[bool, bool]:  # type: ignore[override]
        return (True, self.kind in ("sphere", "torus"))

    @property
    def meridian(self) -> tuple[float, float, float, float]:
        """r, s, c, m of the meridian ρ = r + s v + m cos v, ζ = c v + m sin v."""
        if self.kind == "cylinder":
            return self.radius, 0.0, 1.0, 0.0
        if self.kind == "cone":
            return self.radius, math.sin(self.angle), math.cos(self.angle), 0.0
        if self.kind == "sphere":
            return 0.0, 0.0, 0.0, self.radius
        return self.radius, 0.0, 0.0, self.minor

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        o, x, y, z = self.frame
        r, along, up, m = self.meridian
        cv, sv = m * np.cos(v), m * np.sin(v)
        c, s = np.cos(u)[..., None], np.sin(u)[..., None]
        rho, zeta = (r + along * v + cv)[..., None], (up * v + sv)[..., None]
        radial, around = c * x + s * y, c * y - s * x
        turned = (along - sv)[..., None] * radial + (up + cv)[..., None] * z
        return o + rho * radial + zeta * z, rho * around, turned

    def speeds(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        r, along, up, m = self.meridian
        c, s = m * np.cos(v), m * np.sin(v)
        return np.abs(r + along * v + c), np.hypot(along - s, up + c)

    def jacobian_variable(self) -> str:
        return "" if self.kind == "cylinder" else "v"


@dataclass(slots=True)
class SplineSurface(Surface):
    """Rational B-spline or Bézier surface as Bézier pieces (mu, mv, pu + 1, pv + 1, 4)."""

    u_knots: FloatArray
    v_knots: FloatArray
    pieces: FloatArray
    kind: str = "bspline"
    periods: tuple[float | None, float | None] = (None, None)
    sharp_u: FloatArray | None = None
    sharp_v: FloatArray | None = None

    @property
    def degrees(self) -> tuple[int, int]:
        return self.pieces.shape[2] - 1, self.pieces.shape[3] - 1

    @property
    def exact_spline_lines(self) -> bool:
        return max(self.degrees) <= 3

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        p, pu, pv = self._derivatives(u, v, nurbs.FIRST)
        return p, pu, pv

    def points(self, u: FloatArray, v: FloatArray) -> FloatArray:
        return self._derivatives(u, v, nurbs.POINT)[0]

    def second(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, ...]:
        """P, P_u, P_v, P_uu, P_uv and P_vv, each (..., 3)."""
        return self._derivatives(u, v, nurbs.SECOND)

    def _derivatives(
        self, u: FloatArray, v: FloatArray, orders: tuple[tuple[int, int], ...]
    ) -> tuple[FloatArray, ...]:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape).ravel(), np.broadcast_to(v, shape).ravel()
        u = nurbs.wrap(u, float(self.u_knots[0]), self.periods[0])
        v = nurbs.wrap(v, float(self.v_knots[0]), self.periods[1])
        i, s, ds = nurbs.locate(self.u_knots, u)
        j, t, dt = nurbs.locate(self.v_knots, v)
        found = nurbs.patch_derivatives(self.pieces[i, j], s, ds, t, dt, orders)
        return tuple(x.reshape(*shape, 3) for x in found)


@dataclass(slots=True)
class Revolution(Surface):
    """Profile C(v) turned by the angle u about the line through ``origin`` along ``axis``."""

    origin: FloatArray
    axis: FloatArray
    profile: Curve
    kind = "revolution"
    periods = (TURN, None)
    angular = (True, False)

    @property
    def exact_spline_lines(self) -> bool:
        return isinstance(self.profile, BSpline) and self.profile.degree <= 3

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape), np.broadcast_to(v, shape)
        a = self.axis
        q, dq = self.profile.both(v)
        q = q - self.origin
        c, s = np.cos(u)[..., None], np.sin(u)[..., None]

        def turned(x: FloatArray) -> FloatArray:
            along = (x @ a)[..., None] * a
            return c * (x - along) + s * np.cross(a, x) + along

        p = turned(q)
        return self.origin + p, np.cross(a, p), turned(dq)

    def jacobian_variable(self) -> str:
        return "v"


@dataclass(slots=True)
class Extrusion(Surface):
    """Profile C(u) moved along ``direction`` by v."""

    profile: Curve
    direction: FloatArray
    kind = "extrusion"
    periods: tuple[float | None, float | None] = (None, None)

    @property
    def exact_spline_lines(self) -> bool:
        return isinstance(self.profile, BSpline) and self.profile.degree <= 3

    @property
    def angular(self) -> tuple[bool, bool]:  # type: ignore[override]
        return (getattr(self.profile, "kind", "") == "ellipse", False)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape), np.broadcast_to(v, shape)
        p, slope = self.profile.both(u)
        p = p + v[..., None] * self.direction
        return p, slope, np.broadcast_to(self.direction, p.shape)

    def jacobian_variable(self) -> str:
        return "u"


@dataclass(slots=True)
class Offset(Surface):
    """Base surface moved by ``distance`` along its unit normal P_u × P_v."""

    base: Surface
    distance: float
    box: tuple[float, float, float, float]
    kind = "offset"

    @property
    def periods(self) -> tuple[float | None, float | None]:  # type: ignore[override]
        return self.base.periods

    @property
    def angular(self) -> tuple[bool, bool]:  # type: ignore[override]
        return self.base.angular

    def _normal(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        p, pu, pv = self.base.evaluate(u, v)
        n = np.cross(pu, pv)
        length = np.linalg.norm(n, axis=-1, keepdims=True)
        scale = np.linalg.norm(pu, axis=-1).max() * np.linalg.norm(pv, axis=-1).max()
        flat = length[..., 0] <= 1e-10 * scale
        if flat.any():  # at a pole of the base take the normal a little inside
            u0, u1, v0, v1 = self.box
            ui = u[flat] + 1e-5 * (0.5 * (u0 + u1) - u[flat])
            vi = v[flat] + 1e-5 * (0.5 * (v0 + v1) - v[flat])
            _, a, b = self.base.evaluate(ui, vi)
            n[flat] = np.cross(a, b)
            length = np.linalg.norm(n, axis=-1, keepdims=True)
        return p, n / np.where(length > 0.0, length, 1.0)

    def points(self, u: FloatArray, v: FloatArray) -> FloatArray:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        p, n = self._normal(np.broadcast_to(u, shape), np.broadcast_to(v, shape))
        return np.asarray(p + self.distance * n)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape), np.broadcast_to(v, shape)
        if isinstance(self.base, SplineSurface):
            found = self._exact(*self.base.second(u, v))
            if found is not None:
                return found
        u0, u1, v0, v1 = self.box
        p, n = self._normal(u, v)
        _, pu, pv = self.base.evaluate(u, v)
        # Derivatives of the unit normal by fourth-order central differences: error about 1e-12.
        step = []
        for hu, hv in ((1e-3 * (u1 - u0), 0.0), (0.0, 1e-3 * (v1 - v0))):
            h = hu + hv
            near = self._normal(u + hu, v + hv)[1] - self._normal(u - hu, v - hv)[1]
            far = self._normal(u + 2 * hu, v + 2 * hv)[1] - self._normal(u - 2 * hu, v - 2 * hv)[1]
            step.append((8.0 * near - far) / (12.0 * h))
        d = self.distance
        return p + d * n, pu + d * step[0], pv + d * step[1]

    def _exact(
        self, p: FloatArray, pu: FloatArray, pv: FloatArray, *second: FloatArray
    ) -> Points | None:
        """The offset from the derivatives of its base; None where that has no normal."""
        puu, puv, pvv = second
        n = np.cross(pu, pv)
        length = np.linalg.norm(n, axis=-1, keepdims=True)
        scale = np.linalg.norm(pu, axis=-1).max() * np.linalg.norm(pv, axis=-1).max()
        if length.min() <= 1e-6 * scale:
            return None
        n = n / length
        out = [p + self.distance * n]
        for first, a, b in ((pu, puu, puv), (pv, puv, pvv)):
            turned = (np.cross(a, pv) + np.cross(pu, b)) / length
            along = np.einsum("...k,...k->...", turned, n)[..., None]
            out.append(first + self.distance * (turned - along * n))
        return out[0], out[1], out[2]


@dataclass(slots=True)
class PointSurface(Surface):
    """A surface of an unknown kind, evaluated point by point by the CAD kernel."""

    point: Callable[[float, float], tuple[tuple[float, ...], ...]]
    periods: tuple[float | None, float | None] = (None, None)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        pairs = zip(
            np.broadcast_to(u, shape).ravel().tolist(),
            np.broadcast_to(v, shape).ravel().tolist(),
            strict=True,
        )
        rows = np.array([self.point(a, b) for a, b in pairs]).reshape(*shape, 3, 3)
        return rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]


def knot_lines(
    surface: Surface, low: FloatArray, high: FloatArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Knots in u and in v between two corners (2,), these included; None where there are none."""
    base = surface.base if isinstance(surface, Offset) else surface
    (u0, v0), (u1, v1) = low.tolist(), high.tolist()
    if isinstance(base, Revolution):
        return None, base.profile.breaks(v0, v1)
    if isinstance(base, Extrusion):
        return base.profile.breaks(u0, u1), None
    if not isinstance(base, SplineSurface):
        return None, None
    return (
        nurbs.knots_between(base.u_knots, base.periods[0], u0, u1),
        nurbs.knots_between(base.v_knots, base.periods[1], v0, v1),
    )
