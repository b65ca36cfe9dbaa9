"""Forty solids made in CadQuery that between them use every kind of surface and trim."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cadquery as cq
import matplotlib

W = cq.Workplane
#: A font that is there wherever matplotlib is.
FONT = str(Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf"))


def thread(turns: float = 3.0, pitch: float = 0.5, radius: float = 1.0) -> Any:
    """A triangular rib swept along a helix around a core."""
    path = cq.Wire.makeHelix(pitch, turns * pitch, radius)
    points = [(radius - 0.02, -0.2 * pitch), (radius + 0.2, 0.0), (radius - 0.02, 0.2 * pitch)]
    return W("XZ").polyline(points).close().sweep(W(obj=path), isFrenet=True)


def shade(rings: int, around: int) -> Any:
    """A thin cylinder with round holes through its wall."""
    out = W().circle(2.0).circle(1.96).extrude(3.0)
    for k in range(around // 2):
        drills = W("XZ").pushPoints([(0.0, 0.5 + 2.0 * i / rings) for i in range(rings)])
        turned = drills.circle(0.12).extrude(5.0, both=True)
        out = out.cut(turned.rotate((0, 0, 0), (0, 0, 1), 360.0 * k / around))
    return out


def vase() -> Any:
    """A spline turned about an axis."""
    line = [(1.5, 1.0), (0.7, 2.0), (1.0, 3.0)]
    return (
        W("XZ").moveTo(0, 0).lineTo(1, 0).spline(line, includeCurrent=True).lineTo(0, 3).close()
        .revolve(360, (0, 0, 0), (0, 1, 0))
    )  # fmt: skip


def wavy() -> Any:
    """A closed spline extruded."""
    points = [
        ((1.0 + 0.2 * math.cos(5 * a)) * math.cos(a), (1.0 + 0.2 * math.cos(5 * a)) * math.sin(a))
        for a in (2.0 * math.pi * k / 20 for k in range(20))
    ]
    return W().spline(points, periodic=True).close().extrude(1.0)


def torus(major: float = 2.0, minor: float = 0.5) -> Any:
    return W(cq.Solid.makeTorus(major, minor))


SOLIDS: dict[str, Callable[[], Any]] = {
    "box": lambda: W().box(1, 2, 3),
    "cylinder": lambda: W().cylinder(2, 1),
    "cone": lambda: W(cq.Solid.makeCone(1, 0, 2)),
    "frustum sector": lambda: W(cq.Solid.makeCone(1, 0.4, 2, angleDegrees=250)),
    "sphere": lambda: W().sphere(1),
    "sphere zone": lambda: W(cq.Solid.makeSphere(1, angleDegrees1=-30, angleDegrees2=50)),
    "sphere sector": lambda: W(cq.Solid.makeSphere(1, angleDegrees3=100)),
    "torus": torus,
    "torus sector": lambda: W(cq.Solid.makeTorus(2, 0.5)).cut(W().box(4, 4, 4, centered=False)),
    "wedge": lambda: W(cq.Solid.makeWedge(2, 1, 3, 0.5, 0.5, 1.5, 2)),
    "plate with 200 holes": lambda: W().box(21, 11, 0.5).rarray(1, 1, 20, 10).hole(0.6),
    "perforated shade": lambda: shade(4, 12),
    "text": lambda: W().text("Patch&8", 5, 1, fontPath=FONT),
    "sphere minus box": lambda: W().sphere(1).cut(W().box(1, 1, 1, centered=False)),
    "sphere minus beam": lambda: W().sphere(1).cut(W().box(0.8, 0.8, 4)),
    "sphere minus off-centre pin": lambda: W().sphere(1).cut(
        W().center(0.3, 0.2).circle(0.2).extrude(3)
    ),
    "pole inside a face": lambda: W().sphere(1).cut(W().box(3, 3, 3).translate((0, 2.0, 0))),
    "crossing cylinders": lambda: W().cylinder(4, 1).cut(W("YZ").cylinder(4, 0.5)),
    "equal crossing cylinders": lambda: W().cylinder(4, 1).union(W("YZ").cylinder(4, 1)),
    "oblique cut": lambda: W().cylinder(4, 1).cut(
        W().box(5, 5, 5).rotate((0, 0, 0), (1, 0, 0), 30).translate((0, 0, 3))
    ),
    "cone minus cylinder": lambda: W(cq.Solid.makeCone(1, 0.2, 2)).cut(
        W("XZ").center(0, 0.8).circle(0.3).extrude(3, both=True)
    ),
    "torus and cylinder": lambda: torus().union(W().cylinder(1, 2)),
    "torus minus box": lambda: torus().cut(W().box(1.3, 1.3, 0.4).translate((2, 0, 0.5))),
    "fillets": lambda: W().box(1, 2, 3).edges().fillet(0.2),
    "variable corners": lambda: W().box(2, 2, 1).edges("|Z").fillet(0.4).edges(">Z").fillet(0.2),
    "chamfers": lambda: W().box(1, 2, 3).edges().chamfer(0.2, 0.1),
    "boss with fillet": lambda: W().box(4, 4, 1).faces(">Z").workplane().circle(1).extrude(1)
    .faces(">Z[1]").edges("%CIRCLE").fillet(0.2),
    "loft": lambda: W().rect(2, 2).workplane(offset=2).circle(0.7).loft(),
    "ruled loft": lambda: W().rect(2, 1).workplane(offset=2).rect(1, 2).loft(ruled=True),
    "three-section loft": lambda: W().circle(1).workplane(offset=1).ellipse(1.5, 0.7)
    .workplane(offset=1).circle(0.5).loft(),
    "sweep": lambda: W().circle(0.3).sweep(
        W("XZ").spline([(0, 0), (1, 2), (3, 3)], tangents=[(0, 1), (1, 0)])
    ),
    "sweep along a helix": lambda: W("XZ").center(1, 0).circle(0.2).sweep(
        W(obj=cq.Wire.makeHelix(0.8, 1.6, 1)), isFrenet=True
    ),
    "thread": thread,
    "shell": lambda: W().box(2, 3, 1).edges("|Z").fillet(0.5).faces(">Z").shell(-0.1),
    "shelled cone": lambda: W(cq.Solid.makeCone(1, 0.6, 2)).faces(">Z").shell(0.1),
    "shelled vase": lambda: vase().faces(">Z").shell(-0.08),
    "vase": vase,
    "vault": lambda: W("XZ").moveTo(-2, 0).lineTo(-2, 1).threePointArc((0, 2), (2, 1))
    .lineTo(2, 0).close().extrude(3),
    "wavy column": wavy,
    "drafted": lambda: W().rect(2, 1).extrude(1, taper=10).edges(">Z").fillet(0.1),
    "twist": lambda: W().rect(1, 1).twistExtrude(2, 90),
    "ellipse column with a bore": lambda: W().ellipse(2, 1).extrude(2).cut(
        W("XZ").center(0.5, 1).circle(0.4).extrude(3, both=True)
    ),
    "slots and pockets": lambda: W().box(6, 4, 1).faces(">Z").workplane().slot2D(3, 1)
    .cutThruAll().faces(">Z").workplane().center(0, 1.4).rect(4, 0.5).cutBlind(-0.5),
}  # fmt: skip
