"""Of faces that lie on each other and look the same way, one carries the light."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from patchlight.pipeline import (
    CIESky,
    Emitter,
    Ground,
    Material,
    Scene,
    SensorGrid,
    from_cadquery,
    simulate,
)
from patchlight.solver.model import BLACK

SQUARE = cq.Workplane().rect(4, 4).extrude(1.0).faces(">Z").val()
DISC = cq.Workplane().circle(1).extrude(1.0).faces(">Z").val()


def upside_down(face):
    return cq.Face(face.copy().wrapped.Reversed())


def scene_of(**shapes):
    parts = cq.Assembly(name="all")
    for name, shape in shapes.items():
        parts.add(shape, name=name)
    return Scene(from_cadquery(parts, unit="m"))


def sides_of(data, path):
    """Material and lamp of the two sides of a part's patches."""
    row = [p.path for p in data.parts].index(path)
    own = data.patches.part_index == row
    return data.material_index[own], data.luminaire_index[own]


def is_dark(data, path):
    material, lamp = sides_of(data, path)
    return bool((material == BLACK).all() and (lamp < 0).all())


@pytest.mark.parametrize("face", [SQUARE, DISC], ids=["flat", "disc"])
@pytest.mark.parametrize("turn", [lambda f: f.copy(), upside_down], ids=["same", "turned"])
def test_a_sheet_that_is_there_twice_counts_once(face, turn):
    scene = scene_of(a=face, b=turn(face))
    a, b = paths(scene)
    data = scene.freeze()
    assert is_dark(data, a)
    assert not is_dark(data, b)
    assert any("lies on" in note and "looks the same way" in note for note in data.notes)


def paths(scene):
    return [p.path for p in scene.freeze().parts]


def test_light_from_below_a_doubled_ceiling_is_that_of_one():
    found = []
    for shapes in ({"a": SQUARE}, {"a": SQUARE, "b": SQUARE.copy()}):
        scene = scene_of(**shapes)
        scene.assign("**", Material(0.8))
        scene.sky = CIESky("uniform", diffuse_illuminance_lx=10_000)
        scene.ground = Ground(None)
        points = np.array([[0.0, 0.0, 1.5], [0.3, 0.2, 0.5]])
        normals = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
        scene.add(SensorGrid(points, normals, name="g"))
        found.append(simulate(scene, accuracy=0.05).sensors["g"].illuminance_lx)
    # The same patches carry the light: nothing else has changed but what hides whom.
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_the_emitter_wins_whatever_was_assigned_later():
    scene = scene_of(lit=SQUARE, housing=SQUARE.copy())
    lit, housing = paths(scene)
    scene.assign(lit, Emitter(1000.0))
    scene.assign(housing, Material(0.7))
    data = scene.freeze()
    assert is_dark(data, housing)
    assert (sides_of(data, lit)[1] == 0).all()


def test_the_later_assignment_wins_among_materials():
    scene = scene_of(a=SQUARE, b=SQUARE.copy())
    a, b = paths(scene)
    scene.assign(b, Material(0.2))
    scene.assign(a, Material(0.7))
    data = scene.freeze()
    assert is_dark(data, b)
    assert not is_dark(data, a)


def test_what_was_given_a_material_wins_over_the_default():
    scene = scene_of(a=SQUARE, b=SQUARE.copy())
    a, b = paths(scene)
    scene.assign(a, Material(0.7))
    assert is_dark(scene.freeze(), b)


def test_a_sheet_on_a_solid_takes_the_light_of_the_side_it_covers():
    box = cq.Workplane().box(4, 4, 1, centered=(True, True, False))
    scene = scene_of(box=box, poster=SQUARE)
    solid, poster = paths(scene)
    scene.assign(solid, Material(0.5))
    scene.assign(poster, Material(0.9))
    data = scene.freeze()
    material, _ = sides_of(data, solid)
    assert (material[:, 0] == BLACK).sum() == 1  # its top
    assert not is_dark(data, poster)


def test_touching_solids_keep_all_their_faces():
    below = cq.Workplane().box(1, 1, 1)
    scene = scene_of(below=below, above=below.translate((0, 0, 1)))
    data = scene.freeze()
    assert not any("looks the same way" in note for note in data.notes)
    assert (data.material_index[:, 0] != BLACK).all()


def test_a_solid_that_is_there_twice_counts_once():
    box = cq.Workplane().box(1, 2, 3)
    scene = scene_of(a=box, b=box.translate((0, 0, 0)))
    a, b = paths(scene)
    data = scene.freeze()
    assert is_dark(data, a)
    assert not is_dark(data, b)
    assert any(note.startswith("6 faces lie on others") for note in data.notes)


def test_near_is_not_the_same():
    scene = scene_of(a=SQUARE, b=SQUARE.copy().translate(cq.Vector(0, 0, 1e-4)))
    assert not any("looks the same way" in note for note in scene.freeze().notes)


def test_of_two_lamps_on_each_other_one_shines():
    scene = scene_of(a=SQUARE, b=SQUARE.copy(), floor=SQUARE.moved(cq.Location((0, 0, -3))))
    a, b, _ = paths(scene)
    scene.assign(a, Emitter(flux_lm=100.0))
    scene.assign(b, Emitter(flux_lm=300.0))
    data = scene.freeze()
    assert [lamp.part for lamp in data.luminaires] == [b]
    assert set(np.unique(data.luminaire_index)) == {-1, 0}
    assert any(note.startswith(f"no light of {a}:") for note in data.notes)
    result = simulate(scene, accuracy=0.1)
    assert result.balance.emitted_lm == pytest.approx(300.0, rel=1e-6)
