"""Everything wrong with a scene file at once: patterns beside faults of the tables."""

from __future__ import annotations

import pytest
from patchlight.pipeline import load_scene
from patchlight.solver.errors import InputError

from .scene_files import write


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with room.step: walls, and a lamp."""
    cq = pytest.importorskip("cadquery")
    monkeypatch.chdir(tmp_path)
    made = cq.Assembly(name="room")
    made.add(cq.Workplane().box(400, 400, 320), name="walls")
    made.add(cq.Workplane().box(40, 40, 10), name="lamp", loc=cq.Location((0, 0, 400)))
    made.export(str(tmp_path / "room.step"))
    return tmp_path


TEXT = """schema_version = 1
acuracy = 0.02
[[model]]
file = "room.step"
name = "room"
[[assign]]
parts = "room/wals"
material = {{ reflectance = 1.5 }}
[[assign]]
parts = "room/walls"
faces = "#99"
material = {{ reflectance = 0.5 }}
[[assign]]
parts = "lamp"
emitter = {{ flux_lm = 100, photometry = "none.ies" }}
[[sensors]]
name = "desk"
z_m = 0.8
over = "room/flor"
spacing_m = -1
[[state]]
name = "down"
absent = "blind*"
[view_out]
outside = "house"
{more}
"""
TABLES = (
    "acuracy: unknown key; did you mean 'accuracy'?",
    "assign[0].material: Material.reflectance = 1.5",
    "assign[2].emitter.photometry: ",
    "none.ies: no such file",
    "sensors[0]: sensors 'desk': spacing = -1",
)
PARTS = (
    "assign[0]: 'room/wals': no part matches; nearest: room/walls",
    "assign[1]: ",
    "sensors[0].over: 'room/flor': no part matches",
)
SHORT = (
    "state[0].absent: 'blind*': no part matches",
    "view_out.outside: 'house': no part matches",
)


def problems_of(folder, more):
    with pytest.raises(InputError) as caught:
        load_scene(write(folder, TEXT.format(more=more)))
    return str(caught.value)


def test_all_at_once(folder):
    said = problems_of(folder, "")
    for text in (*TABLES, *PARTS, *SHORT):
        assert text in said
    assert "assign[2]: " not in said  # the lamp is there


def test_patterns_that_another_model_may_match_are_left_out(folder):
    """They are told once all models are there."""
    said = problems_of(folder, '[[model]]\nfile = "house.step"\nunit = "parsec"')
    for text in (*TABLES, *PARTS, "house.step: no such file"):
        assert text in said
    assert "model[1]: unit = 'parsec': one of mm, cm, m" in said
    assert not any(text in said for text in SHORT)


def test_a_model_that_cannot_be_read_does_not_hide_patterns(folder):
    (folder / "house.step").write_text("no STEP file")
    text = """schema_version = 1
[[model]]
file = "room.step"
name = "room"
[[model]]
file = "house.step"
[[assign]]
parts = "room/wals"
material = { reflectance = 0.5 }
"""
    with pytest.raises(InputError) as caught:
        load_scene(write(folder, text))
    assert "model[1].file: " in str(caught.value)
    assert "assign[0]: 'room/wals': no part matches" in str(caught.value)
