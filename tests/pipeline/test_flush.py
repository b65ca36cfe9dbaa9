"""Flat faces that lie on each other but for rounding are in one plane."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from patchlight.pipeline import Emitter, Material, Scene, SensorGrid, from_cadquery, simulate

BOX = cq.Workplane().box(0.8, 0.8, 0.1).val()
AXIS = cq.Vector(1, 2, 3)


def sheet(gap, size=0.6):
    """A sheet below the box, ``gap`` away from it."""
    face = cq.Workplane().rect(size, size).extrude(1).faces("<Z").val()
    return face.translate(cq.Vector(0, 0, -0.05 - gap))


def scene_of(turn=0.0, **shapes):
    parts = cq.Assembly(name="all")
    for name, shape in shapes.items():
        parts.add(shape.rotate(cq.Vector(), AXIS, turn) if turn else shape, name=name)
    return Scene(from_cadquery(parts, unit="m", cache=False))


def corners(data, name):
    row = [p.path for p in data.parts].index(f"all/{name}")
    points = data.patches.control_points[data.patches.part_index == row]
    return points[..., :3] / points[..., 3:]


def apart(data, name, other, face):
    """Largest distance of the points of a part from the plane of a patch of another one."""
    p = corners(data, other)[face]
    n = np.cross(p[3, 3] - p[0, 0], p[0, 3] - p[3, 0])
    return np.abs((corners(data, name) - p[0, 0]) @ n).max() / np.linalg.norm(n)


def bottom(data):
    return int(np.argmin(corners(data, "box")[..., 2].mean(axis=(1, 2))))


@pytest.mark.parametrize("gap", [1e-12, 1e-9, -1e-9, 5e-8])
def test_a_sheet_on_a_solid_is_in_its_plane(gap):
    data = scene_of(box=BOX, lit=sheet(gap)).freeze()
    assert apart(data, "lit", "box", bottom(data)) == 0.0
    # It moves along the normal alone.
    np.testing.assert_allclose(np.abs(corners(data, "lit")[..., :2]).max(), 0.3, rtol=1e-14)


@pytest.mark.parametrize("gap", [0.0, 3e-15, 1e-9])
@pytest.mark.parametrize("other", ["solid", "sheet"])
def test_the_light_is_that_of_faces_in_one_plane(gap, other):
    found = []
    for turn, distance in ((0.0, 0.0), (40.0, gap)):
        scene = scene_of(turn, box=BOX if other == "solid" else sheet(0, 0.8), lit=sheet(distance))
        scene.assign("lit", Emitter(1000.0))
        scene.assign("box", Material(0.7))
        ends = [cq.Vector(0, 0, -2), cq.Vector(0.3, 0.2, -1), cq.Vector(0, 0, 1)]
        moved = [
            cq.Vertex.makeVertex(*v.toTuple()).rotate(cq.Vector(), AXIS, turn).toTuple()
            if turn
            else v.toTuple()
            for v in ends
        ]
        scene.add(SensorGrid(np.array(moved[:2]), np.array([moved[2]] * 2), name="g"))
        result = simulate(scene, accuracy=0.05)
        assert not any("ledger" in w for w in result.warnings)
        found.append(result.sensors["g"].illuminance_lx)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_what_is_a_little_farther_off_is_named():
    data = scene_of(box=BOX, lit=sheet(3e-6)).freeze()
    note = next(n for n in data.notes if "too near" in n)
    assert note.startswith("all/lit lies 3e-06 m off a face of all/box")
    assert apart(data, "lit", "box", bottom(data)) == pytest.approx(3e-6, rel=1e-6)
    far = scene_of(box=BOX, lit=sheet(1e-4)).freeze()
    assert not any("too near" in n for n in far.notes)


def test_a_flush_panel_follows_what_it_is_in():
    panel = cq.Workplane().box(0.6, 0.6, 0.05).translate((0, 0, -0.025 - 1e-9)).val()
    data = scene_of(box=BOX, panel=panel).freeze()
    lowest = corners(data, "panel")[..., 2].max(axis=(1, 2)).min()
    assert lowest == corners(data, "box")[bottom(data), ..., 2].max()


@pytest.mark.parametrize("turn", [0.0, 40.0])
def test_a_strip_narrower_than_the_slack_is_flush(turn):
    # An LED strip of 5 mm below the ceiling of a hall of 60 m, which touch within 6 mm.
    hall = cq.Workplane().box(60, 20, 8).val()
    strip = cq.Workplane().rect(30, 0.005).extrude(1).faces("<Z").val()
    strip = strip.rotate(cq.Vector(), cq.Vector(0, 0, 1), turn)
    data = scene_of(box=hall, lit=strip.translate(cq.Vector(0, 0, 4 + 1e-9))).freeze()
    top = int(np.argmax(corners(data, "box")[..., 2].mean(axis=(1, 2))))
    assert apart(data, "lit", "box", top) == 0.0
    # Beside the ceiling, at its very edge, there is nothing that it lies on.
    beside = cq.Workplane().rect(30, 0.005).extrude(1).faces("<Z").val()
    beside = beside.translate(cq.Vector(0, 10.0025, 4 + 1e-9))
    data = scene_of(box=hall, lit=beside).freeze()
    assert apart(data, "lit", "box", top) == pytest.approx(1e-9, rel=1e-3)


def test_solids_that_touch_and_faces_beside_each_other_stay():
    above = BOX.translate(cq.Vector(0, 0, 0.1 + 1e-9))
    beside = BOX.translate(cq.Vector(0.8, 0, 1e-9))
    data = scene_of(box=BOX, above=above, beside=beside).freeze()
    assert corners(data, "above")[..., 2].min() == pytest.approx(0.05 + 1e-9, abs=1e-13)
    assert corners(data, "beside")[..., 2].max() == pytest.approx(0.05 + 1e-9, abs=1e-13)
    assert not any("too near" in n for n in data.notes)


def tiles(turn, lift):
    """Two tiles whose boxes overlap and that only touch, the second one ``lift`` higher."""
    tile = cq.Workplane().rect(1, 1).extrude(1).faces("<Z").val()
    first = tile.rotate(cq.Vector(), cq.Vector(0, 0, 1), turn)
    t = np.radians(turn)
    step = cq.Vector(np.cos(t), np.sin(t), lift)
    return {"one": first, "two": first.translate(step)}


@pytest.mark.parametrize("turn", [0.0, 45.0, 20.0])
def test_tiles_side_by_side_draw_no_note(turn):
    assert not any("lies" in note for note in scene_of(**tiles(turn, 3e-6)).freeze().notes)
    # Moved over each other by a tenth they do.
    over = tiles(turn, 3e-6)
    t = np.radians(turn)
    over["two"] = over["two"].translate(cq.Vector(-0.1 * np.cos(t), -0.1 * np.sin(t), 0))
    assert any("too near for light between them" in n for n in scene_of(**over).freeze().notes)
