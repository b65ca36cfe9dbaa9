"""Panes of a scene: which patches are glass, how thick it is, and what its faces reflect."""

from __future__ import annotations

import dataclasses

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import BLACK, Glass, Glazing, Material, SceneData
from patchlight.solver.model.arrays import FloatArray


def with_glass(data: SceneData, glass: list[Glass | None]) -> SceneData:
    """``data`` with the ``glass`` of its faces (f,), patches that are seen through last.

    Faces of glass that bound no solid are lit from both sides. Their reflectance for diffuse light
    becomes a material like others.

    Raises
    ------
    InputError
        Where a solid is glass in part only, a pane has no thickness, or clear glass is a lamp.
    """
    if not any(glass):
        return data
    faces = data.patches.face_index
    of_patch = np.array([glass[face] is not None for face in faces])
    index = np.full(len(faces), -1)
    table: dict[Glazing, int] = {}
    for part in np.unique(data.patches.part_index[of_patch]):
        own = data.patches.part_index == part
        solid = data.parts[part].kind == "solid"
        if solid:
            _check_whole(data, int(part), {glass[face] for face in faces[own]})
        thickness = _own_thickness(data, own) if solid else None
        for row in np.flatnonzero(own & of_patch):
            found = glass[faces[row]]
            assert found is not None  # of_patch says so; for type checkers
            pane = _glazing(found, thickness, data.parts[part].path)
            index[row] = table.setdefault(pane, len(table))
    panes = tuple(table)
    loose = of_patch & ~np.array([pane.solid for pane in panes] + [False])[index]
    two_sided, closed = data.two_sided | loose, data.closed & ~loose
    material = np.array(data.material_index)
    material[of_patch] = (len(data.materials) + index[of_patch])[:, None]
    material[~two_sided, 1] = BLACK
    order = np.argsort([_clear(panes, k) for k in index], kind="stable")
    done = dataclasses.replace(
        data,
        patches=data.patches.take(order),
        two_sided=two_sided[order],
        closed=closed[order],
        material_index=material[order],
        luminaire_index=data.luminaire_index[order],
        materials=data.materials + tuple(_faces_of(pane) for pane in panes),
        glazings=panes,
        glass_index=index[order],
    )
    _check_no_lamps(done)
    return done


def _clear(panes: tuple[Glazing, ...], index: int) -> bool:
    return bool(index >= 0 and panes[index].glass.diffuse < 1.0)


def _faces_of(pane: Glazing) -> Material:
    """What the faces of a pane throw back of diffuse light."""
    from patchlight.solver.glass import GlassLaw

    return Material(GlassLaw.of(pane).diffuse_reflectance, name=pane.name)


def _glazing(glass: Glass, own_thickness: float | None, path: str) -> Glazing:
    solid = own_thickness is not None
    thickness = own_thickness if glass.thickness_m is None else glass.thickness_m
    if thickness is None and glass.needs_thickness:
        raise InputError(
            f"glass of {path}: a sheet has no thickness of its own; give thickness_m or "
            "transmittance"
        )
    return Glazing(glass, thickness if glass.needs_thickness and thickness else 0.0, solid)


def _own_thickness(data: SceneData, rows: FloatArray) -> float:
    from patchlight.solver.panes import slab_thickness

    return slab_thickness(data.patches.take(np.flatnonzero(rows)))


def _check_whole(data: SceneData, part: int, found: set[Glass | None]) -> None:
    if len(found) > 1:
        what = "in part only" if None in found else "of several kinds"
        raise InputError(
            f"glass of {data.parts[part].path}: a solid is a pane as a whole, but this one is "
            f"glass {what}; assign one Glass to all of its faces"
        )


def _check_no_lamps(data: SceneData) -> None:
    shining = np.flatnonzero(data.see_through & (data.luminaire_index >= 0).any(axis=1))
    if len(shining):
        path = data.parts[data.patches.part_index[shining[0]]].path
        raise InputError(
            f"{path}: is both an emitter and glass that is seen through; a shining panel is an "
            "emitter, or glass with diffuse = 1"
        )
