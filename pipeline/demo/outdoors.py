"""A ring and a ball on a hill in the sun, under a clear sky: what light does out of doors.

Built in millimetres, as CadQuery writes STEP files. The hill is a paraboloid, curved everywhere and
convex, so that no part of it hides sun or sky from another: where ring and ball are out of the way
light on it has a closed form. Nothing touches: there are 2 mm between.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from .shapes import GAP, one_solid, write_files

if TYPE_CHECKING:
    import cadquery as cq

#: Half the length of the terrain along x and y, and radius of curvature of its top. [mm]
HALF, CURVATURE = 12_000.0, 40_000.0
#: Ring: radius of its middle line and of its tube. [mm]
RING, TUBE = 1700.0, 280.0
#: Turn of its axis from north towards east: it nearly faces the sun. [deg]
RING_TURN = 40.0
#: Radius and height of the plinth it stands on, at the top of the hill. [mm]
PLINTH = (600.0, 300.0)
#: Ball: place and radius. [mm]
BALL_AT, BALL = (3600.0, -2600.0), 800.0
#: Points a side that the terrain is drawn through: it is of second degree in both directions.
POINTS = 13

SCENE = """\
# A ring and a ball on a hill, on a clear afternoon.
schema_version = 1
title = "Demo outdoors"
accuracy = 0.05

[[model]]
file = "outdoors.step"
name = "outdoors"

[[assign]]
parts = "terrain"
material = { reflectance = [0.20, 0.24, 0.12], name = "terrain, grass" }

[[assign]]
parts = "ring"
material = { reflectance = [0.62, 0.33, 0.20], name = "ring, weathering steel" }

[[assign]]
parts = "plinth"
material = { reflectance = 0.5, name = "plinth, concrete" }

[[assign]]
parts = "ball"
material = { reflectance = 0.7, name = "ball, plaster" }

[sky]
model = "cie"
type = 12
diffuse_illuminance_lx = 13000

[sun]
altitude_deg = 42
azimuth_deg = 215
normal_illuminance_lx = 85000

# The terrain is part of the model: no light comes from below the horizon besides.
[ground]
modelled = true

[[sensors]]
name = "terrain"
parts = "terrain"
spacing_m = 3.0

[[sensors]]
name = "eye level"
z_m = 1.6
bounds_m = [-6, -6, 6, 6]
spacing_m = 2.4

[[cameras]]
name = "slope"
eye_m = [-4.2, -5.6, 10.5]
target_m = [1.3, -0.2, 0.8]
fov_deg = 42
size = [800, 500]

[[cameras]]
name = "above"
eye_m = [0, 0, 30]
target_m = [0.6, 0.6, 0]
up = [0, 1, 0]
fov_deg = 26
size = [560, 560]
"""


def height(x: float, y: float) -> float:
    """Height of the terrain. [mm]"""
    return -(x * x + y * y) / (2.0 * CURVATURE)


def terrain() -> cq.Face:
    """The hill as one face, a spline surface of degree 3 at most, its normal upwards."""
    import cadquery as cq

    steps = [HALF * (2.0 * k / (POINTS - 1) - 1.0) for k in range(POINTS)]
    points = [[cq.Vector(x, y, height(x, y)) for y in steps] for x in steps]
    return cq.Face.makeSplineApprox(points, tol=1e-3, minDeg=2, maxDeg=3)


def ring() -> cq.Workplane:
    """A torus that stands upright on the plinth."""
    import cadquery as cq

    shape = cq.Solid.makeTorus(RING, TUBE, cq.Vector(0, 0, 0), cq.Vector(0, 1, 0))
    return (
        cq.Workplane(shape)
        .rotate((0, 0, 0), (0, 0, 1), -RING_TURN)
        .translate((0, 0, PLINTH[1] + RING + TUBE + 2.0 * GAP))
    )


def plinth() -> cq.Workplane:
    """A low round block."""
    import cadquery as cq

    radius, high = PLINTH
    return cq.Workplane("XY").circle(radius).extrude(high).translate((0, 0, GAP))


def ball() -> cq.Workplane:
    """A sphere on the slope."""
    import cadquery as cq

    x, y = BALL_AT
    upwards = math.sqrt(1.0 + (x * x + y * y) / CURVATURE**2)
    return cq.Workplane("XY").sphere(BALL).translate((x, y, height(x, y) + (BALL + GAP) * upwards))


def build() -> cq.Assembly:
    """The whole scene."""
    import cadquery as cq

    scene = cq.Assembly(name="outdoors")
    scene.add(terrain(), name="terrain", color=cq.Color(0.45, 0.50, 0.33))
    scene.add(one_solid(ring()), name="ring", color=cq.Color(0.79, 0.60, 0.47))
    scene.add(one_solid(plinth()), name="plinth", color=cq.Color(0.73, 0.73, 0.73))
    scene.add(one_solid(ball()), name="ball", color=cq.Color(0.85, 0.85, 0.82))
    return scene


def write(folder: Path) -> Path:
    """Write ``outdoors.step`` and ``outdoors.toml`` into ``folder``; return the scene file."""
    return write_files(folder, build(), SCENE)
