"""Bodies converted to the rows of a Model: each distinct shape once, then placed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.ShapeFix import ShapeFix_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape
from patchlight.solver.errors import GeometryError
from patchlight.solver.model import CadEdges, Certificate, Face, Model, Part, PatchSet

from . import kept_parts, moments
from .convert import AREA_LIMIT, MISSED, FacePatches, check_area, convert_faces
from .edge_kinds import EdgeFacts, edge_facts
from .extract import Extractor, faces_of
from .occurrences import Body, Looks
from .orientation import Senses, flips
from .plausible import size_warnings

#: Share of a part's tolerance that the chains of its edges may take, and the share where that costs
#: small faces more of their area than `AREA_LIMIT`.
EDGE_SHARE = 0.1
FINE_EDGES = 0.02
#: Boundary loops of a face above which the CAD kernel does not check a shape that was converted
#: without fault: it compares each loop with each other one, 5 s for a thousand.
MOST_LOOPS = 300


@dataclass(frozen=True, slots=True)
class Options:
    """How to convert: tolerance relative to the size of a part, angle of normals, repair, area
    check, and whether the cache may be used."""

    tolerance: float
    angle_deg: float
    heal: bool = True
    check_areas: bool = True
    cache: bool = False


@dataclass(slots=True)
class Converted:
    """A distinct shape as patches in file units; ``seconds`` are those of the conversion.

    ``area_seconds`` are those of the checks: of areas, and by the CAD kernel where nothing follows
    from it. ``loops`` is the largest number of boundary loops of a face.
    """

    faces: list[FacePatches]
    shapes: list[Any]
    edges: EdgeFacts
    size: float
    kind: str
    loops: int = 0
    seconds: float = 0.0
    area_seconds: float = 0.0
    notes: list[str] = field(default_factory=list)
    cached: bool = False


def diagonal(shape: Any) -> float:
    """Diagonal of the bounding box of a shape. [file units]"""
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    if box.IsVoid():
        return 0.0
    x0, y0, z0, x1, y1, z1 = box.Get()
    return float(np.linalg.norm([x1 - x0, y1 - y0, z1 - z0]))


def converted(shape: Any, kind: str, options: Options) -> Converted:
    """Patches of one solid or sheet, from the cache where it has them."""
    key = kept_parts.key(shape, kind, options) if options.cache else ""
    found = kept_parts.get(key) if options.cache else None
    if found is not None:
        return Converted(shapes=faces_of(shape), cached=True, **found)
    start = time.perf_counter()
    out = convert_shape(shape, kind, options)
    out.seconds = time.perf_counter() - start - out.area_seconds
    if options.cache and out.seconds > kept_parts.WORTH_S:
        kept_parts.put(key, out)
    return out


def convert_shape(shape: Any, kind: str, options: Options) -> Converted:
    """Patches of one solid or sheet.

    A solid whose patches enclose a negative volume is turned inside out; one that is not closed
    keeps its orientation and is noted. Where faces are off in area it is converted once more, with
    edges of a finer tolerance. What the CAD kernel calls invalid often converts as it is,
    and what it calls valid often does not: a shape is repaired if that makes more faces right, or
    if nobody else looks at them.
    """
    out, senses = _convert(shape, kind, options)
    if any(f.area_error > AREA_LIMIT for f in out.faces):
        finer, finer_senses = _convert(shape, kind, options, edges=FINE_EDGES)
        checking = out.area_seconds + finer.area_seconds
        if _wrong(finer) < _wrong(out):
            out, senses = finer, finer_senses
        out.area_seconds = checking
    bad = any(map(_bad, out.faces))
    sound = options.check_areas and not bad
    if out.loops > MOST_LOOPS and sound:
        invalid = False
        note = f"a face has {out.loops} boundary loops: the CAD kernel's own check was left out"
    else:
        start = time.perf_counter()
        invalid = not BRepCheck_Analyzer(shape).IsValid()
        if sound:  # a note is all that comes of it
            out.area_seconds += time.perf_counter() - start
        note = "invalid by the CAD kernel's own check, converted as it is" if invalid else ""
    if options.heal and (bad or (invalid and not options.check_areas)):
        fixer = ShapeFix_Shape(shape)
        fixer.Perform()
        again, repaired_senses = _convert(fixer.Shape(), kind, options)
        before, after = sum(map(_bad, out.faces)), sum(map(_bad, again.faces))
        valid = invalid and BRepCheck_Analyzer(fixer.Shape()).IsValid()
        if len(again.faces) == len(out.faces) and after < before + valid:
            why = f"{before - after} more faces converted" if after < before else "it was invalid"
            note = f"shape repaired by the CAD kernel: {why}"
            # Names, colours and `cad_face` know the faces as they came.
            again.shapes, out, senses = out.shapes, again, repaired_senses
        elif before:
            note = "repair by the CAD kernel makes no more faces right"
    if note:
        out.notes.append(note)
    if out.kind == "solid":
        _orient(out, senses)
    return out


def _bad(face: FacePatches) -> bool:
    return not len(face.nets) or face.area_error > AREA_LIMIT


def _wrong(part: Converted) -> int:
    """How many faces are missing, off in area, or not within the tolerance."""
    return sum(_bad(f) or f.reason == MISSED for f in part.faces)


def _convert(
    shape: Any, kind: str, options: Options, *, edges: float = EDGE_SHARE
) -> tuple[Converted, list[Senses]]:
    size = diagonal(shape)
    tolerance = options.tolerance * size
    extractor = Extractor(shape, edges * tolerance)
    shapes = faces_of(shape)
    with np.errstate(all="ignore"):
        raws = [extractor.face(item) for item in shapes]
        faces = convert_faces(raws, tolerance, options.angle_deg, size)
        start = time.perf_counter()
        if options.check_areas:
            for raw, face in zip(raws, faces, strict=True):
                check_area(raw, face)
        spent = time.perf_counter() - start if options.check_areas else 0.0
        facts, free_lengths = edge_facts(raws, extractor.count, tolerance, options.angle_deg)
    for face, free in zip(faces, free_lengths, strict=True):
        face.domain, face.free_edge = None, free
    senses = [
        [(u.edge.index, u.reversed ^ raw.reversed) for uses in raw.loops for u in uses]
        for raw in raws
    ]
    loops = max((len(raw.loops) for raw in raws), default=0)
    part = Converted(faces, shapes, facts, size, kind, loops, area_seconds=spent)
    return part, senses


def _orient(out: Converted, senses: list[Senses]) -> None:
    nets = [f.nets for f in out.faces if len(f.nets)]
    if not nets:
        return
    turned, orientable = flips(senses)
    if not orientable:
        out.kind = "sheet"
        out.notes.append("the shell cannot be oriented: taken as a sheet, active on both sides")
        return
    if any(turned):
        for f, turn in zip(out.faces, turned, strict=True):
            if turn:
                _turn(f)
        out.notes.append(f"the shell was inconsistent: {sum(turned)} faces turned over")
        nets = [f.nets for f in out.faces if len(f.nets)]
    every = np.concatenate(nets)
    # Four points a direction are 1e-6 on quarters of a turn: signs are asked for, and a thousandth.
    volume, vector, area = moments.volume_and_vector(every, order=4)
    # Free edges, and faces that are missing, are named by themselves.
    complete = len(nets) == len(out.faces) and not any(f.free_edge for f in out.faces)
    if complete and np.linalg.norm(vector) > 1e-3 * area:
        out.notes.append("the solid is not closed: its faces do not enclose a volume")
    if volume < 0.0:
        for f in out.faces:
            _turn(f)
        out.notes.append("the solid was inside out and has been reversed")


def _turn(face: FacePatches) -> None:
    """Reverse the +normal of a face."""
    face.nets = np.ascontiguousarray(face.nets[:, ::-1])
    face.edges = face.edges[:, [0, 3, 2, 1]]


def assemble(
    bodies: list[Body],
    *,
    name: str,
    metres: float,
    options: Options,
    source: str,
    sha256: str,
    unit: str,
    started: float,
    read: float,
    notes: Sequence[str] = (),
) -> tuple[Model, list[list[Any]]]:
    """Model of the bodies, and the CAD faces of each part (without placement).

    ``started`` and ``read`` are the clock's seconds before and after reading, ``notes`` what the
    certificate tells of the file.

    Raises
    ------
    GeometryError
        If there is no face, no face could be converted, or a part is placed nowhere.
    """
    keys = TopTools_IndexedMapOfShape()
    done: dict[int, tuple[Converted, int]] = {}
    parts: list[Part] = []
    faces: list[Face] = []
    sets: list[PatchSet] = []
    notes = list(notes)
    shapes: list[list[Any]] = []
    edges: list[EdgeFacts] = []
    edge_base, area_seconds = 0, 0.0
    for row, body in enumerate(bodies):
        key = keys.Add(body.shape)
        if key not in done:
            found = converted(body.shape, body.kind, options)
            area_seconds += 0.0 if found.cached else found.area_seconds
            done[key] = (found, row)
            notes += [f"{body.path}: {note}" for note in found.notes]
        found, first = done[key]
        placement = body.placement.copy()
        if not np.isfinite(placement).all():
            raise GeometryError(f"{body.path}: its placement holds a number that is not finite")
        placement[:3, 3] *= metres
        linear = np.linalg.svd(placement[:3, :3], compute_uv=False)
        inner = _inner_looks(body, found.shapes)
        scaled = np.array([metres, metres, metres, 1.0])
        area_factor = metres**2 * float(linear[0] * linear[1])
        moved = placement @ np.diag(scaled)
        edges.append(found.edges.of_faces_from(len(faces)))
        count = [len(face.nets) for face in found.faces]
        if any(count):
            sides = np.concatenate([face.edges for face in found.faces])
            own = PatchSet(
                np.concatenate([face.nets for face in found.faces]),
                np.repeat(len(faces) + np.arange(len(count)), count),
                np.full(len(sides), row),
                np.where(sides >= 0, sides + edge_base, -1),
            )
            sets.append(own.moved(moved))
        length = metres * float(linear[0])
        for number, (face, looks) in enumerate(zip(found.faces, inner, strict=True), 1):
            faces.append(
                Face(
                    part=row, number=number, kind=face.kind, exact=face.exact,
                    patches=len(face.nets), deviation_m=face.deviation * length,
                    angle_deg=face.angle_deg, area_m2=face.area * area_factor,
                    area_error=face.area_error, gap_m=face.gap * length,
                    free_edge_m=face.free_edge * length, normals_left_out=face.left_out,
                    reason=face.reason, name=looks.name, color=looks.color,
                )
            )  # fmt: skip
        edge_base += len(found.edges.kind)
        shapes.append(found.shapes)
        parts.append(
            Part(
                body.path, found.kind, body.looks.color, body.looks.layer,
                body.looks.material, placement, first,
            )
        )  # fmt: skip
    if not faces:
        raise GeometryError("no faces: the file holds no solid, shell or face")
    if not sets:
        reason = next((f.reason for f in faces if f.reason), "unknown")
        raise GeometryError(f"none of the {len(faces)} faces could be converted: {reason}")
    distinct = [found for found, _ in done.values()]
    if cached := [found for found in distinct if found.cached]:
        notes.append(
            f"{len(cached)} of {len(distinct)} distinct parts taken from the cache: "
            f"{sum(found.seconds for found in cached):.3g} s to convert at first"
        )
    patches = PatchSet.concatenated(*sets)
    warnings = size_warnings(name, parts, patches, from_file=source != "cadquery")
    warnings += _failures(parts, faces) + _open(parts, faces)
    every = CadEdges(
        np.concatenate([e.kind for e in edges]),
        np.repeat(np.arange(len(edges)), [len(e.kind) for e in edges]),
        np.concatenate([e.faces for e in edges]),
        np.concatenate([e.angle_deg for e in edges]),
    )
    certificate = Certificate(
        tuple(faces), tuple(p.path for p in parts),
        time.perf_counter() - started - area_seconds, tuple(notes), read - started, area_seconds,
        every.counts(len(parts)),
    )  # fmt: skip
    model = Model(
        name, tuple(parts), tuple(faces), patches, certificate, source, sha256, unit,
        tuple(warnings), every,
    )  # fmt: skip
    return model, shapes


def _inner_looks(body: Body, shapes: list[Any]) -> list[Looks]:
    """Name and colour of each face, where the file gives them to faces."""
    out = [Looks() for _ in shapes]
    if not body.inner:
        return out
    index = TopTools_IndexedMapOfShape()
    for s in shapes:
        index.Add(s)
    for shape, looks in body.inner:
        k = index.FindIndex(shape)
        if k:
            out[k - 1] = looks
    return out


def _open(parts: list[Part], faces: list[Face]) -> list[str]:
    """One line for each solid with edges at which nothing goes on."""
    out = []
    for row, part in enumerate(parts):
        own = [f for f in faces if f.part == row and f.free_edge_m > 0.0]
        if part.kind == "solid" and own:
            out.append(
                f"{part.path} is no closed solid: {len(own)} of its faces have free edges, "
                f"{sum(f.free_edge_m for f in own):.3g} m in all, the first #{own[0].number} "
                f"({own[0].kind}, {own[0].free_edge_m:.3g} m)"
            )
    return out


def _failures(parts: list[Part], faces: list[Face]) -> list[str]:
    failed = [f for f in faces if f.failed]
    if not failed:
        return []
    f = failed[0]
    return [
        f"{len(failed)} of {len(faces)} faces could not be converted; the first is "
        f"{parts[f.part].path} #{f.number} ({f.kind}): {f.reason}"
    ]
