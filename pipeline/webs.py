"""Photometric webs of emitters: their files, how they are turned, and what to tell of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import Emitter, Photometry, SceneData, Web
from patchlight.solver.model.arrays import FloatArray

from .frames import part_placements, transformed_normals
from .problems import Problems
from .slots import Slots

if TYPE_CHECKING:
    from .scene import Scene

#: Share of a web's flux in directions to which its emitting faces show no area: told from the
#: first on, an error from the second.
TELL, REFUSE = 1e-3, 0.1
#: Sine below which the part's own +x is too near to the aim to tell C0.
_ALONG = 0.02


Known = dict[tuple[Path, int, int], Photometry]


def with_web(emitter: Emitter, known: Known) -> Emitter:
    """The emitter with its photometric file read; what is ``known`` is not read again.

    Files are known by path, time and size, so that one that was written anew is.

    Raises
    ------
    MissingFileError, InputError
        As `read_photometry`.
    """
    if emitter.photometry is None or isinstance(emitter.photometry, Photometry):
        return emitter
    from patchlight.importers import read_photometry

    path = Path(emitter.photometry)
    try:
        stat = path.stat()
    except OSError:
        return replace(emitter, photometry=read_photometry(path))  # which says what is wrong
    key = path, stat.st_mtime_ns, stat.st_size
    if key not in known:
        known[key] = read_photometry(path)
    return replace(emitter, photometry=known[key])


class Webs:
    """The webs of one scene."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._placements = part_placements(scene)

    def web(self, part_row: int, path: str, emitter: Emitter) -> Web | None:
        """The web of a lamp in world axes, or None for a Lambertian one."""
        if not isinstance(emitter.photometry, Photometry):
            return None  # none at all: files were read by `with_web`
        x, _, z = _own_axes(self._placements[part_row])
        aim = -z if emitter.aim is None else np.asarray(emitter.aim)
        c0 = emitter.c0
        if c0 is None:
            # Where the lamp is aimed along its own x, its z serves: +z for +x, as when it is turned
            # about its y.
            along = float(x @ aim)
            c0 = x if np.sqrt(max(0.0, 1.0 - along**2)) > _ALONG else np.sign(along) * z
        try:
            turned = transformed_normals(self.scene.north, np.stack([aim, np.asarray(c0)]))
            return Web.aimed(emitter.photometry, turned[0], turned[1])
        except InputError as error:
            raise InputError(f"emitter of {path}: {error}") from None


def _own_axes(placement: FloatArray) -> FloatArray:
    """Directions (3, 3) of the part's x, y and z in the scene."""
    axes = np.asarray(placement)[:3, :3].T
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


def web_doubts(data: SceneData, slots: Slots, problems: Problems) -> list[str]:
    """What a user should know of lamps with webs; those that cannot be are added to ``problems``.

    Equal lamps are told of once.
    """
    from patchlight.solver.web_shape import WebShape

    if len(data.luminaires) != len(slots.lamps):
        return []  # some lamp is wrong already
    notes: dict[str, list[str]] = {}
    for row, lamp in enumerate(data.luminaires):
        if lamp.web is None:
            continue
        patches, sides = np.nonzero(data.luminaire_index == row)
        shape = WebShape.of(data.patches.take(patches), sides == 1)
        photometry = lamp.web.photometry
        name = Path(photometry.source).name or photometry.name or "its photometric web"
        lost = 1.0 - shape.seen_share(lamp.web)
        if lost > REFUSE:
            problems.add(
                [
                    f"emitter of {lamp.part}: {100.0 * lost:.3g} % of the light of {name} goes "
                    "where its emitting faces show no area, at most "
                    f"{100.0 * REFUSE:g} % may: let more faces emit, or turn it by aim and c0"
                ]
            )
            continue
        told = list(photometry.remarks)
        if lost > TELL:
            told.append(
                f"{100.0 * lost:.2g} % of its light goes where the emitting faces show no area, "
                "and was given to the other directions"
            )
        for text in told:
            notes.setdefault(f"{name}: {text}", []).append(lamp.part)
    return [f"photometry {text} ({_listed(parts)})" for text, parts in notes.items()]


def _listed(parts: list[str]) -> str:
    more = f" and {len(parts) - 1} more" if len(parts) > 1 else ""
    return f"{parts[0]}{more}"
