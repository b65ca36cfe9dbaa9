"""From the mutable scene to the arrays that the solver works on."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.errors import GeometryError, InputError
from patchlight.solver.model import (
    BLACK,
    Camera,
    Emitter,
    Ground,
    Luminaire,
    PatchSet,
    SceneData,
    SceneFace,
    ScenePart,
    Sky,
    Source,
    Sun,
    Web,
)
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.sky import direction

from .assigning import full_path, matched_parts, row_offsets
from .coincident import with_one_of_each
from .flush import with_flush_faces
from .frames import part_placements, transformed_normals, transformed_points
from .glazing import with_glass
from .problems import Problems
from .profiles import with_profile
from .slots import Slots, filled_slots
from .states import absent_parts, without_parts
from .webs import Webs, web_doubts

if TYPE_CHECKING:
    from .scene import Scene

#: Largest angle between the sun of the sky and the sun itself. [deg]
SUN_TOLERANCE_DEG = 0.5


def frozen_scene(scene: Scene, states: tuple[str, ...] = ()) -> SceneData:
    """World coordinates, materials, luminaires and resolved sensors of ``scene``.

    Of all its parts, or of those that are there in some ``states``, one a window group.
    """
    problems = Problems()
    with problems.under():
        check_sun(scene.sky, scene.sun)
    beside = scene.daylight_factor is not None
    spectral = [name for name, grid in scene.grids.items() if grid.spectral]
    asked = (
        r.problem(scene.grids, scene.sky, scene.sun, daylight_factor=beside, spectral=spectral)
        for r in scene.requirements
    )
    problems.add(text for text in asked if text)
    data = None
    with problems.under():
        slots, data = _without_sensors(scene, states)
    if data is None:
        problems.raise_any()
        raise InputError("the scene cannot be used")  # there always is a problem; for type checkers
    data = dataclasses.replace(data, luminaires=_luminaires(scene, slots, data, problems))
    doubts_of_lamps = web_doubts(data, slots, problems)
    from .color_remarks import color_warnings
    from .grids import resolved_sensors
    from .remarks import model_warnings, scene_notes

    # Sensors are those of the scene with all its parts, whatever its state.
    sensors, grid_notes = ((), ()) if states else resolved_sensors(scene, data, problems)
    if any(grid.spectral for grid in sensors):
        _check_bands(data.luminaires, problems)
    problems.raise_any()
    data = dataclasses.replace(
        data,
        sensors=sensors,
        daylight_factors=scene.daylight_factor,
        outdoor_parts=_outdoor_parts(scene, problems),
    )
    problems.raise_any()
    return dataclasses.replace(
        data,
        notes=(*scene.notes, *data.notes, *grid_notes, *scene_notes(scene, data)),
        warnings=(*model_warnings(scene), *doubts_of_lamps, *color_warnings(data)),
    )


def _without_sensors(scene: Scene, states: tuple[str, ...]) -> tuple[Slots, SceneData]:
    """Geometry, materials and light from outside."""
    if not scene.entries:
        raise InputError("the scene is empty: add a model or patches")
    slots = filled_slots(scene)
    parts, faces = _part_table(scene)
    patches, notes = with_flush_faces(_patches(scene), parts)
    kinds = np.array([p.kind for p in parts])[patches.part_index]
    two_sided = kinds == "sheet"
    material_index = slots.material[patches.face_index]
    material_index[~two_sided, 1] = BLACK
    luminaire_index = slots.luminaire[patches.face_index]
    luminaire_index[~two_sided, 1] = -1
    data = SceneData(
        patches=patches,
        two_sided=two_sided,
        closed=(kinds == "solid") | (kinds == "air"),
        material_index=material_index,
        luminaire_index=luminaire_index,
        parts=parts,
        faces=faces,
        materials=slots.materials,
        sky=scene.sky,
        sun=scene.sun,
        ground=_ground(scene),
        site=scene.site,
        north_deg=scene.north_deg,
        maintenance_factor=scene.maintenance_factor,
        cameras=tuple(_turned_camera(scene, c) for c in scene.cameras.values()),
        sources=_sources(scene),
        default_faces=slots.default_faces,
        title=scene.title or next(iter(scene.entries)),
        notes=notes,
    )
    gone: list[int] = []
    had = np.unique(data.luminaire_index[data.luminaire_index >= 0])
    if states:
        gone = absent_parts(scene.states.values(), states, scene.entries)
        data = without_parts(data, gone)
    slots, data = _without_lost_lamps(slots, with_one_of_each(data, slots.order), had, gone)
    return slots, with_glass(data, slots.glass)


def _without_lost_lamps(
    slots: Slots, data: SceneData, had: IntArray, gone: list[int]
) -> tuple[Slots, SceneData]:
    """Lamps that ``had`` faces and have none left are none: those of parts that are ``gone``, and
    those whose faces all lie on others that carry the light instead.
    """
    left = np.unique(data.luminaire_index[data.luminaire_index >= 0])
    lost = np.setdiff1d(had, left)
    if not len(lost):
        return slots, data
    number = np.full(len(slots.lamps) + 1, -1)  # the last one stands for no lamp
    kept = [k for k in range(len(slots.lamps)) if k not in lost]
    number[kept] = np.arange(len(kept))
    paths = [data.parts[slots.lamps[k][0]].path for k in lost if slots.lamps[k][0] not in gone]
    note = (
        f"no light of {', '.join(paths)}: the emitting faces lie on others that look the same way "
        "and carry the light; remove one of the two"
    )
    return (
        dataclasses.replace(slots, lamps=[slots.lamps[k] for k in kept]),
        dataclasses.replace(
            data,
            luminaire_index=number[data.luminaire_index],
            notes=(*data.notes, note) if paths else data.notes,
        ),
    )


def _part_table(scene: Scene) -> tuple[tuple[ScenePart, ...], tuple[SceneFace, ...]]:
    parts: list[ScenePart] = []
    faces: list[SceneFace] = []
    for entry in scene.entries.values():
        offset = len(parts)
        for k, part in enumerate(entry.model.parts):
            kind = part.kind if entry.kind == "cad" else entry.kind
            if k in entry.air:
                kind = "air"
            parts.append(ScenePart(full_path(entry, part), entry.name, kind, part.color))
        faces.extend(
            SceneFace(offset + f.part, f.number, f.kind, f.name, f.color) for f in entry.model.faces
        )
    paths = [p.path for p in parts]
    if len(set(paths)) < len(paths):
        twice = next(p for p in paths if paths.count(p) > 1)
        raise InputError(f"part path {twice!r} occurs twice; give the models different names")
    return tuple(parts), tuple(faces)


def _patches(scene: Scene) -> PatchSet:
    """All patches in world axes, rows of parts and faces counted through the scene."""
    sets: list[PatchSet] = []
    part_offset = face_offset = 0
    for entry in scene.entries.values():
        placed = entry.placed.patches.moved(scene.north)
        sets.append(
            PatchSet(
                placed.control_points,
                placed.face_index + face_offset,
                placed.part_index + part_offset,
                _offset_edges(placed.edge_index, sets),
            )
        )
        part_offset += len(entry.model.parts)
        face_offset += len(entry.model.faces)
    patches = PatchSet.concatenated(*sets)
    if len(patches) == 0:
        raise GeometryError("the scene has no faces that could carry light")
    return patches


def _offset_edges(edges: np.ndarray, before: list[PatchSet]) -> np.ndarray:
    """Edge numbers that no earlier model uses; -1 stays."""
    start = max((int(s.edge_index.max(initial=-1)) for s in before), default=-1) + 1
    return np.where(edges >= 0, edges + start, -1)


def _luminaires(
    scene: Scene, slots: Slots, data: SceneData, problems: Problems
) -> tuple[Luminaire, ...]:
    """Luminaires with the area and flux of each emitting part."""
    if not slots.lamps:
        return ()
    rows = np.flatnonzero((data.luminaire_index >= 0).any(axis=1))
    area = np.zeros(len(slots.lamps))
    patch_areas = data.patches.take(rows).areas()
    for side in (0, 1):
        lamp = data.luminaire_index[rows, side]
        np.add.at(area, lamp[lamp >= 0], patch_areas[lamp >= 0])
    luminaires = []
    webs, placements = Webs(scene), part_placements(scene)
    for k, (part_row, emitter) in enumerate(slots.lamps):
        with problems.under():
            path = data.parts[part_row].path
            web = webs.web(part_row, path, emitter)
            lamp = _luminaire(path, emitter, area[k], scene.maintenance_factor, web)
            if emitter.profile is not None:
                patches = np.flatnonzero((data.luminaire_index == k).any(axis=1))
                lamp = with_profile(lamp, emitter, scene.north @ placements[part_row], patches)
            luminaires.append(lamp)
    return tuple(luminaires)


def _luminaire(
    path: str, emitter: Emitter, area_m2: float, maintenance: float, web: Web | None
) -> Luminaire:
    from patchlight.solver.spectra import cct_to_rgb, spectrum_color

    group = emitter.group or path.rsplit("/", 1)[-1]
    if group in ("sky", "sun", "ground"):
        raise InputError(f"light group {group!r} of {path}: the name is taken; set group")
    if not area_m2 > 0.0:
        raise GeometryError(f"{path}: the emitting faces have no area")
    flux, power = emitter.flux_lm, emitter.power_w
    if web is not None:
        flux = web.photometry.flux_lm if flux is None else flux
        power = web.photometry.power_w if power is None else power
    if flux is None:
        flux = math.pi * float(emitter.luminance_cd_m2 or 0.0) * float(area_m2)
    color, cct = cct_to_rgb(emitter.cct_k), emitter.cct_k
    if emitter.spectrum is not None:
        try:
            color, cct = spectrum_color(tuple(emitter.spectrum))
        except InputError as error:
            raise InputError(f"emitter of {path}: {error}") from None
    return Luminaire(
        part=path,
        group=group,
        flux_lm=flux * emitter.dim * maintenance,
        area_m2=float(area_m2),
        color=np.asarray(color),
        cct_k=cct,
        power_w=power,
        spectrum=None if emitter.spectrum is None else tuple(emitter.spectrum),
        web=web,
    )


def _check_bands(lamps: tuple[Luminaire, ...], problems: Problems) -> None:
    """A problem for each luminaire whose spectrum the bands of spectral sensors have nothing of."""
    from patchlight.solver.spectra import spectrum_bands

    for lamp in lamps:
        if lamp.spectrum is not None:
            try:
                spectrum_bands(lamp.spectrum)
            except InputError as error:
                problems.add([f"emitter of {lamp.part}: {error}"])


def _ground(scene: Scene) -> Ground | None:
    if scene.ground is not None:
        return scene.ground
    return Ground(0.2) if scene.sky is not None or scene.sun is not None else None


def _outdoor_parts(scene: Scene, problems: Problems) -> tuple[int, ...]:
    """Rows of the parts that daylight factors count as outdoors."""
    asked, starts = scene.daylight_factor, row_offsets(scene.entries)[0]
    found: set[int] = set()
    for pattern in () if asked is None else asked.outside:
        with problems.under():
            label = f"daylight_factor.outside {pattern!r}"
            hits = matched_parts(scene.entries, pattern, label=label)
            found |= {starts[name] + k for name, k in hits}
    return tuple(sorted(found))


def check_sun(sky: Sky | None, sun: Sun | None) -> None:
    """Raise `InputError` where the sky brightens towards another sun."""
    if sky is None or sun is None or sky.sun_altitude_deg is None or sky.sun_azimuth_deg is None:
        return
    a = np.array(direction(sky.sun_altitude_deg, sky.sun_azimuth_deg))
    b = np.array(direction(sun.altitude_deg, sun.azimuth_deg))
    angle = math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), float(a @ b)))
    if angle > SUN_TOLERANCE_DEG:
        raise InputError(
            f"sky and sun: the sun of the sky (altitude {sky.sun_altitude_deg:g}, azimuth "
            f"{sky.sun_azimuth_deg:g}) and the sun (altitude {sun.altitude_deg:g}, azimuth "
            f"{sun.azimuth_deg:g}) are {angle:.2f} degrees apart; at most {SUN_TOLERANCE_DEG:g}"
        )


def _turned_camera(scene: Scene, camera: Camera) -> Camera:
    ends = transformed_points(scene.north, np.array([camera.eye, camera.target], dtype=float))
    up = transformed_normals(scene.north, np.asarray(camera.up, dtype=float))
    return dataclasses.replace(
        camera, eye=_triple(ends[0]), target=_triple(ends[1]), up=_triple(up)
    )


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])


def _sources(scene: Scene) -> tuple[Source, ...]:
    return tuple(
        Source(e.name, e.model.source, e.model.sha256, e.model.unit, e.scale, e.model.certificate)
        for e in scene.entries.values()
        if e.kind == "cad"
    )
