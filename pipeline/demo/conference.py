"""A conference room: 24 lamps, a large table of curved outline, chairs and pots.

A scene of the kind and size of Fig. 8 (d) in Nishita & Nakamae 1993 (919 patches, 24 area lights).
Built in millimetres; the room is a solid of air in which all else stands, a few millimetres apart
where parts would touch.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .shapes import CHAIR_MATERIALS, GAP, chair, one_solid, write_files

if TYPE_CHECKING:
    import cadquery as cq

#: Interior: length along x, width along y, height. Its upright edges are round. [mm]
LENGTH, WIDTH, HEIGHT = 8400.0, 6000.0, 3000.0
CORNER = 900.0
#: Table: half lengths, half width at its ends, and how far sides and ends bulge. [mm]
TABLE_X, TABLE_Y = 1900.0, 600.0
BULGE_X, BULGE_Y = 300.0, 200.0
TABLE_TOP, THICKNESS = 740.0, 40.0
#: Lamps: rows along x and y, distances, length and width of one, and how far it bulges. [mm]
LAMPS = (6, 4)
LAMP_PITCH = (1300.0, 1400.0)
LAMP_SIZE, LAMP_BULGE = (900.0, 240.0), 60.0
#: Height of the lamps' flat tops above the floor. [mm]
LAMP_HEIGHT = 2700.0
#: Chairs: centre of the seat [mm], and turn about the vertical; the back is at +y when 0. [deg]
CHAIRS = (
    *((x, 1010.0 - 0.00005 * x**2, 0.0) for x in (-1350.0, -450.0, 450.0, 1350.0)),
    *((x, -1010.0 + 0.00005 * x**2, 180.0) for x in (-1350.0, -450.0, 450.0, 1350.0)),
    (-2440.0, 0.0, 90.0),
)
#: Pots on the floor, and one on the table: place and size against the profile. [mm]
POTS = ((-3500.0, 2300.0, 0.0, 1.0), (3500.0, 2300.0, 0.0, 1.0), (0.0, 0.0, TABLE_TOP, 0.4))
#: Screen at the end of the table without a chair: thickness, width, height, middle. [mm]
SCREEN, SCREEN_AT = (60.0, 2200.0, 1300.0), (4100.0, 0.0, 1500.0)

SCENE = (
    """\
# A conference room in the evening: 24 lamps, no daylight.
schema_version = 1
title = "Demo conference room"
accuracy = 0.05

[[model]]
file = "conference.step"
name = "conference"

[[assign]]
parts = "room"
air = true

[[assign]]
parts = "room"
material = { reflectance = 0.6, name = "walls, painted" }

[[assign]]
parts = "room"
faces = "up"
material = { reflectance = [0.22, 0.24, 0.27], name = "floor, carpet" }

[[assign]]
parts = "room"
faces = "down"
material = { reflectance = 0.8, name = "ceiling, white" }

[[assign]]
parts = "**/table/*"
material = { reflectance = [0.48, 0.33, 0.20], name = "table, cherry" }

"""
    + CHAIR_MATERIALS
    + """\
[[assign]]
parts = "screen"
material = { reflectance = 0.08, name = "screen, switched off" }

[[assign]]
parts = "pot*"
material = { reflectance = [0.56, 0.30, 0.18], name = "pot, terracotta" }

[[assign]]
parts = "lamp*"
emitter = { flux_lm = 1600, cct_k = 4000, group = "lamps", power_w = 14 }

[[sensors]]
name = "table"
z_m = 0.75
spacing_m = 0.25
over = "conference/table/top"

[[sensors]]
name = "room"
z_m = 0.8
spacing_m = 0.6
margin_m = 0.6
over = "conference/room"

[[cameras]]
name = "corner"
eye_m = [3.7, -2.4, 1.75]
target_m = [-0.6, 0.35, 0.8]
fov_deg = 78

[[requirements]]
sensors = "table"
metric = "E_avg_lx"
min = 500
"""
)


def room() -> cq.Workplane:
    """The air of the room."""
    import cadquery as cq

    return cq.Workplane("XY").rect(LENGTH, WIDTH).extrude(HEIGHT).edges("|Z").fillet(CORNER)


def table() -> cq.Assembly:
    """Top bounded by four arcs, on two round feet, about its own centre."""
    import cadquery as cq

    wood, dark = cq.Color(0.72, 0.60, 0.47), cq.Color(0.55, 0.42, 0.30)
    x, y = TABLE_X, TABLE_Y
    top = (
        cq.Workplane("XY")
        .moveTo(-x, -y)
        .threePointArc((0, -y - BULGE_Y), (x, -y))
        .threePointArc((x + BULGE_X, 0), (x, y))
        .threePointArc((0, y + BULGE_Y), (-x, y))
        .threePointArc((-x - BULGE_X, 0), (-x, -y))
        .close()
        .extrude(THICKNESS)
    )
    foot = cq.Workplane("XY").circle(260).extrude(TABLE_TOP - THICKNESS - 2 * GAP)
    table = cq.Assembly(name="table")
    place = cq.Location((0, 0, TABLE_TOP - THICKNESS))
    table.add(one_solid(top), name="top", loc=place, color=wood)
    for k, at in enumerate((-1150.0, 1150.0)):
        place = cq.Location((at, 0, GAP))
        table.add(one_solid(foot), name=f"foot:{k + 1}", loc=place, color=dark)
    return table


def pot(scale: float) -> cq.Workplane:
    """Open vessel of revolution, 10 mm thick at the rim."""
    import cadquery as cq

    outside = [(150.0, 0.0), (215.0, 190.0), (185.0, 420.0), (240.0, 600.0)]
    inside = [(228.0, 600.0), (172.0, 420.0), (200.0, 190.0), (140.0, 25.0)]
    return (
        cq.Workplane("XZ")
        .polyline([(0.0, 0.0), (scale * outside[0][0], 0.0)])
        .spline([(scale * r, scale * z) for r, z in outside[1:]], includeCurrent=True)
        .lineTo(scale * inside[0][0], scale * inside[0][1])
        .spline([(scale * r, scale * z) for r, z in inside[1:]], includeCurrent=True)
        .lineTo(0.0, scale * inside[-1][1])
        .close()
        .revolve(360.0, (0, 0, 0), (0, 1, 0))
    )


def lamp() -> cq.Workplane:
    """Slice of a cylinder, round side down, along x."""
    import cadquery as cq

    half = 0.5 * LAMP_SIZE[1]
    return (
        cq.Workplane("YZ")
        .moveTo(-half, 0)
        .threePointArc((0, -LAMP_BULGE), (half, 0))
        .close()
        .extrude(0.5 * LAMP_SIZE[0], both=True)
    )


def build() -> cq.Assembly:
    """The whole conference room."""
    import cadquery as cq

    clay, warm = cq.Color(0.77, 0.58, 0.46), cq.Color(1.0, 0.96, 0.88)
    conference = cq.Assembly(name="conference")
    conference.add(one_solid(room()), name="room", color=cq.Color(0.85, 0.85, 0.82))
    conference.add(table(), name="table", loc=cq.Location((0, 0, GAP)))
    for k, (x, y, turn) in enumerate(CHAIRS):
        place = cq.Location((x, y, GAP), (0, 0, 1), turn)
        # Built anew each time: CadQuery leaves the parts of a repeated sub-assembly without names.
        conference.add(chair(), name=f"chair:{k + 1}", loc=place)
    for k, (x, y, z, scale) in enumerate(POTS):
        place = cq.Location((x, y, z + 2 * GAP))
        conference.add(one_solid(pot(scale)), name=f"pot:{k + 1}", loc=place, color=clay)
    screen, grey = one_solid(cq.Workplane("XY").box(*SCREEN)), cq.Color(0.32, 0.32, 0.32)
    conference.add(screen, name="screen", loc=cq.Location(SCREEN_AT), color=grey)
    number = 0
    for i in range(LAMPS[0]):
        for j in range(LAMPS[1]):
            number += 1
            x = LAMP_PITCH[0] * (i - 0.5 * (LAMPS[0] - 1))
            y = LAMP_PITCH[1] * (j - 0.5 * (LAMPS[1] - 1))
            place = cq.Location((x, y, LAMP_HEIGHT))
            conference.add(one_solid(lamp()), name=f"lamp:{number}", loc=place, color=warm)
    return conference


def write(folder: Path) -> Path:
    """Write ``conference.step`` and ``conference.toml`` into ``folder``; return the scene file."""
    return write_files(folder, build(), SCENE)
