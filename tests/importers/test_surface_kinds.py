"""Every kind of surface of the CAD kernel, whole and trimmed, against the kernel's own points."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepLib import BRepLib
from OCP.Geom import (
    Geom_BezierSurface,
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Ellipse,
    Geom_OffsetSurface,
    Geom_RectangularTrimmedSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
)
from OCP.Geom2d import Geom2d_Ellipse
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax2d, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal, TColStd_Array2OfReal
from patchlight.importers import from_cadquery
from patchlight.importers.assemble import diagonal


def array(kind, values):
    out = kind(1, len(values))
    for i, value in enumerate(values, 1):
        out.SetValue(i, value)
    return out


def poles(nu, nv, height):
    """A grid of poles over [0, 2] x [0, 1], bent by ``height(x, y)``."""
    out = TColgp_Array2OfPnt(1, nu, 1, nv)
    for i, x in enumerate(np.linspace(0.0, 2.0, nu), 1):
        for j, y in enumerate(np.linspace(0.0, 1.0, nv), 1):
            out.SetValue(i, j, gp_Pnt(x, y, height(x, y)))
    return out


def wave(x, y):
    return 0.3 * math.sin(2.0 * x) * math.cos(3.0 * y)


def weights(nu, nv):
    out = TColStd_Array2OfReal(1, nu, 1, nv)
    for i in range(1, nu + 1):
        for j in range(1, nv + 1):
            out.SetValue(i, j, 1.0 + 0.3 * ((i + j) % 3))
    return out


def bspline(nu, nv, du, dv, ku, mu, kv, mv, *, rational=False):
    real = [array(TColStd_Array1OfReal, k) for k in (ku, kv)]
    whole = [array(TColStd_Array1OfInteger, m) for m in (mu, mv)]
    grid = (poles(nu, nv, wave),) + ((weights(nu, nv),) if rational else ())
    return Geom_BSplineSurface(*grid, real[0], real[1], whole[0], whole[1], du, dv)


def profile():
    points = [gp_Pnt(1.0 + 0.2 * math.sin(2.0 * t), 0.0, t) for t in np.linspace(0.0, 2.0, 6)]
    return Geom_BSplineCurve(
        array(TColgp_Array1OfPnt, points), array(TColStd_Array1OfReal, [0.0, 0.4, 1.0]),
        array(TColStd_Array1OfInteger, [4, 2, 4]), 3,
    )  # fmt: skip


def tube():
    """Periodic in u: a bent closed strip."""
    grid = TColgp_Array2OfPnt(1, 6, 1, 3)
    for i in range(6):
        a = 2.0 * math.pi * i / 6
        for j in range(3):
            r = 1.0 + 0.3 * (j == 1) + 0.1 * (i % 2)
            grid.SetValue(i + 1, j + 1, gp_Pnt(r * math.cos(a), r * math.sin(a), float(j)))
    knots = array(TColStd_Array1OfReal, [float(k) for k in range(7)])
    once = array(TColStd_Array1OfInteger, [1] * 7)
    ends = array(TColStd_Array1OfReal, [0.0, 1.0]), array(TColStd_Array1OfInteger, [3, 3])
    return Geom_BSplineSurface(grid, knots, ends[0], once, ends[1], 3, 2, True, False)


def cubic():
    return bspline(5, 4, 3, 3, [0.0, 0.5, 1.0], [4, 1, 4], [0.0, 1.0], [4, 4])


SURFACES = {
    "bezier 5x4": (lambda: Geom_BezierSurface(poles(6, 5, wave)), "bezier", False),
    "bezier 3x2 rational": (
        lambda: Geom_BezierSurface(poles(4, 3, wave), weights(4, 3)), "bezier", True,
    ),
    "bspline 3x3": (cubic, "bspline", True),
    "bspline rational": (
        lambda: bspline(
            5, 4, 3, 3, [0.0, 0.5, 1.0], [4, 1, 4], [0.0, 1.0], [4, 4], rational=True
        ), "bspline", True,
    ),
    "bspline 5x2": (
        lambda: bspline(8, 3, 5, 2, [0.0, 0.6, 1.0], [6, 2, 6], [0.0, 1.0], [3, 3]), "bspline",
        False,
    ),
    "bspline with a crease": (
        lambda: bspline(7, 3, 3, 2, [0.0, 0.5, 1.0], [4, 3, 4], [0.0, 1.0], [3, 3]), "bspline",
        True,
    ),
    "bspline unclamped": (
        lambda: bspline(
            5, 3, 3, 2, [float(k) for k in range(9)], [1] * 9, [0.0, 1.0], [3, 3]
        ), "bspline", True,
    ),
    "bspline periodic": (tube, "bspline", True),
    "revolution": (
        lambda: Geom_SurfaceOfRevolution(profile(), gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))),
        "revolution", True,
    ),
    "extrusion of a spline": (
        lambda: Geom_RectangularTrimmedSurface(
            Geom_SurfaceOfLinearExtrusion(profile(), gp_Dir(0, 1, 0.2)), 0.0, 1.0, 0.0, 2.0
        ), "extrusion", True,
    ),
    "extrusion of an ellipse": (
        lambda: Geom_RectangularTrimmedSurface(
            Geom_SurfaceOfLinearExtrusion(
                Geom_Ellipse(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 2.0, 1.0), gp_Dir(0, 0, 1)
            ), 0.0, 4.0, 0.0, 1.5,
        ), "extrusion", True,
    ),
    "offset": (lambda: Geom_OffsetSurface(cubic(), 0.05), "offset", False),
}  # fmt: skip


def worst_distance(model, surface):
    """Largest distance [mm] of points of the patches from a surface of the kernel."""
    t = np.array([0.0, 0.13, 0.5, 0.87, 1.0])
    u, v = (g.ravel() for g in np.meshgrid(t, t))
    points = model.patches.evaluate(u, v).reshape(-1, 3) * 1e3
    step = max(1, len(points) // 40)
    return max(
        GeomAPI_ProjectPointOnSurf(gp_Pnt(*p), surface).LowerDistance()
        for p in points[::step].tolist()
    )


@pytest.mark.parametrize(
    ("name", "trimmed"),
    [(name, False) for name in SURFACES]
    # The kernel takes long to cut them, and minutes for the periodic one.
    + [
        pytest.param(name, True, marks=pytest.mark.slow)
        for name in SURFACES
        if name != "bspline periodic"
    ],
)
def test_surface(name, trimmed):
    make, kind, exact = SURFACES[name]
    surface = make()
    face = cq.Face(BRepBuilderAPI_MakeFace(surface, 1e-7).Face())
    if trimmed:
        u0, u1, v0, v1 = face._uvBounds()
        at = surface.Value(0.55 * u0 + 0.45 * u1, 0.55 * v0 + 0.45 * v1).Coord()
        drill = cq.Solid.makeSphere(0.25).moved(cq.Location(at))
        found = face.cut(drill).Faces()
        assert len(found) == 1 and found[0].Area() < face.Area() - 1e-3
        face = found[0]
    model = from_cadquery(face)
    (row,) = model.faces
    assert row.kind == kind and not row.failed
    size = diagonal(face.wrapped)
    if trimmed:
        assert row.area_error < 1e-4
    else:
        assert row.exact == exact
        assert row.area_error < (1e-6 if exact else 1e-4)
    assert worst_distance(model, surface) < (1e-9 if exact and not trimmed else 1.1e-4) * size
    # What misses the tolerance says so.
    if row.reason != "the tolerance was not reached":
        assert row.deviation_m <= 1e-7 * size
        # Next to a trim the surface is bent a little to meet the edge of the file.
        assert row.angle_deg <= 1.2


def test_a_trim_across_the_seam_of_a_periodic_spline():
    """An ellipse in (u, v) around a point of the seam; its area by quadrature in polar form."""
    surface = tube()
    middle, major, minor = gp_Pnt2d(0.0, 0.5), 0.8, 0.3
    ellipse = Geom2d_Ellipse(gp_Ax2d(middle, gp_Dir2d(1, 0)), major, minor)
    edge = BRepBuilderAPI_MakeEdge(ellipse, surface).Edge()
    wire = BRepBuilderAPI_MakeWire(edge).Wire()
    BRepLib.BuildCurves3d_s(wire)
    face = cq.Face(BRepBuilderAPI_MakeFace(surface, wire).Face())
    model = from_cadquery(face)
    (row,) = model.faces
    assert row.kind == "bspline" and not row.failed and row.area_error < 1e-4
    size = diagonal(face.wrapped)
    assert row.deviation_m <= 1e-7 * size and row.angle_deg <= 1.2
    assert worst_distance(model, surface) < 1.1e-4 * size
    # The surface is C2 in u across the knots -1, 0 and 1: Gauss' rule between them is not exact.
    x, w = np.polynomial.legendre.leggauss(40)
    area = 0.0
    p, a, b = gp_Pnt(), gp_Vec(), gp_Vec()
    for radius, wr in zip(0.5 * (x + 1.0), 0.5 * w, strict=True):
        for angle, wa in zip(math.pi * (x + 1.0), math.pi * w, strict=True):
            u, v = major * radius * math.cos(angle), 0.5 + minor * radius * math.sin(angle)
            surface.D1(u % 6.0, v, p, a, b)
            area += wr * wa * radius * major * minor * a.Crossed(b).Magnitude()
    assert model.patches.areas().sum() * 1e6 == pytest.approx(area, rel=1e-4)
