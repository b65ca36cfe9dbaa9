"""Surfaces of many faces evaluated at once, and parts of a whole found by their number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from . import nurbs
from .curves import BSpline, Conic, Curve, Line, conic_functions
from .surfaces import Points, Round, SplineSurface, Surface

#: A parameter this share outside the knots of a periodic spline is still at its end.
EDGE = 1e-9
#: The largest share of the way through the knots that is in the last piece.
LAST = 1.0 - 1e-12


def rows_of(numbers: IntArray, wanted: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Positions in ``wanted`` (k,) and the rows of ``numbers`` (n,) that hold that number.

    Numbers that do not occur are left out.
    """
    order = np.argsort(numbers, kind="stable")
    ordered = numbers[order]
    first = np.searchsorted(ordered, wanted, side="left")
    last = np.searchsorted(ordered, wanted, side="right")
    for i in np.flatnonzero(last > first).tolist():
        yield i, order[first[i] : last[i]]


class Breaks:
    """Breaks of several splines, located in one search: spline k has its own in [k, k + 1)."""

    def __init__(self, breaks: Sequence[FloatArray], periods: Sequence[float | None]) -> None:
        self.first = np.array([b[0] for b in breaks])
        self.extent = np.array([b[-1] - b[0] for b in breaks])
        self.period = np.array([p or np.nan for p in periods])
        self.count = np.array([len(b) - 1 for b in breaks])
        self._keys = np.concatenate(
            [k + (b[:-1] - b[0]) / (b[-1] - b[0]) for k, b in enumerate(breaks)]
        )
        self._start = np.concatenate([b[:-1] for b in breaks])
        self._length = np.concatenate([np.diff(b) for b in breaks])
        self._base = np.cumsum(self.count) - self.count

    def locate(self, k: IntArray, t: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Piece of spline ``k`` (n,), local parameter and length of the piece at ``t`` (n,)."""
        x = (t - self.first[k]) / self.extent[k]
        periodic = self.period[k]
        outside = np.isfinite(periodic) & ((x < -EDGE) | (x > 1.0 + EDGE))
        if outside.any():
            t = np.where(outside, t - np.floor((t - self.first[k]) / periodic) * periodic, t)
            x = (t - self.first[k]) / self.extent[k]
        key = k + np.minimum(np.maximum(x, 0.0), LAST)
        i = np.searchsorted(self._keys, key, side="right") - 1
        return i - self._base[k], (t - self._start[i]) / self._length[i], self._length[i]


class CurveBatch:
    """Splines of the same degree."""

    def __init__(self, curves: Sequence[BSpline]) -> None:
        self._breaks = Breaks([c.knots for c in curves], [c.period for c in curves])
        self._pieces = np.concatenate([c.pieces for c in curves])
        self._base = np.cumsum(self._breaks.count) - self._breaks.count

    def evaluate(self, which: IntArray, t: FloatArray) -> FloatArray:
        """Points (m, a, d) of the curves ``which`` (m,) at ``t`` (m, a)."""
        k = np.repeat(which, t.shape[1])
        i, s, _ = self._breaks.locate(k, t.ravel())
        nets = self._pieces[self._base[k] + i]
        h = (nurbs.bernstein_basis(nets.shape[1] - 1, s)[:, None] @ nets)[:, 0]
        return np.asarray((h[:, :-1] / h[:, -1:]).reshape(*t.shape, -1))


def points_of(curves: Sequence[Curve], t: FloatArray, d: int) -> FloatArray:
    """Points (m, k, d) of curves (m,) at ``t`` (m, k): those of one sort in one go."""
    out = np.empty((*t.shape, d))
    sorts: dict[tuple[type, str], list[int]] = {}
    for i, curve in enumerate(curves):
        name = str(getattr(curve, "kind", getattr(curve, "degree", "")))
        sorts.setdefault((type(curve), name), []).append(i)
    for (sort, name), rows in sorts.items():
        own: list = [curves[i] for i in rows]
        if sort is Line:
            line = np.array([(c.origin, c.direction) for c in own])
            out[rows] = line[:, :1] + t[rows][..., None] * line[:, 1:]
        elif sort is Conic:
            frame = np.array([(c.center, c.x, c.y) for c in own])
            f, g = conic_functions(name, t[rows][..., None])
            out[rows] = frame[:, :1] + f * frame[:, 1:2] + g * frame[:, 2:]
        elif sort is BSpline:
            out[rows] = CurveBatch(own).evaluate(np.arange(len(rows)), t[rows])
        else:
            for i, curve in zip(rows, own, strict=True):
                out[i] = curve.evaluate(t[i])
    return out


class _Splines:
    """Spline surfaces of the same degrees."""

    def __init__(self, surfaces: Sequence[SplineSurface]) -> None:
        self._u = Breaks([s.u_knots for s in surfaces], [s.periods[0] for s in surfaces])
        self._v = Breaks([s.v_knots for s in surfaces], [s.periods[1] for s in surfaces])
        flat = [s.pieces.reshape(-1, *s.pieces.shape[2:]) for s in surfaces]
        self._pieces = np.concatenate(flat)
        self._base = np.cumsum([0, *(len(f) for f in flat[:-1])])

    def derivatives(
        self, which: IntArray, u: FloatArray, v: FloatArray, orders: nurbs.Orders
    ) -> tuple[FloatArray, ...]:
        k = np.repeat(which, u[0].size)
        i, s, ds = self._u.locate(k, u.ravel())
        j, t, dt = self._v.locate(k, v.ravel())
        nets = self._pieces[self._base[k] + i * self._v.count[k] + j]
        found = nurbs.patch_derivatives(nets, s, ds, t, dt, orders)
        return tuple(x.reshape(*u.shape, 3) for x in found)


class SurfaceBatch:
    """Surfaces numbered as given; those of one kind and degree are evaluated in one go."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self.surfaces = list(surfaces)
        self._frames = np.zeros((len(surfaces), 4, 3))
        self._meridians = np.zeros((len(surfaces), 4))
        #: Group of each surface, its place in the group, and the groups but for the first.
        self._group = np.zeros(len(surfaces), dtype=np.int64)
        self._place = np.zeros(len(surfaces), dtype=np.int64)
        groups: dict[object, list[Surface]] = {}
        for i, s in enumerate(surfaces):
            if isinstance(s, Round):
                self._frames[i] = s.frame
                self._meridians[i] = s.meridian
                continue
            name = s.degrees if isinstance(s, SplineSurface) else i
            own = groups.setdefault(name, [])
            self._group[i], self._place[i] = 1 + list(groups).index(name), len(own)
            own.append(s)
        self._others: list[_Splines | Surface] = [
            _Splines(own) if isinstance(own[0], SplineSurface) else own[0]  # type: ignore[arg-type]
            for own in groups.values()
        ]

    def evaluate(self, which: IntArray, u: FloatArray, v: FloatArray) -> Points:
        """Points and derivatives (m, ..., 3) of the surfaces ``which`` (m,) at u, v (m, ...)."""
        p, pu, pv = self._derivatives(which, u, v, nurbs.FIRST)
        return p, pu, pv

    def points(self, which: IntArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Points (m, ..., 3) alone."""
        return self._derivatives(which, u, v, nurbs.POINT)[0]

    def _derivatives(
        self, which: IntArray, u: FloatArray, v: FloatArray, orders: nurbs.Orders
    ) -> tuple[FloatArray, ...]:
        group = self._group[which]
        if not group.any():
            return self._turned(which, u, v)[: len(orders)]
        out = tuple(np.empty((*u.shape, 3)) for _ in orders)
        for k, rows in rows_of(group, np.arange(len(self._others) + 1)):
            own = which[rows]
            found: tuple[FloatArray, ...]
            if k == 0:
                found = self._turned(own, u[rows], v[rows])
            else:
                other = self._others[k - 1]
                if isinstance(other, _Splines):
                    found = other.derivatives(self._place[own], u[rows], v[rows], orders)
                elif len(orders) == 1:
                    found = (other.points(u[rows], v[rows]),)
                else:
                    found = other.evaluate(u[rows], v[rows])
            for whole, part in zip(out, found, strict=False):
                whole[rows] = part
        return out

    def _turned(self, which: IntArray, u: FloatArray, v: FloatArray) -> Points:
        lead = (len(which),) + (1,) * (u.ndim - 1)
        o, x, y, z = (self._frames[which, k].reshape(*lead, 3) for k in range(4))
        r0, s, c, m = (self._meridians[which, k].reshape(lead) for k in range(4))
        cv, sv = m * np.cos(v), m * np.sin(v)
        cu, su = np.cos(u)[..., None], np.sin(u)[..., None]
        rho, zeta = (r0 + v * s + cv)[..., None], (v * c + sv)[..., None]
        radial, around = cu * x + su * y, cu * y - su * x
        along = (s - sv)[..., None] * radial + (c + cv)[..., None] * z
        return o + rho * radial + zeta * z, rho * around, along
