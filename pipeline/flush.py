"""Flat faces that lie on each other all but for rounding: brought into one plane.

A sheet on a housing, a panel flush in a ceiling: in one plane each place shows the light of one of
them. Drawn apart by no more than the rounding of a file, there would be a gap between them that no
quadrature resolves, and the light of both would count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import CONTACT, PatchSet, ScenePart
from patchlight.solver.model.arrays import FloatArray, IntArray

from .coincident import SAME

#: What tells planes apart when they are sorted; no drawing has these ratios.
_WEIGHTS = np.sqrt([2.0, 3.0, 5.0, 7.0])
#: Control points around a patch, and pairs of patches compared at a time.
_AROUND = np.array([0, 4, 8, 12, 13, 14, 15, 11, 7, 3, 2, 1])
_BLOCK = 1000
#: Patches overlap from ten times the slack on, or this share of the width of the narrower one: a
#: strip may be narrower than the slack, patches side by side overlap by rounding.
_OVER = 10.0
_NARROW = 0.5
#: Unit normals of planes that may be one differ by less; what counts is how far points are off.
_PARALLEL = 1e-4


@dataclass(slots=True)
class _Flat:
    """A flat face: rows of its patches, their points (n, 16, 3), box, unit normal and offset."""

    rows: IntArray
    points: FloatArray
    low: FloatArray
    high: FloatArray
    normal: FloatArray
    offset: float
    part: int

    def off(self, other: _Flat) -> float:
        """Largest distance of its points from the plane of another one. [m]"""
        return float(np.abs(self.points @ other.normal - other.offset).max())


def with_flush_faces(
    patches: PatchSet, parts: tuple[ScenePart, ...]
) -> tuple[PatchSet, tuple[str, ...]]:
    """Patches with flat faces in one plane where they lie on other parts' but for rounding.

    Sheets move onto solids, smaller faces onto larger ones, by `SAME` of the scene's size at most.

    Returns
    -------
    PatchSet, tuple of str
        The patches, and a note on faces that are a little farther apart and overlap.
    """
    points = (patches.control_points[..., :3] / patches.control_points[..., 3:]).reshape(-1, 16, 3)
    size = float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0)))
    faces = _flat_faces(patches, points, size)
    moved: dict[int, tuple[FloatArray, float]] = {}
    apart: list[tuple[float, int, int]] = []
    closed = [part.kind != "sheet" for part in parts]
    # Solids first, then by area of the box: what lies on others comes after them.
    faces.sort(key=lambda f: (not closed[f.part], -float(np.linalg.norm(f.high - f.low))))
    for a, b in _pairs(faces, CONTACT * size):
        on, face = faces[a], faces[b]
        alike = not closed[face.part] or float(on.normal @ face.normal) > 0.0
        distance = max(face.off(on), on.off(face))
        if not alike or distance == 0.0 or distance > CONTACT * size:
            continue
        if not _overlap(on, face, CONTACT * size):
            continue
        if distance <= SAME * size:
            moved.setdefault(b, moved.get(a, (on.normal, on.offset)))
        else:
            apart.append((distance, on.part, face.part))
    if moved:
        cp = np.array(patches.control_points)
        for b, (normal, offset) in moved.items():
            x = faces[b].points
            x = x - (x @ normal - offset)[..., None] * normal
            rows = faces[b].rows
            cp[rows, ..., :3] = x.reshape(-1, 4, 4, 3) * cp[rows, ..., 3:]
        patches = PatchSet(cp, patches.face_index, patches.part_index, patches.edge_index)
    return patches, _note(apart, parts, size)


def _note(
    apart: list[tuple[float, int, int]], parts: tuple[ScenePart, ...], size: float
) -> tuple[str, ...]:
    if not apart:
        return ()
    distance, on, face = min(apart)
    more = f" ({len(apart)} pairs of faces in all)" if len(apart) > 1 else ""
    return (
        f"{parts[face].path} lies {distance:.2g} m off a face of {parts[on].path}, too near for "
        f"light between them: draw it on that face or at least {CONTACT * size:.2g} m away{more}",
    )


def _flat_faces(patches: PatchSet, points: FloatArray, size: float) -> list[_Flat]:
    """Faces that are flat to rounding, which grows with the distance from the origin."""
    rounding = 1e-12 * max(size, float(np.abs(points).max(initial=0.0)))
    first, second = points[:, 15] - points[:, 0], points[:, 3] - points[:, 12]
    normals = np.cross(first, second)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    away = np.einsum("nik,nk->ni", points - points[:, :1], normals)
    flat = (length[:, 0] > 0.0) & (np.abs(away).max(axis=1) <= rounding)
    order = np.argsort(patches.face_index, kind="stable")
    _, starts = np.unique(patches.face_index[order], return_index=True)
    all_flat = np.logical_and.reduceat(flat[order], starts)
    out = []
    for rows in [r for r, ok in zip(np.split(order, starts[1:]), all_flat, strict=True) if ok]:
        own = points[rows]
        n = normals[rows[np.argmax(length[rows, 0])]]
        offset = float((own.reshape(-1, 3) @ n).mean())
        if np.abs(own @ n - offset).max() <= rounding:
            low, high = own.min(axis=(0, 1)), own.max(axis=(0, 1))
            out.append(_Flat(rows, own, low, high, n, offset, int(patches.part_index[rows[0]])))
    return out


def _pairs(faces: list[_Flat], slack: float) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of faces of different parts whose planes and boxes are near."""
    if len(faces) < 2:
        return []
    n = len(faces)
    plane = np.array([[*f.normal, f.offset] for f in faces])
    extent = max(float(np.abs(f.points).max()) for f in faces)
    low, high = np.array([f.low for f in faces]), np.array([f.high for f in faces])
    part = np.array([f.part for f in faces])
    # A plane is the same whichever way its normal looks.
    both = np.concatenate([plane, -plane])
    reach = (_PARALLEL * np.array([1.0, 1.0, 1.0, extent])) @ _WEIGHTS + slack * _WEIGHTS[3]
    key = both @ _WEIGHTS
    order = np.argsort(key, kind="stable")
    first = np.searchsorted(key[order], key[:n] - reach)
    last = np.searchsorted(key[order], key[:n] + reach, side="right")
    out = []
    for i in np.flatnonzero(last - first > 1).tolist():
        j = np.unique(order[first[i] : last[i]] % n)
        j = j[(j > i) & (part[j] != part[i])]
        near = (low[j] <= high[i] + slack).all(axis=1) & (high[j] >= low[i] - slack).all(axis=1)
        near &= np.abs(plane[j, :3] @ plane[i, :3]) > 1.0 - _PARALLEL
        out += [(i, k) for k in j[near].tolist()]
    return out


def _overlap(a: _Flat, b: _Flat, slack: float) -> bool:
    """Whether patches of two faces overlap by more than ``slack`` within the plane."""
    x = np.cross(a.normal, np.eye(3)[int(np.argmin(np.abs(a.normal)))])
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross(a.normal, x)], axis=1)
    own, other = a.points @ frame, b.points @ frame
    over = _over(own[:, None], other[None], _OVER * slack)
    i, j = np.nonzero(over.all(axis=2))
    return any(
        bool(_not_apart(own[i[k : k + _BLOCK]], other[j[k : k + _BLOCK]], _OVER * slack).any())
        for k in range(0, len(i), _BLOCK)
    )


def _over(a: FloatArray, b: FloatArray, least: float) -> NDArray[np.bool_]:
    """Where the ranges of points a and b (..., 16, axes) overlap on an axis: (..., axes).

    They do by more than ``least``, or `_NARROW` of the narrower range.
    """
    low, high = (a.min(axis=-2), b.min(axis=-2)), (a.max(axis=-2), b.max(axis=-2))
    width = np.minimum(high[0] - low[0], high[1] - low[1])
    common = np.minimum(*high) - np.maximum(*low)
    return np.asarray(common > np.minimum(least, _NARROW * width))


def _not_apart(a: FloatArray, b: FloatArray, least: float) -> NDArray[np.bool_]:
    """Pairs of flat patches (n, 16, 2) that no line parts, but for an overlap of ``least``.

    A line that parts two convex sets can be turned until it lies along a side of one of them; the
    sides are those of the control polygon around each patch.
    """
    steps = np.concatenate([np.roll(p[:, _AROUND], -1, axis=1) - p[:, _AROUND] for p in (a, b)], 1)
    across = np.stack([-steps[..., 1], steps[..., 0]], axis=2)
    length = np.linalg.norm(across, axis=2, keepdims=True)
    across = across / np.where(length > 0.0, length, 1.0)
    p, q = a @ across.swapaxes(1, 2), b @ across.swapaxes(1, 2)
    return np.asarray((_over(p, q, least) | (length[..., 0] == 0.0)).all(axis=1))
