"""An imported CAD model: parts, faces, exact patches, and the certificate of the conversion."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from .arrays import FloatArray, IntArray, check_shape, frozen
from .patches import PatchSet
from .reprs import model_repr

#: What the edges of a part can be, as `CadEdges.kind` counts them.
EDGE_KINDS = ("unknown", "smooth", "sharp", "free", "non-manifold", "degenerate")


@dataclass(frozen=True, slots=True)
class Part:
    """A solid, an open shell or a loose face of the model.

    Attributes
    ----------
    path : str
        Below the file's root, segments joined by ``/``; repeated siblings end in ``:1 :2``.
    kind : {"solid", "sheet"}
        Solids are active outside only; sheets (open shells, loose faces) on both sides.
    color : (r, g, b), optional
        Linear sRGB of the CAD file, for pictures.
    placement : (4, 4) array
        From part coordinates to the model. [m]
    instance_of : int
        Row of the first part with the same geometry (its own row when it is the first).
    """

    path: str
    kind: str
    color: tuple[float, float, float] | None = None
    layer: str | None = None
    material: str | None = None
    placement: FloatArray = field(default_factory=lambda: np.eye(4))
    instance_of: int = -1

    def __post_init__(self) -> None:
        object.__setattr__(self, "placement", frozen(self.placement))

    @property
    def name(self) -> str:
        """Last segment of the path."""
        return self.path.rsplit("/", 1)[-1]


@dataclass(frozen=True, slots=True)
class Face:
    """A B-rep face, one row of the certificate.

    Attributes
    ----------
    part : int
        Row of the part.
    number : int
        Counts from 1 within the part, as ``inspect`` prints it.
    kind : str
        plane, cylinder, cone, sphere, torus, bspline, bezier, revolution, extrusion, offset, other.
    exact : bool
        Whether the patches represent the trimmed face exactly (to rounding).
    patches : int
        Number of patches; 0 when the face failed.
    deviation_m, angle_deg : float
        Largest distance [m] and normal deviation [deg] measured at check points; normals do not
        count where the surface itself turns by 0.5 rad within the tolerance (folds, cusps), nor
        next to cusps of a patch, where it has no area.
    area_m2, area_error : float
        Area of the patches [m²] and its relative difference to an independent integral
        (NaN when not checked).
    gap_m : float
        Largest distance between the patch boundaries and the 3-D edge curves. [m]
    free_edge_m : float
        Length of the edges at which no other face of the part begins. [m]
    normals_left_out : int
        Check points, 49 a patch, at which the normal is off by more than was asked for and does
        not count in ``angle_deg``.
    reason : str
        Why the face failed or is approximated; empty otherwise.
    """

    part: int
    number: int
    kind: str
    exact: bool
    patches: int
    deviation_m: float
    angle_deg: float
    area_m2: float
    area_error: float = float("nan")
    gap_m: float = 0.0
    free_edge_m: float = 0.0
    normals_left_out: int = 0
    reason: str = ""
    name: str | None = None
    color: tuple[float, float, float] | None = None

    @property
    def failed(self) -> bool:
        """Whether no patch represents the face."""
        return self.patches == 0


@dataclass(frozen=True, slots=True, eq=False)
class CadEdges:
    """B-rep edges of a model; row e of every array is what `PatchSet.edge_index` calls e.

    Attributes
    ----------
    kind : (e,) int array
        Place in `EDGE_KINDS`. An edge is *smooth* where its two faces have the same normal all
        along it, within the ``angle_deg`` of the conversion (patches may be off by as much), else
        *sharp*; a seam lies between a face and itself. It is *free* where no other face of the part
        begins, on any stretch of it; *non-manifold* where more than two sides of faces meet;
        *degenerate* where it is one point, a pole or an apex; *unknown* where a normal could not be
        found or the file has no curve of it.
    part : (e,) int array
        Row of the part.
    faces : (e, 2) int array
        Rows of `Model.faces` that meet there, −1 for none. Of more than two they are the first two;
        of an edge that one face has alone, they are this one and the first of those whose edges lie
        along it.
    angle_deg : (e,) array
        Largest angle between the normals of the two faces along the edge, 180 where they fold back
        onto each other; NaN where there are not just two. [deg]
    """

    kind: IntArray
    part: IntArray
    faces: IntArray
    angle_deg: FloatArray

    def __post_init__(self) -> None:
        n = len(np.asarray(self.kind))
        for name, dtype, shape in (
            ("kind", np.int64, (n,)), ("part", np.int64, (n,)), ("faces", np.int64, (n, 2)),
            ("angle_deg", np.float64, (n,)),
        ):  # fmt: skip
            array = frozen(getattr(self, name), dtype)
            check_shape(f"CadEdges.{name}", array, shape)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.kind)

    @classmethod
    def none(cls) -> CadEdges:
        """No edge: of models that were made of patches."""
        no = np.zeros(0, dtype=np.int64)
        return cls(no, no, no.reshape(0, 2), np.zeros(0))

    def rows(self, kind: str, *, part: int | None = None) -> IntArray:
        """Rows of the edges of a kind, of one part alone when it is given.

        Raises
        ------
        InputError
            If there is no such kind.
        """
        if kind not in EDGE_KINDS:
            raise InputError(f"kind = {kind!r}: one of {', '.join(EDGE_KINDS)}")
        found = self.kind == EDGE_KINDS.index(kind)
        return np.flatnonzero(found if part is None else found & (self.part == part))

    def counts(self, parts: int) -> tuple[dict[str, int], ...]:
        """How many edges of each kind each of the ``parts`` has; kinds without any left out."""
        table = np.zeros((parts, len(EDGE_KINDS)), dtype=np.int64)
        np.add.at(table, (self.part, self.kind), 1)
        return tuple(
            {kind: n for kind, n in zip(EDGE_KINDS, row, strict=True) if n}
            for row in table.tolist()
        )


@dataclass(frozen=True, slots=True)
class Certificate:
    """What the conversion did to each face, and how long it took.

    Attributes
    ----------
    faces : tuple of Face
        One row a face.
    part_paths : tuple of str
        Paths of the parts that ``Face.part`` counts.
    seconds : float
        Reading and conversion, without the checks. [s]
    notes : tuple of str
        What was repaired or turned, one line each.
    reading_seconds, area_seconds : float
        The share of the CAD kernel's reading in ``seconds``, and the checks: of areas, and by the
        CAD kernel of shapes whose faces are all right, of which it makes no more than a note. [s]
    part_edges : tuple of dict
        By part: how many of its B-rep edges are of each of `EDGE_KINDS`, as `CadEdges` says.
    """

    faces: tuple[Face, ...]
    part_paths: tuple[str, ...]
    seconds: float = 0.0
    notes: tuple[str, ...] = ()
    reading_seconds: float = 0.0
    area_seconds: float = 0.0
    part_edges: tuple[dict[str, int], ...] = ()

    @property
    def faces_total(self) -> int:
        """Number of B-rep faces in the file."""
        return len(self.faces)

    @property
    def faces_exact(self) -> int:
        """Faces represented exactly."""
        return sum(f.exact and not f.failed for f in self.faces)

    @property
    def faces_approximated(self) -> int:
        """Faces represented within the tolerance."""
        return sum(not f.exact and not f.failed for f in self.faces)

    @property
    def failures(self) -> tuple[Face, ...]:
        """Faces without any patch."""
        return tuple(f for f in self.faces if f.failed)

    @property
    def faces_failed(self) -> int:
        """Number of faces without any patch."""
        return len(self.failures)

    @property
    def patches(self) -> int:
        """Number of patches of all faces."""
        return sum(f.patches for f in self.faces)

    @property
    def edges(self) -> dict[str, int]:
        """Number of B-rep edges of each kind in all parts; kinds without any left out."""
        total: Counter[str] = Counter()
        for counts in self.part_edges:
            total.update(counts)
        return {kind: total[kind] for kind in EDGE_KINDS if total[kind]}

    def _largest(self, name: str) -> float:
        values = [getattr(f, name) for f in self.faces if not f.failed]
        values = [abs(v) for v in values if np.isfinite(v)]
        return max(values, default=0.0)

    @property
    def max_deviation_m(self) -> float:
        """Largest distance of a patch from its CAD surface. [m]"""
        return self._largest("deviation_m")

    @property
    def max_angle_deg(self) -> float:
        """Largest deviation of a patch normal. [deg]"""
        return self._largest("angle_deg")

    @property
    def max_area_error(self) -> float:
        """Largest relative area error of a face."""
        return self._largest("area_error")

    @property
    def max_gap_m(self) -> float:
        """Largest gap at a shared edge. [m]"""
        return self._largest("gap_m")

    @property
    def free_edge_m(self) -> float:
        """Length of all free edges; none of a part that is closed. [m]"""
        return float(sum(f.free_edge_m for f in self.faces))

    @property
    def normals_left_out(self) -> int:
        """Check points at which normals do not count: folds and cusps of surfaces."""
        return sum(f.normals_left_out for f in self.faces)


@dataclass(frozen=True, slots=True)
class Model:
    """A CAD model as patches in metres, in the axes of its file.

    Attributes
    ----------
    name : str
        Name in the scene.
    parts : tuple of Part
        Solids and sheets.
    faces : tuple of Face
        All B-rep faces; ``patches.face_index`` points here.
    patches : PatchSet
        ``part_index`` and ``face_index`` are rows of ``parts`` and ``faces``. +normals of solids
        point out of the material.
    certificate : Certificate
        What the conversion did.
    source, sha256 : str
        File (or "cadquery") and content hash.
    unit : str
        Length unit found or given.
    warnings : tuple of str
        What a user should know, one line each.
    edges : CadEdges
        All B-rep edges, smooth, sharp or free; ``patches.edge_index`` points here. None of models
        that were made of patches.
    """

    name: str
    parts: tuple[Part, ...]
    faces: tuple[Face, ...]
    patches: PatchSet
    certificate: Certificate
    source: str = "memory"
    sha256: str = ""
    unit: str = "mm"
    warnings: tuple[str, ...] = ()
    edges: CadEdges = field(default_factory=CadEdges.none)

    def __repr__(self) -> str:
        return model_repr(self)
