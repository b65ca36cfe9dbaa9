"""The demo conference room: its size, its parts, and that none of them run into another."""

import itertools

import numpy as np
import pytest

#: Least distance of two parts.
GAP_MM = 2.0


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    pytest.importorskip("cadquery")
    from patchlight.pipeline import load_scene
    from patchlight.pipeline.demo import write_demo

    return load_scene(write_demo("conference", tmp_path_factory.mktemp("demo")))


def test_model_has_the_size_of_the_published_scene(scene):
    model = scene.entries["conference"].model
    # 919 patches in Fig. 8 (d) of Nishita & Nakamae 1993.
    assert len(model.patches) == pytest.approx(919, rel=0.05)
    certificate = model.certificate
    assert certificate.faces_failed == 0 and all(face.exact for face in certificate.faces)
    assert model.warnings == ()
    assert all(p.color is not None and p.kind == "solid" for p in model.parts)


def test_parts_are_named(scene):
    paths = [p.path for p in scene.entries["conference"].model.parts]
    assert len(set(paths)) == len(paths)
    assert {"room", "screen", "table/top", "table/foot:1", "pot:3", "chair:9/back"} <= set(paths)
    assert sum(p.startswith("lamp:") for p in paths) == 24
    assert sum("/leg:" in p for p in paths) == 36


def test_scene_file_fits_its_model(scene):
    data = scene.freeze()
    assert data.closed.all() and not data.default_faces.any()
    assert [p.path for p in data.parts if p.kind == "air"] == ["conference/room"]
    assert data.groups == ("lamps",) and len(data.luminaires) == 24
    assert sum(lamp.flux_lm for lamp in data.luminaires) == pytest.approx(24 * 1600)
    assert all(40 <= len(grid) <= 120 for grid in data.sensors)
    # Floor and ceiling are told apart from inside the room.
    names = np.array([m.name for m in data.materials])
    rows = np.flatnonzero(data.patches.part_index == 0)
    found = names[data.material_index[rows, 0]]
    up = data.patches.normals(0.5, 0.5)[rows, 2]
    assert (up[found == "floor, carpet"] > 0.99).all() and (found == "floor, carpet").any()
    assert (up[found == "ceiling, white"] < -0.99).all() and (found == "ceiling, white").any()


def test_nothing_is_placed_wrongly(scene):
    from patchlight.solver.placement import check_placement

    assert check_placement(scene.freeze()) == ()


def test_parts_stand_clear_of_one_another():
    cq = pytest.importorskip("cadquery")
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from patchlight.pipeline.demo.conference import build

    placed = [(name, shape.moved(place)) for shape, name, place, _ in build()]
    solids = [(name, s) for name, s in placed if not name.endswith("/room")]
    (room,) = (s for name, s in placed if name.endswith("/room"))
    inside = cq.Compound.makeCompound([s for _, s in solids])
    # All air and furniture together is the room: nothing sticks out of it.
    assert room.cut(inside).Volume() == pytest.approx(room.Volume() - inside.Volume(), rel=1e-9)
    boxes = [s.BoundingBox() for _, s in solids]
    close = 0
    for (a, first), (b, second) in itertools.combinations(enumerate(solids), 2):
        low = np.array([boxes[a].xmin, boxes[a].ymin, boxes[a].zmin])
        high = np.array([boxes[b].xmax, boxes[b].ymax, boxes[b].zmax])
        other_low = np.array([boxes[b].xmin, boxes[b].ymin, boxes[b].zmin])
        other_high = np.array([boxes[a].xmax, boxes[a].ymax, boxes[a].zmax])
        if (low > high + 2 * GAP_MM).any() or (other_low > other_high + 2 * GAP_MM).any():
            continue
        close += 1
        distance = BRepExtrema_DistShapeShape(first[1].wrapped, second[1].wrapped)
        assert distance.Value() >= GAP_MM - 1e-6, (first[0], second[0])
    # Legs below their seats, the table on its feet, and the pot on the table.
    assert close >= 36 + 2 + 1
