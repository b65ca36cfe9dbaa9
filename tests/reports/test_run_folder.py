"""Files of an output folder: present, readable by others, equal to the result."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from patchlight.reports import rendering_status, write_run
from patchlight.solver.errors import OutputError
from patchlight.solver.model import Result

CONFIG = "schema_version = 1\naccuracy = 0.01\n"


@pytest.fixture(scope="module")
def run(result: Result, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return write_run(result, tmp_path_factory.mktemp("run") / "new" / "folder", config=CONFIG)


def test_all_files_exist_and_no_temporary_file_is_left(run: dict[str, Path]) -> None:
    wanted = {
        "run.json", "config.resolved.toml", "metrics.json", "metrics.csv", "grids/workplane.csv",
        "patches.npz", "images/door.exr", "images/door.png", "images/door_falsecolor.png",
        "images/scene_falsecolor.png", "scene/scene.vtp", "scene/scene.html", "report.html",
    }  # fmt: skip
    assert set(run) == wanted
    folder = run["run.json"].parent
    on_disk = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    assert on_disk == wanted


def test_run_json_states_provenance_stages_and_ledger(run: dict[str, Path], result: Result) -> None:
    record = json.loads(run["run.json"].read_text())
    assert record["schema_version"] == 1 and record["status"] == "ok" and record["converged"]
    assert record["inputs"][0]["path"] == "rooms/office.step"
    assert record["inputs"][0]["sha256"] == "ab" * 32
    totals = record["inputs"][0]["certificate"]
    assert totals["faces_failed"] == 1 and totals["failed"][0]["part"] == "office/vase"
    assert record["stages"]["form factors"] == {"seconds": 1.7}
    assert record["skipped"]["sun"] == "the scene has no sun"
    assert record["flux"]["residual_lm"] == pytest.approx(result.balance.residual_lm)
    assert record["row_sums"]["mean"] == pytest.approx(0.9995)
    assert record["maintenance_factor"] == 0.8 and record["host"]["cores"] >= 1
    assert record["settings"]["accuracy"] == 0.01 and "numpy" in record["libraries"]
    assert [r["verdict"] for r in record["requirements"]] == ["fail", "fail"]
    assert record["warnings"] == list(result.warnings) and record["started"] <= record["ended"]
    assert tomllib.loads(run["config.resolved.toml"].read_text())["accuracy"] == 0.01


def test_grid_csv_holds_every_point_and_component(run: dict[str, Path], result: Result) -> None:
    with open(run["grids/workplane.csv"], newline="") as stream:
        rows = list(csv.DictReader(stream))
    grid = result.sensors["workplane"]
    assert list(rows[0]) == [
        "point_id", "x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", "E_lx", "error_lx",
        "E_ceiling.direct_lx", "E_ceiling.indirect_lx", "E_sky.direct_lx", "E_sky.indirect_lx",
        "DF_percent", "DF_error_percent", "SC_percent", "ERC_percent", "IRC_percent",
    ]  # fmt: skip
    assert len(rows) == len(grid.points)
    lux = np.array([float(r["E_lx"]) for r in rows])
    np.testing.assert_allclose(lux, grid.illuminance_lx, rtol=1e-8)  # nine digits written
    parts = np.array([[float(r[f"E_{c}_lx"]) for c in grid.components] for r in rows])
    np.testing.assert_allclose(parts.sum(axis=1), lux, rtol=1e-7)
    assert grid.daylight_factor is not None
    shares = [float(r["DF_percent"]) for r in rows]
    np.testing.assert_allclose(shares, 100 * grid.daylight_factor, rtol=1e-8)
    parts = [[float(r[f"{c}_percent"]) for c in ("SC", "ERC", "IRC")] for r in rows]
    np.testing.assert_allclose(np.sum(parts, axis=1), shares, rtol=1e-7)


def test_metrics_agree_in_both_files(run: dict[str, Path], result: Result) -> None:
    data = json.loads(run["metrics.json"].read_text())
    assert data["schema_version"] == 1
    by_id = {m["id"]: m for m in data["metrics"]}
    mean = result.sensors["workplane"].metrics["E_avg_lx"]
    assert by_id["E_avg_lx"]["value"] == pytest.approx(mean)
    assert by_id["E_avg_lx"]["requirement"] == ">= 400" and by_id["E_avg_lx"]["verdict"] == "fail"
    assert by_id["U0"]["unit"] == "1" and by_id["E_min_lx"]["verdict"] is None
    with open(run["metrics.csv"], newline="") as stream:
        table = list(csv.DictReader(stream))
    assert list(table[0]) == [
        "id", "quantity", "sensor_id", "value", "unit", "uncertainty", "requirement", "verdict",
    ]  # fmt: skip
    assert [r["id"] for r in table] == [m["id"] for m in data["metrics"]]
    assert float(table[0]["value"]) == data["metrics"][0]["value"]


def test_patches_hold_exact_nets_and_components(run: dict[str, Path], result: Result) -> None:
    with np.load(run["patches.npz"], allow_pickle=False) as data:
        assert int(data["schema_version"]) == 1
        np.testing.assert_array_equal(data["nets"], result.elements.nets)
        np.testing.assert_array_equal(data["illuminance_lx"], result.illuminance_lx)
        total = sum(data[f"irradiance.{c}"] for c in data["components"])
        np.testing.assert_allclose(total[:, 0], result.illuminance_lx)
        assert data["part_paths"][data["part_index"][-1]] == "office/vase"


def test_exr_reads_back_as_absolute_luminance_with_layers(
    run: dict[str, Path], result: Result
) -> None:
    import OpenEXR

    image = result.images["door"]
    with OpenEXR.File(str(run["images/door.exr"]), separate_channels=True) as file:
        header = dict(file.header())
        pixels = {name: channel.pixels for name, channel in file.channels().items()}
    assert header["whiteLuminance"] == pytest.approx(1.0)
    np.testing.assert_allclose(header["chromaticities"][6:], (0.3127, 0.3290), atol=1e-6)
    rgb = np.stack([pixels[c] for c in "RGB"], axis=-1)
    assert rgb.dtype == np.float32
    np.testing.assert_array_equal(rgb, image.rgb.astype(np.float32))
    np.testing.assert_allclose(
        rgb @ np.array([0.2126, 0.7152, 0.0722]), image.luminance_cd_m2, rtol=1e-5
    )
    np.testing.assert_array_equal(pixels["illuminance.Y"], image.illuminance_lx.astype("f4"))
    np.testing.assert_array_equal(pixels["depth.Z"], image.depth_m.astype("f4"))
    for k, axis in enumerate("XYZ"):
        np.testing.assert_array_equal(pixels[f"normal.{axis}"], image.normals[..., k].astype("f4"))
    assert pixels["id.part"].dtype == np.uint32
    outside = image.part_index < 0
    assert outside.any() and (pixels["id.part"][outside] == 0xFFFFFFFF).all()
    np.testing.assert_array_equal(pixels["id.part"][~outside], image.part_index[~outside])


def test_vtp_is_read_by_vtk(run: dict[str, Path], result: Result) -> None:
    # In a child: VTK and the test session should not share a fate.
    code = (
        "import sys, vtk; r = vtk.vtkXMLPolyDataReader(); r.SetFileName(sys.argv[1]); r.Update();"
        "d = r.GetOutput(); p = vtk.vtkMassProperties;"
        "print(d.GetNumberOfPolys(), *d.GetPointData().GetArray('E_lx').GetRange(), *d.GetBounds())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(run["scene/scene.vtp"])],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    polys, low, high, *bounds = (float(x) for x in done.stdout.split())
    assert polys % len(result.elements) == 0
    # Values at points are means of element values: never outside their range.
    assert result.illuminance_lx.min() <= low < high <= result.illuminance_lx.max()
    np.testing.assert_allclose(bounds, [0, 6, 0, 4, 0, 3], atol=1e-9)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_write_permission(result: Result, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match=str(tmp_path)):
        write_run(result, tmp_path / "out")


def test_folder_that_cannot_be_made(result: Result, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with pytest.raises(OutputError, match="file"):
        write_run(result, tmp_path / "file" / "out")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_full_disk_keeps_the_old_file(tmp_path: Path) -> None:
    from patchlight.reports.files import write_atomic

    target = tmp_path / "run.json"
    target.write_text("old")

    def fill(_: Path) -> None:
        with open("/dev/full", "wb") as stream:
            stream.write(b"x" * 100_000)

    with pytest.raises(OutputError, match=r"run\.json.*space"):
        write_atomic(target, fill)
    assert target.read_text() == "old" and [p.name for p in tmp_path.iterdir()] == ["run.json"]


def test_names_are_made_safe_and_unique(
    build: Callable[..., Result],
    result: Result,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from patchlight.reports import writer

    monkeypatch.setattr(writer, "scene_still", lambda r: None)
    grid, image = result.sensors["workplane"], result.images["door"]
    names = ["../../etc/passwd", "Büro 1/West", "Büro 1 West", "..", "x" * 300, "名前", "CON"]
    # A camera may not take the name of the 3-D still or of another's false colours.
    views = {n: image for n in (names[0], "scene", "a", "a_falsecolor")}
    odd = build(pieces=2, sensors={n: grid for n in names}, images=views)
    written = write_run(odd, tmp_path / "out")
    grids = [k for k in written if k.startswith("grids/")]
    assert len(grids) == len(names) and len([k for k in written if k.startswith("images/")]) == 12
    assert "images/scene-2.png" in written and "images/a_falsecolor-2.png" in written
    for path in written.values():
        assert path.is_file() and (tmp_path / "out") in path.resolve().parents
        assert path.name.isascii() and " " not in path.name and len(path.name) < 120
    assert "grids/Buero_1_West.csv" in written and "grids/Buero_1_West-2.csv" in written


def test_still_without_opengl_says_so_and_looks_alike(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    from patchlight.reports import still

    size = (300, 200)
    able = rendering_status()[0]
    with_vtk = still.scene_still(result, size=size)
    monkeypatch.setattr(still, "rendering_status", lambda: (False, "libEGL is missing"))
    without = still.scene_still(result, size=size)
    assert with_vtk is not None and without is not None
    assert "libEGL is missing" in without.note and "left out" in without.caption
    if able and not with_vtk.note:
        a, b = (_pixels(s.png) for s in (with_vtk, without))
        # Same camera, same colours: they differ along edges and lines only.
        assert (np.abs(a - b).max(axis=-1) > 0.1).mean() < 0.03


def test_renderer_that_dies_or_hangs_is_survived(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    from patchlight.reports import still

    crash = shutil.which("false") or "/bin/false"
    monkeypatch.setattr(still, "rendering_status", lambda: (True, ""))
    monkeypatch.setattr(still, "window_classes", lambda: ["vtkEGLRenderWindow"])
    monkeypatch.setattr(still.sys, "executable", crash)
    picture = still.scene_still(result, size=(150, 100))
    assert picture is not None and "rendering failed" in picture.note


def _pixels(png: bytes) -> np.ndarray:
    import io

    from matplotlib import image

    return np.asarray(image.imread(io.BytesIO(png)))[..., :3]
