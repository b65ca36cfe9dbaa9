"""What the demo scenes share: chairs, single solids, and writing STEP and scene file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from patchlight.solver.errors import GeometryError, OutputError

if TYPE_CHECKING:
    import cadquery as cq

#: Distance of parts that would touch. [mm]
GAP = 2.0
#: What every scene file says of the parts of `chair`.
CHAIR_MATERIALS = """\
[[assign]]
parts = "**/chair*/*"
material = { reflectance = [0.10, 0.22, 0.32], name = "chair, blue" }

[[assign]]
parts = "**/chair*/leg*"
material = { reflectance = 0.35, name = "chair legs, steel" }

"""


def one_solid(shape: cq.Workplane) -> cq.Shape:
    """The one solid of a Workplane, without the compound around it."""
    import cadquery as cq

    found = shape.solids().vals()
    if len(found) != 1 or not isinstance(found[0], cq.Shape):
        raise GeometryError(f"the demo model has {len(found)} solids where it should have one")
    return found[0]


def chair() -> cq.Assembly:
    """Seat, curved back and four round legs; the back stands at +y."""
    import cadquery as cq

    blue, steel = cq.Color(0.35, 0.51, 0.60), cq.Color(0.63, 0.63, 0.63)
    seat = cq.Workplane("XY").box(420, 420, 30)
    # A slice of a pipe about a vertical axis in front of the seat.
    inner, outer, half = 340.0, 362.0, 190.0
    back = (
        cq.Workplane("XY")
        .moveTo(-half, (inner**2 - half**2) ** 0.5)
        .threePointArc((0, inner), (half, (inner**2 - half**2) ** 0.5))
        .lineTo(half, (outer**2 - half**2) ** 0.5)
        .threePointArc((0, outer), (-half, (outer**2 - half**2) ** 0.5))
        .close()
        .extrude(270)
    )
    leg = cq.Workplane("XY").circle(14).extrude(440 - 2 * GAP)
    chair = cq.Assembly(name="chair")
    chair.add(one_solid(seat), name="seat", loc=cq.Location((0, 0, 455 + GAP)), color=blue)
    chair.add(one_solid(back), name="back", loc=cq.Location((0, -160, 475 + 2 * GAP)), color=blue)
    for k, (x, y) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        place = cq.Location((180 * x, 180 * y, GAP))
        chair.add(one_solid(leg), name=f"leg:{k + 1}", loc=place, color=steel)
    return chair


def write_files(folder: Path, assembly: cq.Assembly, scene: str) -> Path:
    """Write ``<name>.step`` and ``<name>.toml`` of an assembly; return the scene file."""
    step, file = folder / f"{assembly.name}.step", folder / f"{assembly.name}.toml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        assembly.export(str(step))
        file.write_text(scene, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from None
    if not step.is_file():
        raise OutputError(f"{step}: the STEP file was not written")
    return file
