"""One face to patches: the cascade from exact to approximate, and its line of the certificate."""

from __future__ import annotations

import contextlib
import gc
import math
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model import bezier
from patchlight.solver.model.arrays import FloatArray, IntArray

from .area import face_area
from .cells import THIN, Cell, overlap, samples_of
from .curved_domain import curved_domain, turned_hole
from .domain import Domain
from .edge_gaps import Follow, Measure, followed, measured
from .exact_nets import planar_nets
from .extract import RawFace
from .lift import Lifted, Task, lifted
from .moments import vector_areas
from .planar_domain import enclosed_area, planar_domain
from .quadrangulate import STRICT, cells_of
from .rectangle import MANY_PATCHES, Rectangle, exact_spline, grid_cells, rectangle
from .strips import strips
from .surfaces import Plane, SplineSurface, Surface

#: Relative error below which a measured quantity counts as rounding.
ROUNDING = 1e-9
#: Largest relative error of the area of an approximated face, and of an exact one.
AREA_LIMIT = 1e-4
AREA_EXACT = 1e-6
#: Relative excess of area that tells cells which fold or overlap from the error of quadrature.
FOLD = 1e-7
#: Share of a curved face that cells may cover twice: too little to see in its area.
THIN_LOSS = 1e-6
MISSED = "the tolerance was not reached"
#: Patches of a face above which it is not made anew from sides cut in two: it would take seconds.
AGAIN = 1000


@dataclass(slots=True)
class FacePatches:
    """Patches of one face in file units, and the measurements of the certificate."""

    kind: str
    nets: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 4, 4)))
    edges: IntArray = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    exact: bool = False
    deviation: float = 0.0
    angle_deg: float = 0.0
    gap: float = 0.0
    area: float = 0.0
    area_error: float = float("nan")
    free_edge: float = 0.0
    left_out: int = 0
    reason: str = ""
    #: What the area is checked against, until it is.
    domain: Domain | None = None


#: What a face asks for until it is done.
Run = Generator[Any, Any, FacePatches]
#: Errors of one face that leave the others alone.
ERRORS = (GeometryError, np.linalg.LinAlgError, ArithmeticError, LookupError, ValueError)
#: Faces converted together: enough that the cost of a call to NumPy is shared.
TOGETHER = 200


def convert_faces(
    raws: Sequence[RawFace], tolerance: float, angle_deg: float, size: float
) -> list[FacePatches]:
    """Patches of the faces of a part; ``tolerance`` and ``size`` of the part in file units.

    Never raises for geometry: a face that cannot be converted has no patch and a reason.
    """
    out: list[FacePatches] = []
    for k in range(0, len(raws), TOGETHER):
        with _uncollected():
            out += _convert_together(raws[k : k + TOGETHER], tolerance, angle_deg, size)
    return out


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """No search for garbage in cycles: a face with many holes is of many objects, and of none."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _convert_together(
    raws: Sequence[RawFace], tolerance: float, angle_deg: float, size: float
) -> list[FacePatches]:
    out: dict[int, FacePatches] = {}
    runs = {i: _run(raw, tolerance, angle_deg, size) for i, raw in enumerate(raws)}
    answers: dict[int, Any] = dict.fromkeys(runs)
    while runs:
        asked: dict[int, Any] = {}
        for i, run in list(runs.items()):
            answer = answers[i]
            try:
                asked[i] = run.throw(answer) if isinstance(answer, Exception) else run.send(answer)
            except StopIteration as done:
                out[i] = done.value
                del runs[i]
        answers = {}
        for sort, answer_all in _ANSWERS.items():
            some = {i: x for i, x in asked.items() if isinstance(x, sort)}
            answers |= zip(some, _answered(answer_all, list(some.values())), strict=True)
    return [out[i] for i in range(len(raws))]


def _answered(answer_all: Callable, asked: list[Any]) -> list[Any]:
    """Answers to what faces ask for; an error belongs to the one face that causes it."""
    try:
        return [*answer_all(asked)] if asked else []
    except ERRORS as error:
        return (
            [error]
            if len(asked) == 1
            else [x for one in asked for x in _answered(answer_all, [one])]
        )


def _areas(nets: list[FloatArray]) -> list[FloatArray]:
    """Areas of the patches of some faces."""
    ends = np.cumsum([len(n) for n in nets])
    return np.split(bezier.areas(np.concatenate(nets)), ends[:-1])


def _planar_patches(some: list[list[Cell]]) -> list[tuple[FloatArray, FloatArray]]:
    """Patches of the cells of some planar faces, and their areas."""
    nets = planar_nets([cell for cells in some for cell in cells])
    ends = np.cumsum([len(cells) for cells in some])[:-1]
    return list(zip(np.split(nets, ends), np.split(bezier.areas(nets), ends), strict=True))


#: What faces ask for, and who answers all of them at once.
_ANSWERS: dict[type, Callable] = {
    Task: lifted, list: _planar_patches, np.ndarray: _areas, Measure: measured, Follow: followed
}  # fmt: skip


def _run(raw: RawFace, tolerance: float, angle_deg: float, size: float) -> Run:
    """One face."""
    if raw.surface is None:
        return FacePatches("other", reason=raw.reason)
    kind = raw.surface.kind
    try:
        if isinstance(raw.surface, Plane):
            out = yield from _planar(raw, raw.surface)
        else:
            out = yield from _curved(raw, raw.surface, tolerance, angle_deg, size)
    except (GeometryError, FloatingPointError, np.linalg.LinAlgError) as error:
        return FacePatches(kind, reason=str(error))
    except ERRORS as error:
        # Of ours, most likely: the other faces stay, and the certificate names it.
        return FacePatches(kind, reason=f"unexpected geometry ({type(error).__name__}: {error})")
    if raw.reversed and len(out.nets):
        out.nets = out.nets[:, ::-1]
        out.edges = out.edges[:, [0, 3, 2, 1]]
    out.nets = np.ascontiguousarray(out.nets)
    return out


def _drop_empty(
    nets: FloatArray, edges: IntArray, areas: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Without patches of no area (collapsed to a line or point), which carry no light."""
    if not np.isfinite(areas).all() or not (nets[..., 3] > 0.0).all():
        raise GeometryError("a patch is not finite or has a weight that is not positive")
    keep = areas > 1e-13 * areas.sum()
    return nets[keep], edges[keep], areas[keep]


def _relative(found: float, wanted: float) -> float:
    return abs(found - wanted) / wanted if wanted > 0.0 else float("nan")


def check_area(raw: RawFace, face: FacePatches) -> None:
    """Compare the area of the patches with an integral over surface and boundary alone."""
    domain, face.domain = face.domain, None
    if domain is None or not len(face.nets):
        return
    try:
        face.area_error = _relative(face.area, face_area(raw, domain))
    except GeometryError:  # the CAD kernel does not know its own surface: unchecked
        return
    if face.area_error > (AREA_EXACT if face.exact else AREA_LIMIT):
        face.exact = False
        face.reason = f"area off by {face.area_error:.1e}"


def _planar(raw: RawFace, surface: Plane) -> Run:
    domain = planar_domain(raw, surface)
    wanted = enclosed_area(domain)
    if wanted <= 1e-12 * domain.size**2:
        raise GeometryError("the boundary encloses no area")
    best: FacePatches | None = None
    lowest, reason = math.inf, ""
    for attempt in range(3):
        try:
            cells = _cells(domain, attempt, wanted)
        except GeometryError as error:
            reason = reason or str(error)
            continue
        nets, areas = yield cells
        edges = np.array([c.edges for c in cells])
        nets, edges, areas = _drop_empty(nets, edges, areas)
        area = float(areas.sum())
        out = FacePatches("plane", nets, edges, domain.exact, gap=domain.gap, area=area)
        # Cells that fold or overlap have more area than the boundary encloses.
        off = _relative(area, wanted)
        if off < lowest:
            best, lowest = out, off
        if off < FOLD:
            break
        reason = "cells overlap"
    if best is None or lowest > 1e-2:
        raise GeometryError(reason)
    best.domain = domain
    if not domain.exact:
        best.deviation = max(u.edge.tolerance for uses in raw.loops for u in uses)
        best.reason = "an edge is not a line, a conic or a spline of degree <= 3"
    elif lowest > AREA_EXACT:
        best.exact = False
        best.reason = reason
    elif domain.gap > ROUNDING * domain.size:
        best.deviation = domain.gap
    return best


def _folded(cells: list[Cell], whole: float) -> list[Cell]:
    """Planar cells whose area is larger than their vector area: somewhere they turn over.

    ``whole`` is the area of the face, of which many cells together may have `FOLD` too much.
    """
    # Straight sides bound bilinear patches, whose corners would tell.
    cells = [c for c in cells if any(a is not None and not a.straight for a in c.sides)]
    if not cells:
        return []
    nets = planar_nets(cells)
    excess = bezier.areas(nets) - np.linalg.norm(vector_areas(nets), axis=1)
    return [c for c, e in zip(cells, excess, strict=True) if e > 0.01 * FOLD * whole]


def _cells(domain: Domain, attempt: int, planar_area: float = 0.0, *, thin: float = THIN) -> list:
    """Cells of all regions; later attempts start from arcs cut in two.

    ``planar_area`` is the area of a planar face, 0 of others.
    """
    planar = planar_area > 0.0
    folded = partial(_folded, whole=planar_area) if planar else None
    cells = []
    for region in domain.regions:
        loops = region if planar else [region[0], *map(turned_hole, region[1:])]
        for _ in range(attempt):
            loops = [
                [part for a in loop for part in (a.halves() if not a.straight else (a,))]
                for loop in loops
            ]
        cells.extend(cells_of(loops, domain.chord, planar=planar, folded=folded, thin=thin))
    return cells


def _curved(raw: RawFace, surface: Surface, tolerance: float, angle_deg: float, size: float) -> Run:
    off = yield Measure(raw)
    domain = curved_domain(raw, surface)
    gap = float(off.max(initial=0.0))
    margin = min(1e-6 * domain.size, 0.1 * tolerance)
    box = rectangle(domain, margin)
    if gap > 0.02 * tolerance and (box is None or gap > tolerance):
        off = yield Follow(raw, off, 0.02 * tolerance)
        domain = curved_domain(raw, surface)
        gap = float(off.max(initial=0.0))
        box = rectangle(domain, margin)
    # The tolerance follows the part, but a small face must keep its own area and shape as well.
    fine = min(tolerance, 1e-3 * max(domain.size, 1e-300))
    job = _Job(surface, domain, fine, angle_deg, gap, size)
    if box is None:
        # Nearly a rectangle: taken as one when next to nothing of its area is lost.
        box = rectangle(domain, min(1e-4 * domain.size, 0.1 * tolerance), lost=1e-5)
    out = yield from _best(job, box)
    out.domain = domain
    return out


@dataclass(slots=True)
class _Job:
    """A curved face to be approximated; ``gap`` between its boundary and the edges."""

    surface: Surface
    domain: Domain
    tolerance: float
    angle_deg: float
    gap: float
    size: float


def _best(job: _Job, box: Rectangle | None) -> Run:
    surface = job.surface
    if box is not None and isinstance(surface, SplineSurface):
        found = exact_spline(surface, box)
        if found is not None:
            nets, edges, areas = _drop_empty(*found, (yield found[0]))
            out = FacePatches(surface.kind, nets, edges, True, gap=job.gap, area=float(areas.sum()))
            if len(nets) <= MANY_PATCHES:
                return out
            other = yield from _adaptive(job, box)
            return other if 2 * len(other.nets) < len(nets) and not _missed(other) else out
    out = yield from _adaptive(job, box)
    # Cells with a cusp have no normal there, and others fold between the samples that their shape
    # is judged by: their sides are worth cutting, or those of all.
    for thin, first in ((STRICT, 0), (THIN, 1), (STRICT, 1)):
        if box is not None or not _missed(out) or (first and len(out.nets) > AGAIN):
            break
        try:
            other = yield from _adaptive(job, box, thin=thin, first=first)
        except ERRORS:
            continue  # there are patches already
        if not _missed(other) or other.angle_deg < out.angle_deg:
            out = other
    return out


def _rank(result: Lifted) -> tuple[bool, bool, int]:
    """Order of results: area kept, tolerance reached, few patches."""
    return result.area_error > 0.5 * AREA_LIMIT, not result.converged, len(result.nets)


def _missed(face: FacePatches) -> bool:
    return face.reason == MISSED


def _adaptive(job: _Job, box: Rectangle | None, *, thin: float = THIN, first: int = 0) -> Run:
    surface, domain = job.surface, job.domain
    snap = max(10.0 * job.tolerance, 2.0 * job.gap)
    reason = ""
    cells: list[Cell] | None = None
    for attempt in range(first, first + 2):
        try:
            if box is not None:
                cells = grid_cells(surface, box, domain.scale)
                break
            cells = strips(_cells(domain, attempt, thin=thin), domain.chord)
        except GeometryError as error:
            reason = reason or str(error)
            continue
        lost = overlap(samples_of(cells))
        if lost <= THIN_LOSS:
            break
        reason, cells = f"cells overlap by {lost:.1e} of the face", None
    if cells is None:
        raise GeometryError(reason)
    task = Task(surface, cells, job.tolerance, job.angle_deg, snap)
    result = yield task
    if result.area_error > 0.5 * AREA_LIMIT:
        other = yield replace(task, area_limit=0.5 * AREA_LIMIT, eager=True)
        result = min(result, other, key=_rank)
    nets, edges, areas = _drop_empty(result.nets, result.edges, result.areas)
    exact = result.deviation <= ROUNDING * job.size and result.angle_deg < 1e-4
    exact = exact and result.gap <= 1e-7 * job.size
    out = FacePatches(
        surface.kind, nets, edges, exact, result.deviation, result.angle_deg,
        max(job.gap, result.gap), float(areas.sum()), left_out=result.left_out,
    )  # fmt: skip
    if not exact:
        out.reason = "trimmed curved surface" if box is None else "surface of higher degree"
        if not result.converged:
            out.reason = MISSED
    return out
