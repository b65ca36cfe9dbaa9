"""Sensor grids: the counting rule, floors, holes, margins and what is dropped."""

from __future__ import annotations

import math

import numpy as np
import pytest
from patchlight.pipeline import Air, PatchSet, Scene, SensorGrid
from patchlight.solver.errors import InputError
from patchlight.solver.placement import check_placement


def grid_of(scene, **options):
    scene.add(SensorGrid.on_plane("g", **options))
    return scene.freeze().sensors[0]


def test_four_by_three_metres_at_half_a_metre_are_48_points(house):
    g = grid_of(Scene(house), z=0.8)
    assert len(g) == 48
    assert g.area_m2 == pytest.approx(np.full(48, 0.25))
    assert g.points[0] == pytest.approx([0.25, 0.25, 0.8])
    assert g.points[-1] == pytest.approx([3.75, 2.75, 0.8])
    assert (g.normals == [0, 0, 1]).all()
    assert len(g.outline) == 1


def test_margin_shrinks_the_area(house):
    g = grid_of(Scene(house), z=0.8, margin=0.5)
    assert len(g) == 6 * 4
    assert g.area_m2.sum() == pytest.approx(6.0)
    with pytest.raises(InputError, match="margin"):
        grid_of(Scene(house), z=0.8, margin=1.6)


def test_extents_that_do_not_divide_get_smaller_equal_cells(house):
    g = grid_of(Scene(house), z=0.8, spacing=0.7)
    assert len(g) == math.ceil(4 / 0.7) * math.ceil(3 / 0.7)
    assert g.area_m2.sum() == pytest.approx(12.0)


def test_spacing_of_en_12464():
    scene = Scene()
    g = grid_of(scene_of_floor(scene, 10.0, 6.0), z=0.8, spacing="en12464")
    # d = 10 m: p = 0.2 · 5^1 = 1 m; 10 x 6 cells.
    assert len(g) == 60


def scene_of_floor(scene, dx, dy):
    scene.add(PatchSet.box((dx, dy, 3.0), (dx / 2, dy / 2, 1.5), inward=True), "room")
    return scene


def test_furniture_below_the_plane_leaves_the_floor_whole(house):
    assert len(grid_of(Scene(house), z=0.75)) == 48


def test_a_plane_through_furniture_drops_the_points_inside(house):
    g = grid_of(Scene(house), z=0.5)
    assert 0 < len(g) < 48
    x, y = g.points[:, 0], g.points[:, 1]
    assert not ((abs(x - 2.0) < 0.7) & (abs(y - 1.5) < 0.35)).any()


def walls(lower=0.0):
    """Slab, four walls and a partition as separate solids, 5 x 3 m inside, walls 0.2 m."""
    z, h = 1.4 + lower, 2.8
    return {
        "slab": ((5.4, 3.4, 0.2), (2.5, 1.5, lower - 0.1), False),
        "wall:1": ((5.4, 0.2, h), (2.5, -0.1, z), False),
        "wall:2": ((5.4, 0.2, h), (2.5, 3.1, z), False),
        "wall:3": ((0.2, 3.0, h), (-0.1, 1.5, z), False),
        "wall:4": ((0.2, 3.0, h), (5.1, 1.5, z), False),
        "partition": ((0.2, 3.0, h), (2.9, 1.5, z), False),
    }


def test_walls_and_slabs_leave_the_larger_room(make_model):
    g = grid_of(Scene(make_model("m", walls())), z=0.8)
    # Left room 2.8 x 3 m, right room 2 x 3 m.
    assert g.area_m2.sum() == pytest.approx(2.8 * 3.0, rel=1e-6)
    assert len(g) == 6 * 6
    assert g.points[:, 0].max() < 2.8


def test_the_storey_of_the_plane_is_found(make_model):
    ground = walls()
    ground.pop("partition")
    upper = {f"upper {path}": box for path, box in walls(3.0).items()}
    upper.pop("upper partition")
    # The slab below is larger, but most of it is hidden by the one above it.
    ground["slab"] = ((6.4, 4.4, 0.2), (2.5, 1.5, -0.1), False)
    g = grid_of(Scene(make_model("m", {**ground, **upper})), z=3.8)
    assert g.area_m2.sum() == pytest.approx(15.0, rel=1e-6)


def test_column_cuts_a_hole(make_model):
    boxes = {"slab": ((4.0, 4.0, 0.2), (2.0, 2.0, -0.1), False)}
    scene = Scene(make_model("m", boxes))
    column = make_model("c", {"column": ((1.0, 1.0, 3.0), (2.0, 2.0, 1.5), False)})
    scene.add(column)
    g = grid_of(scene, z=0.8)
    assert g.area_m2.sum() == pytest.approx(15.0, rel=1e-6)
    assert len(g.outline) == 2
    assert len(g) == 64 - 4


@pytest.mark.parametrize("low", [0.0, 0.5], ids=["column", "hanging"])
def test_what_stands_in_the_middle_of_a_room_does_not_fill_it(low):
    """A room as one solid with a cavity: a point in the middle of it lies in the column."""
    import cadquery as cq
    from patchlight.pipeline import from_cadquery

    room = cq.Workplane().box(4.4, 3.4, 3.2).cut(cq.Workplane().box(4, 3, 2.8))
    column = cq.Workplane().box(1.0, 1.0, 2.8 - low).translate((0, 0, 0.5 * low))
    model = cq.Assembly(name="m").add(room, name="room").add(column, name="column")
    g = grid_of(Scene(from_cadquery(model, unit="m")), z=-0.6)
    assert g.area_m2.sum() == pytest.approx(11.0, rel=1e-6)


@pytest.mark.parametrize("over", [None, "terrain"])
def test_many_points_on_a_floor_that_nobody_named_are_told(make_model, over):
    boxes = {
        "terrain": ((80.0, 80.0, 0.2), (0.0, 0.0, -0.1), False),
        "floor": ((4.0, 3.0, 0.1), (0.0, 0.0, 0.05), False),
    }
    scene = Scene(make_model("m", boxes))
    scene.add(SensorGrid.on_plane("desk", z=0.8, spacing=1.0, over=over))
    notes = [note for note in scene.freeze().notes if "points on the largest floor" in note]
    assert len(notes) == (1 if over is None else 0)
    assert all("6400 points" in note and "80 x 80 m" in note for note in notes)


def test_air_volume_has_its_floor(make_model):
    model = make_model("m", {"volume": ((4.0, 3.0, 2.8), (2.0, 1.5, 1.4), False)})
    scene = Scene(model)
    scene.assign("volume", Air())
    assert len(grid_of(scene, z=0.8)) == 48


def test_north_keeps_the_grid_along_the_walls(make_model):
    model = make_model("m")
    g = grid_of(Scene(model, north_deg=30), z=0.8)
    assert len(g) == 48
    assert g.area_m2.sum() == pytest.approx(12.0, rel=1e-6)


def test_over_and_bounds(house):
    g = grid_of(Scene(house), z=0.8, over="desk")
    assert g.area_m2.sum() == pytest.approx(1.4 * 0.7)
    g = grid_of(Scene(house), z=0.8, bounds=(1.0, 1.0, 2.0, 2.0), normal=(0, 0, -1))
    assert len(g) == 4 and (g.normals == [0, 0, -1]).all()


def test_round_floor_keeps_clipped_cells():
    scene = Scene()
    scene.add(PatchSet.disk((0, 0, 0), 2.0, (0, 0, 1)), "floor")
    g = grid_of(scene, z=0.8, spacing=0.1)
    assert (np.hypot(*g.points[:, :2].T) < 2.0).all()
    # Lost are only pieces of cells whose centre is outside.
    assert 0.98 * math.pi * 4 < g.area_m2.sum() < math.pi * 4
    assert g.area_m2.min() < 0.9 * g.area_m2.max()


def test_no_floor_asks_for_over_or_bounds():
    scene = Scene()
    scene.add(PatchSet.sphere((0, 0, 0), 1.0), "ball")
    with pytest.raises(InputError, match="over, or give bounds"):
        grid_of(scene, z=2.0)


def test_points_all_inside_a_solid_hint_at_air(make_model):
    model = make_model("m", {"volume": ((4.0, 3.0, 2.8), (2.0, 1.5, 1.4), False)})
    with pytest.raises(InputError, match="Air"):
        grid_of(Scene(model), z=0.8, bounds=(0, 0, 4, 3))


@pytest.mark.parametrize(
    "options",
    [
        {"z": math.nan},
        {"z": 1, "spacing": 0.0},
        {"z": 1, "spacing": "fine"},
        {"z": 1, "margin": -1},
        {"z": 1, "bounds": (0, 0, 0, 1)},
        {"z": 1, "bounds": (0, 0, 1, 1), "over": "floor"},
        {"z": 1, "normal": (0, 0, 0)},
        {"z": 1, "quantity": "cylindrical"},
    ],
)
def test_bad_planes(options):
    with pytest.raises(InputError, match="'g'"):
        SensorGrid.on_plane("g", **options)


def test_sensors_on_faces_look_along_the_active_normal(house):
    scene = Scene(house)
    scene.add(SensorGrid.on_faces("w", "room", spacing=0.5, faces="vertical"))
    g = scene.freeze().sensors[0]
    # Two walls 4 x 2.8 m, two 3 x 2.8 m: 6 rows of cells.
    assert len(g) == 6 * 2 * (8 + 6)
    assert g.area_m2.sum() == pytest.approx(2 * 2.8 * 7.0)
    inward = np.einsum("ij,ij->i", g.normals, np.array([2.0, 1.5, 1.4]) - g.points)
    assert (inward > 0.0).all() and abs(g.normals[:, 2]).max() < 1e-12


def test_sensors_on_curved_faces_carry_their_area():
    scene = Scene()
    scene.add(PatchSet.sphere((0, 0, 0), 1.0), "ball")
    scene.add(SensorGrid.on_faces("s", "ball", spacing=0.2))
    g = scene.freeze().sensors[0]
    assert g.area_m2.sum() == pytest.approx(4 * math.pi, rel=1e-8)
    assert np.einsum("ij,ij->i", g.points, g.normals) == pytest.approx(np.ones(len(g)), abs=1e-5)


def test_sensors_under_furniture_are_dropped(house):
    scene = Scene(house)
    scene.add(SensorGrid.on_faces("f", "room", spacing=0.25, faces="up"))
    data = scene.freeze()
    # The desk, 1.4 x 0.7 m about (2, 1.5), covers cell centres at x, y = 0.125 + k/4.
    assert len(data.sensors[0]) == 16 * 12 - 6 * 2
    assert any("dropped" in note for note in data.notes)


def test_given_points_inside_solids_have_no_weight(house):
    """They stay where their maker put them in the list; a grid of no others is refused."""
    scene = Scene(house)
    scene.add(SensorGrid([(1, 1, 0.8), (2, 1.5, 0.5), (3, 1, 0.8)], (0, 0, 1), name="g"))
    (some,) = scene.freeze().sensors
    assert some.area_m2.tolist() == [1.0, 0.0, 1.0] and len(some) == 3
    (line,) = check_placement(scene.freeze())
    assert line.startswith("sensors 'g': 1 of 3 points lie inside solids")
    assert line.endswith("they count in no metric")
    scene.add(SensorGrid([(2, 1.5, 0.5)], (0, 0, 1), name="inside"))
    with pytest.raises(InputError, match="sensors 'inside': all 1 points lie inside solids"):
        scene.freeze()
