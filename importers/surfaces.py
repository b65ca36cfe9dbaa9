"""Surfaces as arrays: points and first derivatives at many parameters at once.

Every surface has ``kind`` (a word of `Face.kind`), ``periods`` (u, v; None when not periodic),
``angular`` (whether u and v are angles of a circle) and ``evaluate(u, v) -> P, P_u, P_v``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from . import nurbs
from .curves import Curve

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

    def points(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Points only (..., 3)."""
        return self.evaluate(u, v)[0]

    def jacobian_variable(self) -> str:
        """Which parameters |P_u × P_v| depends on: "", "u", "v" or "uv"."""
        return "uv"


@dataclass(slots=True)
class Plane(Surface):
    """origin + u x + v y."""

    frame: Frame
    kind = "plane"

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

    def _meridian(self, v: FloatArray) -> tuple[FloatArray, ...]:
        one = np.ones_like(v)
        if self.kind == "cylinder":
            return self.radius * one, v, 0.0 * one, one
        if self.kind == "cone":
            s, c = np.sin(self.angle), np.cos(self.angle)
            return self.radius + v * s, v * c, s * one, c * one
        r = self.radius if self.kind == "sphere" else self.minor
        major = 0.0 if self.kind == "sphere" else self.radius
        return major + r * np.cos(v), r * np.sin(v), -r * np.sin(v), r * np.cos(v)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        o, x, y, z = self.frame
        rho, zeta, rho_v, zeta_v = (a[..., None] for a in self._meridian(v))
        c, s = np.cos(u)[..., None], np.sin(u)[..., None]
        radial, around = c * x + s * y, c * y - s * x
        return o + rho * radial + zeta * z, rho * around, rho_v * radial + zeta_v * z

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

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape).ravel(), np.broadcast_to(v, shape).ravel()
        u = nurbs.wrap(u, float(self.u_knots[0]), self.periods[0])
        v = nurbs.wrap(v, float(self.v_knots[0]), self.periods[1])
        i, s, ds = nurbs.locate(self.u_knots, u)
        j, t, dt = nurbs.locate(self.v_knots, v)
        pu, pv = self.degrees
        bu, bv = nurbs.bernstein_basis(pu, s), nurbs.bernstein_basis(pv, t)
        net = self.pieces[i, j]
        along_v = np.einsum("nb,nabk->nak", bv, net)
        h = np.einsum("na,nak->nk", bu, along_v)
        hu = np.einsum("na,nak->nk", nurbs.bernstein_slope(pu, s), along_v) / ds[:, None]
        dv = np.einsum("nb,nabk->nak", nurbs.bernstein_slope(pv, t), net)
        hv = np.einsum("na,nak->nk", bu, dv) / dt[:, None]
        w = h[:, 3:]
        p = h[:, :3] / w
        pu_ = (hu[:, :3] - hu[:, 3:] * p) / w
        pv_ = (hv[:, :3] - hv[:, 3:] * p) / w
        return p.reshape(*shape, 3), pu_.reshape(*shape, 3), pv_.reshape(*shape, 3)


@dataclass(slots=True)
class Revolution(Surface):
    """Profile C(v) turned by the angle u about the line through ``origin`` along ``axis``."""

    origin: FloatArray
    axis: FloatArray
    profile: Curve
    kind = "revolution"
    periods = (TURN, None)
    angular = (True, False)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape), np.broadcast_to(v, shape)
        a = self.axis
        q, dq = self.profile.evaluate(v) - self.origin, self.profile.slope(v)
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
    def angular(self) -> tuple[bool, bool]:  # type: ignore[override]
        return (getattr(self.profile, "kind", "") == "ellipse", False)

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape), np.broadcast_to(v, shape)
        p = self.profile.evaluate(u) + v[..., None] * self.direction
        return p, self.profile.slope(u), np.broadcast_to(self.direction, p.shape)

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

    def evaluate(self, u: FloatArray, v: FloatArray) -> Points:
        shape = np.broadcast_shapes(np.shape(u), np.shape(v))
        u, v = np.broadcast_to(u, shape), np.broadcast_to(v, shape)
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
