"""A furnished room with invented but plausible light, so that reports need no solver.

Direct light of the lamp follows the inverse-square law of a small Lambertian source, sky light
falls off from a window side, indirect light is nearly uniform. Pictures are traced analytically.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from patchlight.solver.model import (
    Balance,
    Camera,
    CameraImage,
    Certificate,
    CIESky,
    DaylightShares,
    Elements,
    Face,
    Ground,
    Luminaire,
    Material,
    PatchSet,
    Result,
    SceneData,
    SceneFace,
    ScenePart,
    SensorResult,
    Site,
    Source,
    Sun,
    bezier,
)

SIZE = np.array([6.0, 4.0, 3.0])
LAMP = np.array([3.0, 2.0, 2.95])
COLUMN = ((4.6, 1.2), 0.25)
FLUX = 4200.0
GROUPS = ("ceiling.direct", "ceiling.indirect", "sky.direct", "sky.indirect")


def light(points: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Invented illuminance by component at points (..., 3) with unit normals (..., 3). [lx]"""
    to_lamp = LAMP - points
    r2 = np.maximum((to_lamp**2).sum(-1), 0.05)
    direction = to_lamp / np.sqrt(r2)[..., None]
    lamp = np.maximum(direction[..., 2], 0.0) * np.maximum((direction * normals).sum(-1), 0.0)
    to_window = np.array([0.0, 2.0, 1.6]) - points
    w2 = np.maximum((to_window**2).sum(-1), 0.3)
    unit = to_window / np.sqrt(w2)[..., None]
    window = np.maximum(-unit[..., 0], 0.0) * np.maximum((unit * normals).sum(-1), 0.0)
    window = np.where(points[..., 0] < 1e-9, 0.0, window)
    return {
        "ceiling.direct": FLUX / np.pi * lamp / r2,
        "ceiling.indirect": 60.0 + 20.0 * points[..., 2] / SIZE[2],
        "sky.direct": 1500.0 * window / w2,
        "sky.indirect": 40.0 * np.exp(-points[..., 0] / 4.0),
    }


def scene_data(**changes: Any) -> SceneData:
    """Room of 6 x 4 x 3 m with a column, a lamp disc and a vase."""
    room = PatchSet.box(SIZE, center=SIZE / 2, inward=True)
    (cx, cy), radius = COLUMN
    column = PatchSet.cylinder((cx, cy, 0.0), (cx, cy, 3.0), radius)
    lamp = PatchSet.disk(LAMP, 0.3, (0.0, 0.0, -1.0))
    vase = PatchSet.torus((1.6, 2.9, 0.35), (0.0, 0.3, 1.0), 0.35, 0.12)
    sets = [room, column, lamp, vase]
    names = ["office/room", "office/column", "office/Leuchte ä/1", "office/vase"]
    nets = np.concatenate([s.control_points for s in sets])
    part = np.concatenate([np.full(len(s), k) for k, s in enumerate(sets)])
    # One face a patch in the room, one face for each curved part.
    face = np.concatenate(
        [np.arange(6), *(np.full(len(s), 5 + k) for k, s in enumerate(sets[1:], 1))]
    )
    n = len(nets)
    material = np.column_stack([np.where(part == 0, np.minimum(face, 2), 2 + part), np.full(n, -1)])
    emitting = np.where(part == 2, 0, -1)
    faces = (
        *(SceneFace(0, k + 1, "plane") for k in range(6)),
        SceneFace(1, 1, "cylinder"), SceneFace(2, 1, "plane"), SceneFace(3, 1, "torus"),
    )  # fmt: skip
    rows = tuple(
        Face(f.part, f.number, f.kind, f.kind != "torus", 1, 2e-6, 0.02, 1.0, 3e-8, 1e-9)
        for f in faces
    )
    failed = Face(3, 2, "offset", False, 0, 0.0, 0.0, 0.0, reason="self-intersecting offset")
    certificate = Certificate((*rows, failed), tuple(names), 1.3, ("1 shell re-oriented",))
    values: dict[str, Any] = dict(
        patches=PatchSet(nets, face, part),
        two_sided=np.zeros(n, bool),
        closed=np.ones(n, bool),
        material_index=material,
        luminaire_index=np.column_stack([emitting, np.full(n, -1)]),
        parts=tuple(
            ScenePart(p, "office", "air" if k == 0 else "solid") for k, p in enumerate(names)
        ),
        faces=faces,
        materials=(
            Material(0.2, name="floor carpet"), Material(0.8, name="white ceiling"),
            Material((0.6, 0.55, 0.5), name="warm plaster"), Material(0.4, name="concrete"),
            Material(0.0, name="lamp"), Material((0.6, 0.1, 0.05)),
        ),
        luminaires=(
            Luminaire(names[2], "ceiling", FLUX, np.pi * 0.09, np.ones(3), 4000.0, 32.0),
        ),
        sky=CIESky(16), sun=None, ground=Ground(0.2),
        site=Site(50.1, 8.7, 112.0, "Europe/Berlin"), north_deg=0.0, maintenance_factor=0.8,
        sources=(Source("office", "rooms/office.step", "ab" * 32, "mm", 1.0, certificate),),
        default_faces=np.array([False] * 8 + [True]),
        title="Office <B&B> 3.14",
        notes=("air volume found: office/room",),
    )  # fmt: skip
    values.update(changes)
    return SceneData(**values)


def elements_of(patches: PatchSet, pieces: int) -> Elements:
    """``pieces`` x ``pieces`` elements a patch with 2 x 2 nodes."""
    cuts = np.linspace(0.0, 1.0, pieces + 1)
    boxes = [
        (a, b, c, d) for a, b in zip(cuts, cuts[1:], strict=False)
        for c, d in zip(cuts, cuts[1:], strict=False)
    ]  # fmt: skip
    p, per = len(patches), len(boxes)
    nets = np.stack([bezier.sub_net(patches.control_points, *box) for box in boxes], axis=1)
    nets = nets.reshape(p * per, 4, 4, 4)
    t = np.array([0.25, 0.75])
    local = PatchSet(nets) if p else patches
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    areas = bezier.areas(nets)
    return Elements(
        nets, np.repeat(np.arange(p), per), np.zeros(p * per), 
        np.tile(boxes, (p, 1)).reshape(-1, 4),
        local.evaluate(u, v).reshape(-1, 4, 3),
        np.nan_to_num(local.normals(u, v)).reshape(-1, 4, 3),
        np.repeat(areas[:, None] / 4.0, 4, axis=1), areas, np.zeros((p * per, 4), bool),
    )  # fmt: skip


def grid(name: str, points: np.ndarray, **changes: Any) -> SensorResult:
    """Horizontal sensors at ``points`` under the invented light."""
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    parts = light(points, normals)
    total = sum(parts.values(), np.zeros(len(points)))
    values: dict[str, Any] = dict(
        name=name, points=points, normals=normals, area_m2=np.full(len(points), 0.25),
        illuminance_lx=total, error_lx=0.01 * total, components=parts,
        daylight=DaylightShares(
            16, parts["sky.direct"] / 1e4, 0.0 * total, parts["sky.indirect"] / 1e4, 1e-6 * total
        ),
    )  # fmt: skip
    values.update(changes)
    return SensorResult(**values)


def plane_points(size: tuple[float, float] = (6.0, 4.0), z: float = 0.8) -> np.ndarray:
    """Cell centres of a 0.5 m grid."""
    x, y = (np.arange(0.25, s, 0.5) for s in size)
    xx, yy = np.meshgrid(x, y, indexing="ij")
    return np.stack([xx.ravel(), yy.ravel(), np.full(xx.size, z)], -1)


def picture(camera: Camera) -> CameraImage:
    """The room as seen from inside, by analytic ray casting."""
    origin, d = camera.rays()
    with np.errstate(divide="ignore", invalid="ignore"):
        walls = np.where(d > 0, (SIZE - origin) / d, -origin / d)
    t = walls.min(-1)
    axis = walls.argmin(-1)
    normal = -np.sign(d) * (np.arange(3) == axis[..., None])
    part = np.zeros(t.shape, int)
    (cx, cy), radius = COLUMN
    ox, oy = origin[..., 0] - cx, origin[..., 1] - cy
    a = d[..., 0] ** 2 + d[..., 1] ** 2
    b = ox * d[..., 0] + oy * d[..., 1]
    root = b * b - a * (ox**2 + oy**2 - radius**2)
    s = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    hit = (root > 0) & (s > 0) & (s < t)
    t = np.where(hit, s, t)
    x = origin + t[..., None] * d
    side = np.stack([(x[..., 0] - cx) / radius, (x[..., 1] - cy) / radius, 0 * t], -1)
    normal = np.where(hit[..., None], side, normal)
    part[hit] = 1
    e = sum(light(x, normal).values(), np.zeros(t.shape))
    rho = np.where(normal[..., 2] > 0.5, 0.2, np.where(normal[..., 2] < -0.5, 0.8, 0.55))
    rgb = (e * rho / np.pi)[..., None] * np.array([1.06, 0.99, 0.93])
    lamp = (normal[..., 2] < -0.5) & (np.hypot(x[..., 0] - 3.0, x[..., 1] - 2.0) < 0.3)
    rgb[lamp] = FLUX / (np.pi * 0.09) / np.pi
    window = (x[..., 0] < 1e-6) & (abs(x[..., 1] - 2) < 0.9) & (abs(x[..., 2] - 1.6) < 0.6)
    rgb[window] = (2200.0, 2500.0, 3000.0)
    part[window] = -1
    e, t = np.where(window, np.nan, e), np.where(window, np.nan, t)
    return CameraImage(camera, rgb, e, t, np.where(window[..., None], np.nan, normal), part)


def make_result(scene: SceneData | None = None, *, pieces: int = 6, **changes: Any) -> Result:
    """A result of ``scene``; ``changes`` replace fields of it."""
    scene = scene_data() if scene is None else scene
    elements = elements_of(scene.patches, pieces)
    center, normal = elements.nodes.mean(1), elements.normals.mean(1)
    parts = {k: v[:, None] for k, v in light(center, normal).items()}
    total = sum(parts.values(), np.zeros((len(elements), 1)))
    outline = np.array([[0, 0, 0.8], [6, 0, 0.8], [6, 4, 0.8], [0, 4, 0.8]])
    points = plane_points()
    (cx, cy), radius = COLUMN
    points = points[np.hypot(points[:, 0] - cx, points[:, 1] - cy) > radius]
    camera = Camera((5.6, 0.5, 1.6), (1.5, 2.6, 1.1), "door", fov_deg=75, size=(320, 240))
    values: dict[str, Any] = dict(
        scene=scene, elements=elements, components=parts, exitance=0.5 * total,
        element_error_lx=0.01 * total[:, 0],
        sensors={"workplane": grid("workplane", points, outline=(outline,))},
        images={"door": picture(camera)},
        balance=Balance(
            FLUX, 5200.0, 8900.0, 496.0, {"warm plaster": 5200.0, "floor carpet": 3700.0},
            {"ceiling": FLUX},
        ),
        row_sums=np.full(len(elements), 0.9995),
        stages={"elements": 0.02, "form factors": 1.7, "radiosity": 0.4, "sensors": 0.6},
        skipped={"specular": "no glossy material", "sun": "the scene has no sun"},
        counters={"elements": len(elements), "pairs": len(elements) ** 2, "rays": 120_000},
        settings={
            "accuracy": 0.01, "visibility": "auto", "threads": 2,
            "requirements": [
                {"sensors": "workplane", "metric": "E_avg_lx", "min": 400},
                {"sensors": "workplane", "metric": "U0", "min": 0.6},
            ],
        },
        warnings=("office/vase: 1 face is on the default material, reflectance 0.5",),
    )  # fmt: skip
    values.update(changes)
    return Result(**values)


@pytest.fixture(scope="session")
def result() -> Result:
    return make_result()


@pytest.fixture(scope="session")
def build() -> Callable[..., Result]:
    return make_result


@pytest.fixture(scope="session")
def build_scene() -> Callable[..., SceneData]:
    return scene_data


@pytest.fixture(scope="session")
def build_grid() -> Callable[..., SensorResult]:
    return grid


@pytest.fixture(scope="session")
def sunny_scene() -> SceneData:
    return replace(
        scene_data(), sky=CIESky(12, sun_altitude_deg=40, sun_azimuth_deg=180,
                                 diffuse_illuminance_lx=12000),
        sun=Sun(40, 180, normal_illuminance_lx=80000),
    )  # fmt: skip
