"""From B-rep faces to arrays: surface, boundary loops in (u, v), edges in space.

The CAD kernel is asked once per face and edge; everything after works on arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BezierSurface,
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_Line,
    Geom_OffsetSurface,
    Geom_Parabola,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import (
    Geom2d_BezierCurve,
    Geom2d_BSplineCurve,
    Geom2d_Circle,
    Geom2d_Ellipse,
    Geom2d_Hyperbola,
    Geom2d_Line,
    Geom2d_Parabola,
    Geom2d_TrimmedCurve,
)
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec, gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Iterator
from OCP.TopTools import TopTools_IndexedMapOfShape
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray

from . import nurbs
from .curves import BSpline, Conic, Curve, Line, Sampled
from .kernel_errors import asking_the_kernel
from .surfaces import (
    Extrusion,
    Offset,
    Plane,
    PointSurface,
    Revolution,
    Round,
    SplineSurface,
    Surface,
)


@dataclass(slots=True)
class Edge:
    """A B-rep edge in space; ``curve`` is None when it is degenerate (a pole), or has none.

    ``vertices`` are the points at ``start`` and ``end`` that all edges there share. ``tolerance``
    bounds the distance of the edge's chain from the curve, ``gap`` is what a vertex lies off it.
    """

    index: int
    curve: Curve | None
    start: float
    end: float
    tolerance: float
    vertices: tuple[FloatArray | None, FloatArray | None] = (None, None)
    gap: float = 0.0
    #: Whether a face is exact only if the chain is.
    exact: bool = False
    degenerate: bool = False
    chain: Any = None
    stations: FloatArray | None = None


@dataclass(slots=True)
class EdgeUse:
    """An edge on a face: its curve in (u, v) and the sense in which the loop runs along it.

    ``degenerate`` is also what edges without a curve in space are converted as. ``places`` (9, 2)
    are points in (u, v), evenly from ``start`` to ``end``, from `edge_gaps`.
    """

    edge: Edge
    curve: Curve | None
    start: float
    end: float
    reversed: bool
    degenerate: bool
    places: FloatArray | None = None


@dataclass(slots=True)
class RawFace:
    """One B-rep face as arrays."""

    surface: Surface | None
    reversed: bool
    loops: list[list[EdgeUse]]
    tolerance: float
    reason: str = ""


def _array(p: Any) -> FloatArray:
    """Coordinates of a point or direction."""
    return np.array(p.Coord())


def _frame(position: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    return (
        _array(position.Location()),
        _array(position.XDirection()),
        _array(position.YDirection()),
        _array(position.Direction()),
    )


def _flat(knots: Any, multiplicities: Any) -> FloatArray:
    every = range(knots.Lower(), knots.Upper() + 1)
    return np.repeat([knots.Value(i) for i in every], [multiplicities.Value(i) for i in every])


def _spline_curve(c: Any) -> Curve:
    period = None
    if c.IsPeriodic():
        period = c.Period()
        c = c.Copy()
        c.SetNotPeriodic()
    n, degree = c.NbPoles(), c.Degree()
    points = np.array([c.Pole(i).Coord() for i in range(1, n + 1)])
    w = np.array([c.Weight(i) for i in range(1, n + 1)]) if c.IsRational() else np.ones(n)
    h = np.concatenate([points * w[:, None], w[:, None]], axis=1)
    flat = _flat(c.Knots(), c.Multiplicities())
    breaks, pieces = nurbs.bezier_pieces(flat, degree, h)
    return _simplest(BSpline(breaks, pieces, degree, period))


def _bezier_curve(c: Any) -> Curve:
    n = c.NbPoles()
    points = np.array([c.Pole(i).Coord() for i in range(1, n + 1)])
    w = np.array([c.Weight(i) for i in range(1, n + 1)])
    h = np.concatenate([points * w[:, None], w[:, None]], axis=1)
    return _simplest(BSpline(np.array([0.0, 1.0]), h[None], n - 1))


@cache
def _steps(n: int) -> FloatArray:
    """Shares (n, 1) of the way from the first to the last of n points in even steps."""
    return np.linspace(0.0, 1.0, n)[:, None]


def _simplest(curve: BSpline) -> Curve:
    """The line that a spline of one piece is to rounding, else the spline."""
    if len(curve.pieces) > 1:
        return curve
    net = curve.pieces[0]
    line = net[0] + _steps(len(net)) * (net[-1] - net[0])
    if np.abs(net - line).max() > 1e-15 * np.abs(net).max() or net[0, -1] != net[-1, -1]:
        return curve
    p, q = net[[0, -1], :-1] / net[0, -1]
    start, end = curve.knots
    direction = (q - p) / (end - start)
    return Line(p - start * direction, direction)


def curve_3d(c: Any) -> Curve:
    """A curve in space as arrays."""
    while isinstance(c, Geom_TrimmedCurve):
        c = c.BasisCurve()
    if isinstance(c, Geom_Line):
        p = c.Position()
        return Line(_array(p.Location()), _array(p.Direction()))
    if isinstance(c, Geom_Circle):
        o, x, y, _ = _frame(c.Position())
        return Conic("ellipse", o, c.Radius() * x, c.Radius() * y)
    if isinstance(c, Geom_Ellipse | Geom_Hyperbola):
        o, x, y, _ = _frame(c.Position())
        kind = "ellipse" if isinstance(c, Geom_Ellipse) else "hyperbola"
        return Conic(kind, o, c.MajorRadius() * x, c.MinorRadius() * y)
    if isinstance(c, Geom_Parabola):
        o, x, y, _ = _frame(c.Position())
        return Conic("parabola", o, x / (4.0 * c.Focal()), y)
    if isinstance(c, Geom_BSplineCurve):
        return _spline_curve(c)
    if isinstance(c, Geom_BezierCurve):
        return _bezier_curve(c)

    def point(t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        p, d = gp_Pnt(), gp_Vec()
        with asking_the_kernel():
            c.D1(t, p, d)
        return p.Coord(), d.Coord()

    return Sampled(point)


def curve_2d(c: Any) -> Curve:
    """A curve in (u, v) as arrays."""
    while isinstance(c, Geom2d_TrimmedCurve):
        c = c.BasisCurve()
    if isinstance(c, Geom2d_Line):
        return Line(_array(c.Location()), _array(c.Direction()))
    if isinstance(c, Geom2d_Circle | Geom2d_Ellipse | Geom2d_Hyperbola | Geom2d_Parabola):
        p = c.Position()
        o, x, y = _array(p.Location()), _array(p.XDirection()), _array(p.YDirection())
        if isinstance(c, Geom2d_Circle):
            return Conic("ellipse", o, c.Radius() * x, c.Radius() * y)
        if isinstance(c, Geom2d_Parabola):
            return Conic("parabola", o, x / (4.0 * c.Focal()), y)
        kind = "ellipse" if isinstance(c, Geom2d_Ellipse) else "hyperbola"
        return Conic(kind, o, c.MajorRadius() * x, c.MinorRadius() * y)
    if isinstance(c, Geom2d_BSplineCurve):
        return _spline_curve(c)
    if isinstance(c, Geom2d_BezierCurve):
        return _bezier_curve(c)

    def point(t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        p, d = gp_Pnt2d(), gp_Vec2d()
        with asking_the_kernel():
            c.D1(t, p, d)
        return p.Coord(), d.Coord()

    return Sampled(point)


def _spline_surface(s: Any) -> SplineSurface:
    if isinstance(s, Geom_BezierSurface):
        nu, nv = s.NbUPoles(), s.NbVPoles()
        u_flat = np.repeat([0.0, 1.0], nu)
        v_flat = np.repeat([0.0, 1.0], nv)
        du, dv, periods = nu - 1, nv - 1, (None, None)
    else:
        periods = (
            s.UPeriod() if s.IsUPeriodic() else None,
            s.VPeriod() if s.IsVPeriodic() else None,
        )
        if s.IsUPeriodic() or s.IsVPeriodic():
            s = s.Copy()
            if s.IsUPeriodic():
                s.SetUNotPeriodic()
            if s.IsVPeriodic():
                s.SetVNotPeriodic()
        nu, nv, du, dv = s.NbUPoles(), s.NbVPoles(), s.UDegree(), s.VDegree()
        u_flat = _flat(s.UKnots(), s.UMultiplicities())
        v_flat = _flat(s.VKnots(), s.VMultiplicities())
    h = np.ones((nu, nv, 4))
    pole = s.Pole
    h[..., :3] = [[pole(i, j).Coord() for j in range(1, nv + 1)] for i in range(1, nu + 1)]
    if s.IsURational() or s.IsVRational():
        weight = s.Weight
        h[..., 3] = [[weight(i, j) for j in range(1, nv + 1)] for i in range(1, nu + 1)]
        h[..., :3] *= h[..., 3:]
    u_knots, rows = nurbs.bezier_pieces(u_flat, du, h)  # (mu, du + 1, nv, 4)
    v_knots, both = nurbs.bezier_pieces(v_flat, dv, np.moveaxis(rows, 2, 0))
    pieces = np.ascontiguousarray(both.transpose(2, 0, 3, 1, 4))
    kind = "bezier" if isinstance(s, Geom_BezierSurface) else "bspline"

    def sharp(flat: FloatArray, degree: int, knots: FloatArray) -> FloatArray:
        value, count = np.unique(flat, return_counts=True)
        inner = (count >= degree) & (value > knots[0]) & (value < knots[-1])
        return np.asarray(value[inner])

    return SplineSurface(
        u_knots,
        v_knots,
        pieces,
        kind,
        periods,
        sharp(u_flat, du, u_knots),
        sharp(v_flat, dv, v_knots),
    )


def surface(s: Any, box: tuple[float, float, float, float]) -> Surface:
    """A surface as arrays; ``box`` bounds the face in (u0, u1, v0, v1)."""
    while isinstance(s, Geom_RectangularTrimmedSurface):
        s = s.BasisSurface()
    if isinstance(s, Geom_Plane):
        return Plane(_frame(s.Position()))
    if isinstance(s, Geom_CylindricalSurface):
        return Round(_frame(s.Position()), "cylinder", s.Radius())
    if isinstance(s, Geom_ConicalSurface):
        return Round(_frame(s.Position()), "cone", s.RefRadius(), 0.0, s.SemiAngle())
    if isinstance(s, Geom_SphericalSurface):
        return Round(_frame(s.Position()), "sphere", s.Radius())
    if isinstance(s, Geom_ToroidalSurface):
        return Round(_frame(s.Position()), "torus", s.MajorRadius(), s.MinorRadius())
    if isinstance(s, Geom_BSplineSurface | Geom_BezierSurface):
        return _spline_surface(s)
    if isinstance(s, Geom_SurfaceOfRevolution):
        axis = s.Axis()
        return Revolution(
            _array(axis.Location()), _array(axis.Direction()), curve_3d(s.BasisCurve())
        )
    if isinstance(s, Geom_SurfaceOfLinearExtrusion):
        period = s.UPeriod() if s.IsUPeriodic() else None
        return Extrusion(curve_3d(s.BasisCurve()), _array(s.Direction()), (period, None))
    if isinstance(s, Geom_OffsetSurface):
        return Offset(surface(s.BasisSurface(), box), s.Offset(), box)

    def point(u: float, v: float) -> tuple[tuple[float, ...], ...]:
        p, a, b = gp_Pnt(), gp_Vec(), gp_Vec()
        with asking_the_kernel():
            s.D1(u, v, p, a, b)
        return p.Coord(), a.Coord(), b.Coord()

    periods = (s.UPeriod() if s.IsUPeriodic() else None, s.VPeriod() if s.IsVPeriodic() else None)
    return PointSurface(point, periods)


def along_parameter(use: EdgeUse) -> bool:
    """Whether the curve in (u, v) is a line of constant u or v."""
    curve = use.curve
    return isinstance(curve, Line) and float(np.abs(curve.direction).min()) < 1e-9


class Extractor:
    """Extracts the faces of one shape; edges shared by faces are extracted once.

    ``tolerance`` [file units] is that of the chains of edges.
    """

    def __init__(self, shape: Any, tolerance: float) -> None:
        self._tolerance = tolerance
        self._map = TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(shape, TopAbs_EDGE, self._map)
        self._edges: dict[int, Edge] = {}
        self.count = self._map.Extent()

    def _edge(self, e: Any) -> Edge:
        index = self._map.FindIndex(e) - 1
        found = self._edges.get(index)
        if found is None:
            pole = bool(BRep_Tool.Degenerated_s(e))
            curve = None if pole else BRep_Tool.Curve_s(e, 0.0, 0.0)
            start, end = BRep_Tool.Range_s(e) if curve is not None else (0.0, 1.0)
            ends = []
            for vertex in (TopExp.FirstVertex_s(e, False), TopExp.LastVertex_s(e, False)):
                ends.append(None if vertex.IsNull() else np.array(BRep_Tool.Pnt_s(vertex).Coord()))
            array = None if curve is None else curve_3d(curve)
            found = Edge(
                index, array, start, end, self._tolerance, (ends[0], ends[1]), degenerate=pole
            )
            self._edges[index] = found
        return found

    def face(self, face: Any) -> RawFace:
        """Surface and loops of a face; loops run with the material of (u, v) on their left.

        Where the CAD kernel fails there is no surface, but its reason.
        """
        is_reversed = face.Orientation() == TopAbs_REVERSED
        try:
            with asking_the_kernel():
                return self._face(face, is_reversed)
        except GeometryError as error:
            return RawFace(None, is_reversed, [], 0.0, str(error))

    def _face(self, face: Any, is_reversed: bool) -> RawFace:
        f = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD))
        geometry = BRep_Tool.Surface_s(f)
        if geometry is None:
            return RawFace(None, is_reversed, [], 0.0, "the face has no surface (tessellated only)")
        planar = isinstance(geometry, Geom_Plane)
        box = (0.0, 1.0, 0.0, 1.0)
        if isinstance(geometry, Geom_OffsetSurface | Geom_RectangularTrimmedSurface):
            box = tuple(BRepTools.UVBounds_s(f))  # type: ignore[assignment]
        array = surface(geometry, box)
        loops = []
        iterator = TopoDS_Iterator(f)
        while iterator.More():
            item = iterator.Value()
            iterator.Next()
            if item.ShapeType() == TopAbs_WIRE:
                uses = self._loop(TopoDS.Wire_s(item), f, planar)
                if uses:
                    loops.append(uses)
        for uses in loops:
            for use in uses:
                use.edge.exact |= array.exact_spline_lines and (planar or along_parameter(use))
        return RawFace(array, is_reversed, loops, BRep_Tool.Tolerance_s(f))

    def _loop(self, wire: Any, face: Any, planar: bool) -> list[EdgeUse]:
        uses = []
        explorer = BRepTools_WireExplorer(wire, face)
        while explorer.More():
            e = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            edge = self._edge(e)
            degenerate = edge.curve is None
            reverse = e.Orientation() == TopAbs_REVERSED
            if planar and not degenerate:
                uses.append(EdgeUse(edge, None, edge.start, edge.end, reverse, False))
                continue
            pcurve = BRep_Tool.CurveOnSurface_s(e, face, 0.0, 0.0)
            if pcurve is None:
                continue
            start, end = BRep_Tool.Range_s(e, face)
            uses.append(EdgeUse(edge, curve_2d(pcurve), start, end, reverse, degenerate))
        return uses


def faces_of(shape: Any) -> list[Any]:
    """The distinct faces of a shape in the order of the kernel's explorer."""
    found, seen = [], TopTools_IndexedMapOfShape()
    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        item = explorer.Current()
        explorer.Next()
        if not seen.Contains(item):
            seen.Add(item)
            found.append(TopoDS.Face_s(item))
    return found
