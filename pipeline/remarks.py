"""What a user should know about a scene before trusting its numbers, one line each."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.model import CIESky, PerezSky, SceneData

from .color_remarks import color_notes

if TYPE_CHECKING:
    from .scene import Scene

#: Part names that promise transparency.
GLASS_NAMES = ("glass", "pane", "glazing")
#: Said of scenes without light of their own.
NO_LIGHT = "no light: the scene has no emitter, no sky and no sun"
#: How many names a line lists.
MOST_NAMES = 8


def scene_notes(scene: Scene, data: SceneData) -> list[str]:
    """All remarks on the frozen scene ``data``."""
    notes = _default_faces(data)
    notes += _glass(data)
    notes += _light(data)
    notes += color_notes(data)
    notes += _places(data)
    return notes


def model_warnings(scene: Scene) -> list[str]:
    """What is doubtful about the models themselves, each named where the text does not do so."""
    return [
        text if _names(text, entry.name) else f"{entry.name}: {text}"
        for entry in scene.entries.values()
        for text in entry.model.warnings
    ]


def _names(text: str, model: str) -> bool:
    """Whether a text is about a model by its name, or about a path that starts with it.

    Any other word may be the name of a model by chance, such as "solid" or "part".
    """
    path = re.search(rf"(?<![\w/]){re.escape(model)}/", text)
    return text.startswith(f"model {model} ") or path is not None


def listed(names: list[str]) -> str:
    """``a, b, c and 4 more``."""
    unique = list(dict.fromkeys(names))
    more = len(unique) - MOST_NAMES
    return ", ".join(unique[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _default_faces(data: SceneData) -> list[str]:
    rows = np.flatnonzero(data.default_faces)
    if not len(rows):
        return []
    names = listed([data.parts[data.faces[r].part].path for r in rows])
    return [
        f"{len(rows)} of {len(data.faces)} faces have no material and got the default, "
        f"grey 0.5: {names}"
    ]


def _glass(data: SceneData) -> list[str]:
    clear = set(data.patches.part_index[data.glass_index >= 0].tolist())
    names = [
        part.path
        for row, part in enumerate(data.parts)
        if row not in clear
        and any(word in part.path.rsplit("/", 1)[-1].lower() for word in GLASS_NAMES)
    ]
    if not names:
        return []
    return [f"named like glass, but opaque: assign Glass to let light through: {listed(names)}"]


def _light(data: SceneData) -> list[str]:
    notes = []
    if data.sky is None and data.sun is None and not data.luminaires:
        notes.append(NO_LIGHT)
    if data.sky is not None and data.sky.relative:
        notes.append(
            "the sky has no level of its own: scaled to 10 000 lx diffuse horizontal (relative)"
        )
    if isinstance(data.sky, CIESky) and data.sky.estimated:
        notes.append(
            "the level of the sky is estimated from the sun's altitude: skies of this kind may be "
            "half or twice as bright"
        )
    if isinstance(data.sky, PerezSky) and data.sky.direct_normal_w_m2 > 0.0 and data.sun is None:
        notes.append(
            f"the sky is that of a sun of {data.sky.direct_normal_w_m2:g} W/m² direct normal, but "
            "the scene has no sun: its beam is left out"
        )
    if data.sun is not None and data.sun.altitude_deg <= 0.0:
        notes.append(f"the sun is below the horizon (altitude {data.sun.altitude_deg:g} degrees)")
    notes += _limb(data)
    if data.maintenance_factor != 1.0 and data.luminaires:
        notes.append(
            f"maintenance factor {data.maintenance_factor:g} on electric light, none on daylight"
        )
    return notes


def _limb(data: SceneData) -> list[str]:
    """What takes the sun for evenly bright though it is not to be."""
    if data.sun is None or not data.sun.limb_darkening:
        return []
    used = [data.materials[k] for k in np.unique(data.material_index) if k >= 0]
    where = ["the means over elements that the edge of a sun patch crosses"]
    if any(np.any(material.mirror_bands > 0.0) for material in used):
        where.append("mirrors")
    if any(np.any(material.specular_bands > 0.0) for material in used):
        where.append("the lobes of glossy surfaces")
    if (data.glass_index >= 0).any():
        where.append("what comes through panes")
    if data.cameras:
        where.append("pictures")
    return [f"limb darkening is left out of {listed(where)}"]


def _places(data: SceneData) -> list[str]:
    """Sensors below everything."""
    low, high = data.patches.bounds()
    slack = 1e-9 * float(np.linalg.norm(high - low))
    notes = []
    for sensors in data.sensors:
        below = int(np.sum(sensors.points[:, 2] < low[2] - slack))
        if below:
            notes.append(
                f"sensors {sensors.name}: {below} of {len(sensors)} are below the whole model, "
                f"whose lowest point is z = {low[2]:.3g} m"
            )
    return notes
