"""What a scene means: slots, air, sheets, axes, names, sky and sun."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from patchlight.pipeline import (
    Air,
    Camera,
    CIESky,
    Emitter,
    Ground,
    Material,
    PatchSet,
    Scene,
    SensorGrid,
    Sun,
)
from patchlight.solver.errors import InputError
from patchlight.solver.model import BLACK


def rows_of(data, path):
    part = next(k for k, p in enumerate(data.parts) if p.path == path)
    return np.flatnonzero(data.patches.part_index == part)


def front_material(data, row):
    index = int(data.material_index[row, 0])
    return None if index == BLACK else data.materials[index]


# --- assignments ------------------------------------------------------------------------------


def test_last_assignment_wins_in_each_slot_separately(house):
    scene = Scene(house)
    assert scene.assign("desk", Material(0.3)) == 6
    assert scene.assign("desk", Emitter(flux_lm=10)) == 6
    assert scene.assign("desk", Material(0.6)) == 6
    assert scene.assign("lamp*", Emitter(flux_lm=100)) == 12
    data = scene.freeze()
    desk = rows_of(data, "house/desk")
    assert {front_material(data, r).reflectance for r in desk} == {0.6}
    assert (data.luminaire_index[desk, 0] >= 0).all()
    assert sorted(lamp.flux_lm for lamp in data.luminaires) == [10.0, 100.0, 100.0]


def test_emitting_face_without_material_is_black_and_not_on_the_default(house):
    scene = Scene(house)
    scene.assign("lamp*", Emitter(flux_lm=100))
    data = scene.freeze()
    lamp = rows_of(data, "house/lights/lamp:1")
    assert (data.material_index[lamp] == BLACK).all()
    assert not data.default_faces[data.patches.face_index[lamp]].any()


def test_unassigned_faces_are_grey_half_counted_and_named(house):
    data = Scene(house).freeze()
    assert data.default_faces.all()
    assert {m.reflectance for m in data.materials} == {0.5}
    assert any("24 of 24 faces" in note and "house/desk" in note for note in data.notes)


def test_colors_for_pictures_do_not_reflect_unless_asked(house):
    plain = Scene(house).freeze()
    assert front_material(plain, rows_of(plain, "house/desk")[0]).reflectance == 0.5
    data = Scene(house, colors="reflectance").freeze()
    desk = rows_of(data, "house/desk")[0]
    # Linear luminance of (0.5, 0.25, 0.1), IEC 61966-2-1.
    expected = 0.2126 * 0.5 + 0.7152 * 0.25 + 0.0722 * 0.1
    assert front_material(data, desk).reflectance == pytest.approx(expected)
    assert not data.default_faces[data.patches.face_index[desk]]
    assert data.default_faces[data.patches.face_index[rows_of(data, "house/room")]].all()


@pytest.mark.parametrize(
    ("pattern", "count"),
    [
        ("lamp:1", 6),
        ("lamp*", 12),
        ("*", 24),
        ("**", 24),
        ("house/*", 12),
        ("house/**", 24),
        ("house/lights/*", 12),
        ("**/lamp:?", 12),
        ("lights/lamp*", 12),  # below the file's root: the model's name was not chosen
    ],
)
def test_patterns(house, pattern, count):
    assert Scene(house).assign(pattern, Material(0.2)) == count


def test_patterns_need_a_chosen_name(house):
    scene = Scene()
    scene.add(house, "north")
    assert scene.assign("north/lights/*", Material(0.2)) == 12
    with pytest.raises(InputError):
        scene.assign("lights/lamp*", Material(0.2))


def test_parts_are_meant_as_inspect_prints_them(make_model):
    """Also with what patterns read otherwise, and without the name that the scene gives."""
    box = ((1.0, 1.0, 1.0), (0, 0, 0), False)
    model = make_model("file", {"set[1]/leg*": box, "set1/leg": box, "set[1]/legs": box})
    for scene in (Scene(model), Scene()):
        if not scene.entries:
            scene.add(model, "room")
        for part in model.parts:
            assert scene.assign(part.path, Material(0.3)) == 6
        assert scene.assign("leg*", Material(0.4)) == 6
        assert scene.assign("l*", Material(0.4)) == 18
        assert scene.assign("**/set?/*", Material(0.4)) == 6


def test_pattern_without_match_names_the_three_nearest_paths(house):
    with pytest.raises(InputError, match=r"assign 'lampe'") as error:
        Scene(house).assign("lampe", Material(0.2))
    listed = str(error.value).split("nearest: ")[1].split(", ")
    assert len(listed) == 3
    assert set(listed[:2]) == {"house/lights/lamp:1", "house/lights/lamp:2"}


def test_color_selects_faces(house):
    scene = Scene(house)
    # sRGB code of linear (0.5, 0.25, 0.1).
    assert scene.assign("**", Material(0.2), color="#bc8959") == 6
    with pytest.raises(InputError, match="no face"):
        scene.assign("**", Material(0.2), color="#00ff00")
    with pytest.raises(InputError, match="#rrggbb"):
        scene.assign("**", Material(0.2), color="green")


def test_faces_up_is_judged_in_the_scene(make_model):
    lying = make_model("m", {"slab": ((2.0, 1.0, 0.1), (0.0, 0.0, 0.0), False)})
    scene = Scene(lying, up="y")
    assert scene.assign("slab", Material(0.9), faces="up") == 1
    data = scene.freeze()
    row = next(r for r in range(len(data.patches)) if front_material(data, r).reflectance == 0.9)
    assert data.patches.normals(0.5, 0.5)[row] == pytest.approx([0.0, 0.0, 1.0])
    # The face that looked along +y in the file is 2 x 0.1 m.
    assert data.patches.areas()[row] == pytest.approx(0.2)


# --- emitters ---------------------------------------------------------------------------------


def test_flux_is_per_part_and_luminance_per_area(house):
    scene = Scene(house, maintenance_factor=0.8)
    scene.assign("lamp:1", Emitter(flux_lm=1000, dim=0.5))
    scene.assign("lamp:2", Emitter(luminance_cd_m2=2000))
    one, two = scene.freeze().luminaires
    area = 2 * (0.4 * 0.2 + 0.4 * 0.1 + 0.2 * 0.1)
    assert one.area_m2 == pytest.approx(area)
    assert one.flux_lm == pytest.approx(1000 * 0.5 * 0.8)
    assert two.flux_lm == pytest.approx(math.pi * 2000 * area * 0.8)
    assert (one.group, two.group) == ("lamp:1", "lamp:2")


def test_faces_narrow_the_flux(house):
    scene = Scene(house)
    scene.assign("lamp*", Emitter(flux_lm=1000, group="lamps"), faces="down")
    data = scene.freeze()
    assert [lamp.area_m2 for lamp in data.luminaires] == pytest.approx([0.08, 0.08])
    assert data.groups == ("lamps",)


def test_a_later_emitter_takes_faces_from_an_earlier_one(house):
    scene = Scene(house)
    scene.assign("lamp:1", Emitter(flux_lm=1000))
    scene.assign("lamp:1", Emitter(flux_lm=50), faces="down")
    first, second = scene.freeze().luminaires
    assert first.flux_lm == 1000 and first.area_m2 == pytest.approx(0.28 - 0.08)
    assert second.flux_lm == 50 and second.area_m2 == pytest.approx(0.08)


def test_sheet_emits_on_the_side_asked_for():
    for side, columns in (("both", [0, 0]), ("front", [0, -1]), ("back", [-1, 0])):
        scene = Scene()
        scene.add(PatchSet.disk((0, 0, 0), 1.0, (0, 0, 1)), "leaf", two_sided=True)
        scene.assign("leaf", Emitter(flux_lm=10, side=side))
        data = scene.freeze()
        assert (data.luminaire_index == columns).all()
        sides = 2 if side == "both" else 1
        assert data.luminaires[0].area_m2 == pytest.approx(sides * math.pi)


def test_one_sided_patches_have_no_back():
    scene = Scene()
    scene.add(PatchSet.disk((0, 0, 0), 1.0, (0, 0, 1)), "leaf")
    with pytest.raises(InputError, match="back"):
        scene.assign("leaf", Emitter(flux_lm=10, side="back"))
    scene.assign("leaf", Emitter(flux_lm=10))
    data = scene.freeze()
    assert not data.two_sided.any() and not data.closed.any()
    assert (data.luminaire_index == [0, -1]).all()
    assert data.parts[0].kind == "patches"


def test_reserved_light_groups_are_refused(house):
    scene = Scene(house)
    scene.assign("lamp:1", Emitter(flux_lm=1, group="sky"))
    with pytest.raises(InputError, match="'sky'"):
        scene.freeze()


# --- air, sheets ------------------------------------------------------------------------------


def test_air_turns_a_solid_inside_out(make_model):
    model = make_model("m", {"volume": ((4.0, 3.0, 2.8), (0.0, 0.0, 1.4), False)})
    scene = Scene(model)
    assert scene.assign("volume", Air()) == 6
    assert scene.assign("volume", Material(0.2), faces="up") == 1
    data = scene.freeze()
    assert data.parts[0].kind == "air"
    assert data.closed.all()
    centre = np.array([0.0, 0.0, 1.4])
    inward = data.patches.normals(0.5, 0.5) @ np.eye(3) * (centre - data.patches.evaluate(0.5, 0.5))
    assert (inward.sum(axis=1) > 0.0).all()
    floor = np.flatnonzero(data.patches.normals(0.5, 0.5)[:, 2] > 0.99)
    assert front_material(data, int(floor[0])).reflectance == 0.2


def test_air_needs_a_closed_solid(make_model):
    sheet = make_model("m", kind="sheet")
    with pytest.raises(InputError, match="no closed solid"):
        Scene(sheet).assign("room", Air())
    with pytest.raises(InputError, match="faces"):
        Scene(make_model("m")).assign("room", Air(), faces="up")


def test_sheets_have_two_sides_and_may_have_two_materials(make_model):
    scene = Scene(make_model("m", kind="sheet"))
    scene.assign("room", Material(0.8, back=Material(0.1)))
    data = scene.freeze()
    assert data.two_sided.all() and not data.closed.any()
    front, back = (data.materials[i].reflectance for i in data.material_index[0])
    assert (front, back) == (0.8, 0.1)


# --- axes -------------------------------------------------------------------------------------


def test_north_turns_models_sensors_and_cameras_together():
    scene = Scene(north_deg=90)  # north lies along +x of the scene
    scene.add(PatchSet.disk((2, 0, 0), 0.1, (1, 0, 0)), "spot")
    scene.add(SensorGrid([[2, 0, 0]], (1, 0, 0), name="p"))
    scene.add(Camera((1, 0, 0), (2, 0, 0), name="c"))
    data = scene.freeze()
    assert data.patches.normals(0.5, 0.5)[0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert data.sensors[0].points[0] == pytest.approx([0, 2, 0], abs=1e-15)
    assert data.sensors[0].normals[0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert data.cameras[0].target == pytest.approx((0, 2, 0), abs=1e-15)


@pytest.mark.parametrize(("up", "top"), [("z", (0, 0, 5)), ("y", (0, 5, 0)), ("x", (5, 0, 0))])
def test_up_brings_the_axis_of_the_file_to_z(make_model, up, top):
    model = make_model("m", {"cube": ((0.1, 0.1, 0.1), top, False)})
    low, high = Scene(model, up=up).freeze().patches.bounds()
    assert 0.5 * (low + high) == pytest.approx([0, 0, 5])


def test_at_places_models_after_up(make_model):
    model = make_model("m", {"cube": ((0.1, 0.1, 0.1), (0, 5, 0), False)})
    scene = Scene(up="y")
    scene.add(model, "a")
    scene.add(model, "b", at=(1, 0, 0))
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = 3.0
    scene.add(model, "c", at=mirror)
    data = scene.freeze()
    for path, x in (("a/cube", 0), ("b/cube", 1), ("c/cube", 3)):
        patches = data.patches.take(rows_of(data, path))
        low, high = patches.bounds()
        centre = 0.5 * (low + high)
        assert centre == pytest.approx([x, 0, 5])
        outward = np.einsum(
            "pk,pk->p", patches.normals(0.5, 0.5), patches.evaluate(0.5, 0.5) - centre
        )
        assert (outward > 0.0).all()
    assert [s.name for s in data.sources] == ["a", "b", "c"]


# --- sky, sun, names --------------------------------------------------------------------------


def test_ground_comes_with_sky_or_sun_only(house):
    scene = Scene(house)
    assert scene.freeze().ground is None
    scene.sky = CIESky(16)
    assert scene.freeze().ground == Ground(0.2)
    scene.ground = Ground(None)
    assert scene.freeze().ground == Ground(None)


def test_sky_and_sun_must_agree(house):
    scene = Scene(house)
    scene.sky = CIESky(12, sun_altitude_deg=40, sun_azimuth_deg=180)
    scene.sun = Sun(40.4, 180, normal_illuminance_lx=8e4)
    scene.freeze()
    scene.sun = Sun(40.6, 180, normal_illuminance_lx=8e4)
    with pytest.raises(InputError, match=r"0\.60 degrees apart"):
        scene.freeze()


def test_names_are_unique(house):
    scene = Scene(house)
    with pytest.raises(InputError, match="'house' exists"):
        scene.add(house)
    scene.add(SensorGrid([[0, 0, 0]], (0, 0, 1), name="p"))
    with pytest.raises(InputError, match="'p' exists"):
        scene.add(SensorGrid.on_plane("p", z=1))


def test_update_keeps_assignments_and_checks_them(house, make_model):
    scene = Scene(house)
    scene.assign("desk", Material(0.3))
    wider = make_model(
        "house",
        {
            "room": ((6.0, 3.0, 2.8), (3.0, 1.5, 1.4), True),
            "desk": ((1.6, 0.7, 0.7), (2.0, 1.5, 0.35), False),
        },
    )
    scene.update(wider)
    data = scene.freeze()
    assert front_material(data, rows_of(data, "house/desk")[0]).reflectance == 0.3
    with pytest.raises(InputError, match="desk"):
        scene.update(make_model("house"))
    assert len(scene.freeze().parts) == 2  # the failed update changed nothing
    with pytest.raises(InputError, match="a dict is no Model"):
        scene.update({})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"up": "w"}, "up"),
        ({"north_deg": math.nan}, "north_deg"),
        ({"maintenance_factor": 0.0}, "maintenance_factor"),
        ({"colors": "both"}, "colors"),
    ],
)
def test_options_out_of_range(options, message):
    with pytest.raises(InputError, match=message):
        Scene(**options)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("plane", "E_mean", {"min": 1.0}), "one of E_avg_lx"),
        (("plane", "E_avg_lx", {}), "give min, max or both"),
        (("plane", "E_avg_lx", {"min": 3.0, "max": 2.0}), "min = 3 lies above max = 2"),
        (("plane", "E_avg_lx", {"min": math.nan}), "finite"),
    ],
)
def test_requirements_out_of_range(house, arguments, message):
    sensors, metric, bounds = arguments
    with pytest.raises(InputError, match=message):
        Scene(house).require(sensors, metric, **bounds)


def test_requirements_are_checked_before_anything_is_solved(house):
    scene = Scene(house)
    scene.require("plane", "E_avg_lx", min=2.0, max=2.0)  # the grid may come later
    scene.require("plane", "DF_avg_percent", min=2.0)
    with pytest.raises(InputError, match="'plane': no such grid; grids: none"):
        scene.freeze()
    scene.add(SensorGrid([[1, 1, 1]], (0, 0, 1), name="plane"))
    with pytest.raises(InputError, match="overcast"):
        scene.freeze()
    scene.sky = CIESky(16)
    scene.freeze()


def test_everything_that_hinders_a_solution_is_said_at_once(house):
    scene = Scene(house)
    scene.assign("lamp:1", Emitter(flux_lm=1, group="sky"))
    scene.assign("lamp:2", Emitter(flux_lm=1, group="sun"))
    scene.add(SensorGrid.on_plane("high", z=0.8, over="nowhere"))
    scene.add(SensorGrid.on_plane("narrow", z=0.8, over="room", margin=9.0))
    scene.add(SensorGrid.on_plane("good", z=0.8, over="room"))
    scene.require("hihg", "E_avg_lx", min=2.0)
    with pytest.raises(InputError) as error:
        scene.freeze()
    lines = str(error.value).splitlines()
    assert lines[0] == "5 problems"
    words = ("did you mean 'high'", "'sky' of house/lights/lamp:1", "'sun' of", "'high'", "margin")
    for word, line in zip(words, lines[1:], strict=True):
        assert word in line


def test_remarks_on_glass_light_and_sensors_below(make_model):
    model = make_model("m", {"window glass": ((1.0, 1.0, 0.1), (0, 0, 0), False)})
    scene = Scene(model)
    scene.add(SensorGrid([[0, 0, -3]], (0, 0, 1), name="cellar"))
    notes = " | ".join(scene.freeze().notes)
    assert "named like glass, but opaque" in notes and "m/window glass" in notes
    assert "no light" in notes
    assert "cellar: 1 of 1 are below" in notes


def test_doubts_about_a_model_are_warnings_and_name_it_once(make_model):
    model = make_model("chair", {"seat": ((0.01, 0.01, 0.01), (0, 0, 0), False)})
    said = ("model chair is 0.01 m long, but a chair has 0.2 to 20 m", "3 of 6 faces have gone")
    data = Scene(dataclasses.replace(model, warnings=said)).freeze()
    assert data.warnings == (said[0], f"chair: {said[1]}")
    assert not any(text in note for text in said for note in data.notes)


def test_words_that_are_names_of_models_by_chance_do_not_name_them(make_model):
    said = ("part leg is 90 m long: check", "2 solids are no closed solid", "solid/leg #1 failed")
    scene = Scene()
    for name in ("solid", "part"):
        model = make_model(name, {"leg": ((1.0, 1.0, 1.0), (0, 0, 0), False)})
        scene.add(dataclasses.replace(model, warnings=said), name=name)
    wanted = [f"solid: {said[0]}", f"solid: {said[1]}", said[2], *(f"part: {t}" for t in said)]
    assert list(scene.freeze().warnings) == wanted
