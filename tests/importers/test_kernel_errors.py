"""Exceptions of the CAD kernel cost a face; those of ours are never taken for geometry."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.Geom import Geom_Plane
from OCP.gp import gp_Dir
from OCP.Standard import Standard_Failure
from OCP.StdFail import StdFail_NotDone
from patchlight.importers import edge_kinds, extract, from_cadquery
from patchlight.importers.kernel_errors import asking_the_kernel
from patchlight.importers.surfaces import PointSurface
from patchlight.solver.errors import GeometryError

BOX = cq.Workplane().box(1, 2, 3)


@pytest.mark.parametrize("error", [Standard_Failure, StdFail_NotDone])
def test_errors_of_the_kernel_become_ours(error):
    with pytest.raises(GeometryError, match=f"the CAD kernel failed: {error.__name__} why"):
        with asking_the_kernel():
            raise error("why")


def test_a_real_one_does():
    with pytest.raises(GeometryError, match="the CAD kernel failed: Standard_ConstructionError"):
        with asking_the_kernel():
            gp_Dir(0.0, 0.0, 0.0)


@pytest.mark.parametrize("error", [ValueError, IndexError, RuntimeError])
def test_other_errors_pass(error):
    with pytest.raises(error):
        with asking_the_kernel():
            raise error("ours")


def failing(kind):
    def point(*_):
        with asking_the_kernel():
            raise kind("no point")

    return point


def test_a_face_that_the_kernel_cannot_read_is_named(monkeypatch):
    read = extract.surface

    def surface(geometry, box):
        plane = read(geometry, box)
        if isinstance(geometry, Geom_Plane) and abs(plane.frame[3][2]) > 0.5:
            raise Standard_Failure("no such surface")
        return plane

    monkeypatch.setattr(extract, "surface", surface)
    model = from_cadquery(BOX, cache=False)
    failed = [f for f in model.faces if f.failed]
    assert len(failed) == 2 and len(model.faces) == 6
    assert all("the CAD kernel failed: Standard_Failure no such" in f.reason for f in failed)


@pytest.mark.parametrize("kind", [Standard_Failure, ZeroDivisionError])
def test_only_the_kernel_leaves_an_angle_unknown(monkeypatch, kind):
    """A face whose surface cannot be evaluated along its edges has no normal there."""
    convert = edge_kinds.edge_facts

    def with_a_bad_surface(raws, *rest):
        raws[0].surface = PointSurface(failing(kind))
        for use in (u for uses in raws[0].loops for u in uses):
            use.curve = extract.Line(np.zeros(2), np.ones(2))
        return convert(raws, *rest)

    monkeypatch.setattr("patchlight.importers.assemble.edge_facts", with_a_bad_surface)
    if kind is Standard_Failure:
        model = from_cadquery(BOX, cache=False)
        assert np.isnan(model.edges.angle_deg).sum() == 4
        assert np.isfinite(model.edges.angle_deg).sum() == 8
    else:
        with pytest.raises(ZeroDivisionError):
            from_cadquery(BOX, cache=False)


def test_points_of_unknown_curves_and_surfaces_ask_the_kernel():
    """Kinds without arrays are asked point by point, where the kernel may fail."""

    class Broken:
        def D1(self, *_):
            raise Standard_Failure("at 0")

        def IsUPeriodic(self):
            return False

        IsVPeriodic = IsUPeriodic

    one = np.zeros(1)
    for make in (extract.curve_3d, extract.curve_2d):
        with pytest.raises(GeometryError, match="Standard_Failure at 0"):
            make(Broken()).evaluate(one)
    with pytest.raises(GeometryError, match="Standard_Failure at 0"):
        extract.surface(Broken(), (0.0, 1.0, 0.0, 1.0)).evaluate(one, one)
