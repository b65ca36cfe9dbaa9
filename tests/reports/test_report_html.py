"""The report: self-contained, complete, and sound for scenes where parts are missing."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from patchlight.reports import pdf_status, write_report, write_run
from patchlight.solver.errors import PatchlightWarning
from patchlight.solver.model import Balance, Elements, PatchSet, Result, SceneData, SensorResult


class _Links(HTMLParser):
    """Collects addresses and checks that tags are closed in order."""

    VOID = {"meta", "img", "br", "link", "input", "hr", "path", "use"}

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for key, value in attrs:
            if key in ("src", "href", "xlink:href", "data", "action") and value:
                self.addresses.append(value)
            if key == "id" and value:
                self.ids.append(value)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag


def check_page(text: str) -> _Links:
    """A page without outside addresses, NaN, doubled ids or unclosed tags."""
    page = _Links()
    page.feed(text)
    assert not page.open
    assert all(a.startswith(("#", "data:", "./")) for a in page.addresses), page.addresses
    assert not re.search(r"url\((?!#|data:)|@import|<link", text)
    inside = {a[1:] for a in page.addresses if a.startswith("#")}
    assert inside <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))
    visible = re.sub(r"<script.*?</script>|<style.*?</style>|data:[^\"]*", "", text, flags=re.S)
    assert not re.search(r"\bnan\b|\bNone\b|\binf\b", visible)
    return page


def render(result: Result) -> str:
    """Report without the 3-D still, which has tests of its own."""
    from patchlight.reports.report import render_report

    return render_report(result)


@pytest.fixture(scope="module")
def page(result: Result, tmp_path_factory: pytest.TempPathFactory) -> str:
    written = write_report(result, tmp_path_factory.mktemp("report"), scene_3d=True)
    return written["report.html"].read_text()


def test_page_is_self_contained_and_well_formed(page: str) -> None:
    links = check_page(page)
    pictures = [a for a in links.addresses if a.startswith("data:image/png;base64,")]
    assert len(pictures) == 3  # still, view, false-colour view
    for svg in re.findall(r"<svg.*?</svg>", page, flags=re.S):
        ET.fromstring(svg)
    assert 'getContext("webgl"' in page


def test_page_shows_what_a_reader_needs(page: str) -> None:
    for text in (
        "2 of 2 requirements failed", "266.3 ± 2.7", "≥ 400", "1 warning", "Relative error asked",
        "Office &lt;B&amp;B&gt; 3.14", "rooms/office.step", "ab" * 32, "(relative)", "50.1° N",
        "warm plaster", "1 face is on the default material", "office/vase: #1", "Leuchte ä/1",
        "self-intersecting offset", "the scene has no sun", "form factors", "0.043 %",
        "air volume found: office/room", "E [lx]", "1 245 456".replace(" ", "\u202f"),
    ):  # fmt: skip
        assert text in page, text


def test_efficacy_is_of_the_new_luminaire(page: str) -> None:
    # 4200 lm after a maintenance factor of 0.8 are 5250 lm new, from 32 W.
    assert re.search(r'<td class="n">164</td>', page)


def test_bare_result_has_no_empty_sections(
    build: Callable[..., Result], build_scene: Callable[..., SceneData], tmp_path: Path
) -> None:
    scene = build_scene(
        luminaires=(), sky=None, ground=None, site=None, sources=(), notes=(),
        default_faces=np.zeros(0, bool),
    )  # fmt: skip
    dark = Balance(0.0, 0.0, 0.0, 0.0)
    bare = build(
        scene, pieces=1, sensors={}, images={}, balance=dark, row_sums=np.zeros(0), stages={},
        skipped={}, counters={}, settings={}, warnings=(), components={},
        exitance=np.zeros((31, 1)),
    )  # fmt: skip
    written = write_run(bare, tmp_path)
    text = written["report.html"].read_text()
    check_page(text)
    assert "No sensor grids" in text and "Luminaires</h2>" not in text and "Views" not in text
    assert "warning" not in re.sub(r"<style.*?</style>", "", text, flags=re.S)
    assert not (tmp_path / "grids").exists()


def test_result_without_elements(
    build: Callable[..., Result], build_scene: Callable[..., SceneData], tmp_path: Path
) -> None:
    none = np.zeros((0, 2))
    scene = build_scene(
        patches=PatchSet.empty(), two_sided=np.zeros(0), closed=np.zeros(0), material_index=none,
        luminaire_index=none, faces=(), default_faces=np.zeros(0, bool),
    )  # fmt: skip
    empty = Elements(
        np.zeros((0, 4, 4, 4)), np.zeros(0), np.zeros(0), np.zeros((0, 4)), np.zeros((0, 4, 3)),
        np.zeros((0, 4, 3)), np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)),
    )  # fmt: skip
    result = replace(
        build(), scene=scene, elements=empty, components={"sky.direct": np.zeros((0, 1))},
        exitance=np.zeros((0, 1)), element_error_lx=np.zeros(0), row_sums=np.zeros(0),
    )  # fmt: skip
    written = write_run(result, tmp_path)
    assert "images/scene_falsecolor.png" not in written
    check_page(written["report.html"].read_text())


PLANE = np.stack([g.ravel() for g in np.meshgrid([0.5, 1.5, 2.5], [0.5, 1.5, 2.5])], axis=-1)
POINTS = np.column_stack([PLANE, np.full(9, 0.8)])


@pytest.mark.parametrize(
    "points",
    [
        POINTS[:1],
        POINTS[:2],
        POINTS[POINTS[:, 0] == 0.5],
        np.random.default_rng(1).uniform(0.3, 2.7, (40, 3)) * [1, 1, 0] + [0, 0, 0.8],
        np.random.default_rng(2).uniform(0.3, 2.7, (25, 3)),
        np.repeat(POINTS[:1], 4, axis=0),
        np.column_stack([np.linspace(0.1, 5.9, 59), np.full(59, 2.0), np.full(59, 0.8)]),
    ],
    ids=["one", "two", "row", "scattered", "in space", "one place", "line"],
)
def test_odd_grids(
    build: Callable[..., Result], build_grid: Callable[..., SensorResult], points: np.ndarray
) -> None:
    text = render(build(pieces=1, images={}, sensors={"odd": build_grid("odd", points)}))
    check_page(text)
    assert "<svg" in text


@pytest.mark.parametrize("level", [0.0, 0.003, 5.0, 50_000.0])
@pytest.mark.parametrize("shape", ["flat", "steep"])
def test_levels_adapt(
    build: Callable[..., Result], build_grid: Callable[..., SensorResult], level: float, shape: str
) -> None:
    lux = level * (np.ones(9) if shape == "flat" else np.geomspace(1e-3, 1.0, 9))
    parts = {"sky.direct": lux, "sky.indirect": 0 * lux}
    grid = build_grid("g", POINTS, illuminance_lx=lux, error_lx=0.01 * lux, components=parts)
    text = render(build(pieces=1, images={}, sensors={"g": grid}))
    check_page(text)
    assert ("Every point is dark" in text) == (level == 0.0)


def test_points_without_value_are_counted_not_shown(
    build: Callable[..., Result], build_grid: Callable[..., SensorResult]
) -> None:
    lux = np.linspace(100.0, 300.0, 9)
    lux[3] = np.nan
    some = build_grid("some", POINTS, illuminance_lx=lux, components={"sky.direct": lux})
    every = build_grid("every", POINTS, illuminance_lx=np.full(9, np.nan), components={})
    none = build_grid("none", POINTS[:0])
    grids = {"some": some, "every": every, "none": none}
    text = render(build(pieces=1, images={}, sensors=grids))
    check_page(text)
    assert "1 of 9 points have no value" in text
    assert text.count("This grid has no points with a value") == 2


def test_wall_and_turned_grids(
    build: Callable[..., Result], build_grid: Callable[..., SensorResult]
) -> None:
    from patchlight.reports.lattice import find_lattice, plane_frame

    wall = build_grid("wall", POINTS[:, [0, 2, 1]], normals=np.tile([0.0, 1.0, 0.0], (9, 1)))
    turn = np.deg2rad(20.0)
    spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    turned = build_grid("turned", POINTS @ spin.T)
    check_page(render(build(pieces=1, images={}, sensors={"wall": wall})))
    # Seen from its lit side a wall facing north has east to the left.
    frame = plane_frame(wall)
    np.testing.assert_allclose(frame.right, [-1.0, 0.0, 0.0], atol=1e-12)
    # World axes have north along +y; the plan turns back to the axes of the model.
    frame = plane_frame(turned, 20.0)
    uv = frame.project(turned.points)
    np.testing.assert_allclose(uv, POINTS[:, :2], atol=1e-12)
    assert find_lattice(uv, turned.area_m2) is not None


def test_sun_and_verdicts_of_the_headline(
    build: Callable[..., Result], sunny_scene: SceneData
) -> None:
    asked = {"sensors": "workplane", "metric": "E_avg_lx", "min": 100}
    sunny = build(sunny_scene, pieces=1, images={}, settings={"requirements": [asked]})
    text = render(sunny)
    check_page(text)
    assert "The requirement is met" in text and "80\u202f000 lx normal" in text
    assert "12\u202f000 lx diffuse horizontal" in text
    text = render(replace(sunny, converged=False))
    assert "Accuracy not reached" in text and 'class="verdict open"' in text


def test_pdf_or_a_clear_warning(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from patchlight.reports import writer

    small = replace(result, images={})
    monkeypatch.setattr(writer, "scene_still", lambda r: None)
    if pdf_status()[0]:
        written = write_report(small, tmp_path / "a.html", pdf=True)
        assert written["a.pdf"].read_bytes().startswith(b"%PDF")
    monkeypatch.setattr(writer, "pdf_status", lambda: (False, "no Pango"))
    with pytest.warns(PatchlightWarning, match=r"b\.pdf was not written: no Pango"):
        written = write_report(small, tmp_path / "b.html", pdf=True)
    assert set(written) == {"b.html"}


def test_shares_of_the_daylight_factor(result: Result) -> None:
    html = render(result)
    assert "traditional CIE overcast sky (Moon and Spencer), type 16" in html
    for name in ("sky component", "externally reflected component", "internally reflected"):
        assert name in html
    assert "daylight factor</td>" in html
