"""A side-lit office: curved wall, domed ceiling, round column, desks, chairs and two pendants.

Built in millimetres, as CadQuery writes STEP files. Parts stand 2 mm apart where they would touch.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .shapes import CHAIR_MATERIALS, GAP, chair, one_solid, write_files

if TYPE_CHECKING:
    import cadquery as cq

#: Interior: width along x, depth of the side walls along y, height. [mm]
WIDTH, DEPTH, HEIGHT = 6000.0, 3800.0, 2800.0
#: How far the curved wall at the back bulges out. [mm]
BULGE = 700.0
WALL = 250.0
#: Window in the wall y = 0: left edge, sill, width, height. [mm]
WINDOW = (900.0, 900.0, 4200.0, 1500.0)
DESKS = ((1700.0, 1500.0), (4300.0, 1500.0))
DESK_TOP = 740.0

SCENE = (
    """\
# A side-lit office under an overcast sky with both pendants on.
schema_version = 1
title = "Demo office"
accuracy = 0.05

[[model]]
file = "office.step"
name = "office"

[[assign]]
parts = "room"
material = { reflectance = 0.7, name = "walls, painted" }

[[assign]]
parts = "room"
faces = "up"
material = { reflectance = [0.32, 0.27, 0.22], name = "floor, cork" }

[[assign]]
parts = "room"
faces = "down"
material = { reflectance = 0.85, name = "ceiling, white" }

[[assign]]
parts = "frame"
material = { reflectance = 0.6, name = "window frame" }

[[assign]]
parts = "column"
material = { reflectance = 0.5, name = "column, concrete" }

[[assign]]
parts = "**/desk*/*"
material = { reflectance = [0.55, 0.40, 0.26], name = "desk, oak" }

"""
    + CHAIR_MATERIALS
    + """\
[[assign]]
parts = "lamp*"
emitter = { flux_lm = 3200, cct_k = 4000, group = "lamps", power_w = 26 }

[sky]
model = "cie"
type = 16
diffuse_illuminance_lx = 10000

[ground]
reflectance = 0.2

[[sensors]]
name = "workplane"
z_m = 0.8
spacing_m = 0.5
margin_m = 0.5

[[cameras]]
name = "corner"
eye_m = [5.6, 3.5, 1.7]
target_m = [1.9, 1.0, 1.05]
fov_deg = 78

[[requirements]]
sensors = "workplane"
metric = "E_avg_lx"
min = 300
"""
)


def room() -> cq.Workplane:
    """Walls, floor and ceiling in one solid: a block minus the air of the room."""
    import cadquery as cq

    air = (
        cq.Workplane("XY")
        .polyline([(0, DEPTH), (0, 0), (WIDTH, 0), (WIDTH, DEPTH)])
        .threePointArc((WIDTH / 2, DEPTH + BULGE), (0, DEPTH))
        .close()
        .extrude(HEIGHT)
    )
    # Spherical cap of this base radius and rise, above the ceiling.
    base, rise = 900.0, 400.0
    radius = (base**2 + rise**2) / (2 * rise)
    dome = cq.Workplane("XY").sphere(radius).translate((3000, 2300, HEIGHT + rise - radius))
    x, sill, width, height = WINDOW
    opening = cq.Workplane("XY").box(width, 3 * WALL, height, centered=False)
    block = cq.Workplane("XY").box(
        WIDTH + 2 * WALL, DEPTH + BULGE + 2 * WALL, HEIGHT + rise + 2 * WALL, centered=False
    )
    return (
        block.translate((-WALL, -WALL, -WALL))
        .cut(air)
        .cut(dome)
        .cut(opening.translate((x, -2 * WALL, sill)))
    )


def frame() -> cq.Workplane:
    """Window frame with one mullion, standing in the middle of the wall."""
    import cadquery as cq

    x, sill, width, height = WINDOW
    profile, depth = 60.0, 70.0
    w, h = width - 2 * GAP, height - 2 * GAP
    pane = (w - 3 * profile) / 2
    bar = cq.Workplane("XY").box(w, depth, h, centered=False)
    for k in range(2):
        hole = cq.Workplane("XY").box(pane, 3 * depth, h - 2 * profile, centered=False)
        bar = bar.cut(hole.translate((profile + k * (pane + profile), -depth, profile)))
    return bar.translate((x + GAP, -0.5 * (WALL + depth), sill + GAP))


def desk() -> cq.Assembly:
    """Table top on two side panels, about its own centre."""
    import cadquery as cq

    length, width, thickness = 1600.0, 800.0, 30.0
    wood = cq.Color(0.76, 0.65, 0.52)
    top = cq.Workplane("XY").box(length, width, thickness)
    side = cq.Workplane("XY").box(thickness, width - 100, DESK_TOP - thickness - 2 * GAP)
    desk = cq.Assembly(name="desk")
    desk.add(
        one_solid(top), name="top", loc=cq.Location((0, 0, DESK_TOP - thickness / 2)), color=wood
    )
    for k, x in enumerate((-0.5 * length + 60, 0.5 * length - 60)):
        place = cq.Location((x, 0, 0.5 * (DESK_TOP - thickness)))
        desk.add(one_solid(side), name=f"side:{k + 1}", loc=place, color=wood)
    return desk


def lamp() -> cq.Workplane:
    """Half cylinder, round side down, along x."""
    import cadquery as cq

    return (
        cq.Workplane("YZ")
        .moveTo(-80, 0)
        .threePointArc((0, -80), (80, 0))
        .close()
        .extrude(600, both=True)
    )


def build() -> cq.Assembly:
    """The whole office."""
    import cadquery as cq

    office = cq.Assembly(name="office")
    office.add(one_solid(room()), name="room", color=cq.Color(0.85, 0.85, 0.82))
    office.add(one_solid(frame()), name="frame", color=cq.Color(0.80, 0.80, 0.80))
    column = one_solid(cq.Workplane("XY").circle(150).extrude(HEIGHT - 2 * GAP))
    grey, warm = cq.Color(0.73, 0.73, 0.73), cq.Color(1.0, 0.96, 0.88)
    office.add(column, name="column", loc=cq.Location((1500, 3400, GAP)), color=grey)
    # Built anew each time: CadQuery leaves the parts of a repeated sub-assembly without names.
    number = 0
    for k, (x, y) in enumerate(DESKS):
        office.add(desk(), name=f"desk:{k + 1}", loc=cq.Location((x, y, GAP)))
        for side, turn in ((-1, 180), (1, 0)):
            number += 1
            place = cq.Location((x, y + 620 * side, GAP), (0, 0, 1), turn)
            office.add(chair(), name=f"chair:{number}", loc=place)
        office.add(
            one_solid(lamp()), name=f"lamp:{k + 1}", loc=cq.Location((x, y, 2000)), color=warm
        )
    return office


def write(folder: Path) -> Path:
    """Write ``office.step`` and ``office.toml`` into ``folder``; return the scene file."""
    return write_files(folder, build(), SCENE)
