"""What a run found, kept for later runs of the same process.

Values are kept under a hash of all that they are made of, so that a later run gets what it would
find itself, to the bit; but for rows renewed in part after moves (`renewed`), which are as good.
Form factors depend on surfaces, mesh and tolerances, on no paint and no lamp: a scene that is
painted or dimmed anew needs none, as long as its mesh stays. Where the light of the lamps decides
on the mesh it would move with every change; so the mesh of the run before is taken again while it
is good enough for the new light, see `Mesh`.
"""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import itertools
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from .budget import Budget
from .exchange import OUTSIDE, Rows
from .fineness import Fineness
from .memory import available_bytes
from .mesh import Boxes
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.scene import SceneData
from .moved import Arrangement, Changed
from .refinement import Looked
from .row_finder import Ask
from .skies import sky_tone
from .stages import Stages
from .unknowns import Unknowns

Value = TypeVar("Value")
RowsAndMore = TypeVar("RowsAndMore", bound=tuple[Any, ...])
#: Finds anew what has changed of an earlier run's rows; None where that does not do.
Renew = Callable[[tuple[Any, ...], Changed], RowsAndMore | None]

#: Share of the memory that would be free without it, which the store may take.
SHARE = 0.2
#: The same where the system does not tell. [B]
UNTOLD = 500_000_000
#: Values that may be added before the system is asked again how much memory is free. [B]
SMALL = 2_000_000
#: Misplaced light up to which a mesh is taken again, against what it may have.
LOOSER = 1.5
#: Where `sky_tone` has the luminance of a sky.
LEVEL = 6
#: Share of the pairs above which rows are found anew as wholes after parts have moved.
MOST_CHANGED = 0.7


class Store:
    """Values by hash; what was not asked for longest is given up for new ones."""

    def __init__(self) -> None:
        self._values: OrderedDict[bytes, tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()
        self.bytes = 0
        #: What it may take, and what was added since the system was asked. [B]
        self._allowed, self._unasked = 0, SMALL

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: bytes) -> Any:
        """The value under ``key``; None where there is none."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def put(self, key: bytes, value: Any) -> None:
        """Keep ``value``, unless it takes more memory than the store may have."""
        size = nbytes(value)
        with self._lock:
            self.bytes -= self._values.pop(key, (None, 0))[1]
            room = self._room(size)
            while self._values and self.bytes + size > room:
                self.bytes -= self._values.popitem(last=False)[1][1]
            if size <= room:
                self._values[key] = value, size
                self.bytes += size

    def _room(self, size: int) -> int:
        """What the store may take now; what is small is let in without asking the system. [B]"""
        self._unasked += size
        if self._unasked > SMALL or self.bytes + size > self._allowed:
            free = available_bytes()
            self._allowed = UNTOLD if free is None else int(SHARE * (free + self.bytes))
            self._unasked = 0
        return self._allowed

    def clear(self) -> None:
        """Free what is kept."""
        with self._lock:
            self._values.clear()
            self.bytes = 0


#: What runs of this process share.
STORE = Store()
_MARKS = itertools.count()


def forget() -> None:
    """Free all that runs of this process have kept."""
    STORE.clear()


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """What the light of a run decided on, besides the values it led to.

    Attributes
    ----------
    boxes : Boxes
        Of its n elements.
    misplaced : float
        Share of the reflected light in the wrong place.
    looked : Looked or None
        Light of the lamps on it, where that decided on it.
    nets : (p, 4, 4, 4) array
        Control nets of the patches.
    reflectances : (p, 2) array
        Luminous reflectances of their sides.
    lamps : tuple of (p, 2) int array and array
        Lamp of each side of the patches, and their exitances. [lm/m²]
    fineness : Fineness
        Of the elements as sources.
    halved : (c,) int array
        Elements on which the light was looked at more closely.
    converged : bool
        Whether the accuracy asked for was reached.
    """

    boxes: Boxes
    misplaced: float
    looked: Looked | None
    nets: FloatArray
    reflectances: FloatArray
    lamps: tuple[IntArray, FloatArray]
    fineness: Fineness
    halved: IntArray
    converged: bool

    def still_good(self, misplaced: float, allowed: float) -> bool:
        """Whether the mesh serves light of which it has the share ``misplaced`` wrong."""
        return misplaced <= LOOSER * max(allowed, self.misplaced)

    def fine_enough(self, boxes: Boxes, asked: Fineness) -> Fineness:
        """Its own fineness where that does, else what is asked for."""
        does = same_boxes(self.boxes, boxes) and self.fineness.does_for(asked)
        return self.fineness if does else asked


def same_boxes(one: Boxes, other: Boxes) -> bool:
    """Whether two meshes have the same elements."""
    return one is other or (
        len(one) == len(other)
        and np.array_equal(one.patch, other.patch)
        and np.array_equal(one.side, other.side)
        and np.array_equal(one.ends, other.ends)
    )


class Kept:
    """What one run takes of the store, and adds to it.

    Parameters
    ----------
    scene : SceneData
        Of the run.
    stages : Stages
        Receives counters, and warnings once more.
    store : Store, optional
        Without, nothing is kept.
    """

    def __init__(self, scene: SceneData, *, stages: Stages, store: Store | None = None) -> None:
        self.scene, self.stages, self.store = scene, stages, store
        #: How often something of a name was there, or was not.
        self.hits: dict[str, list[int]] = {}
        #: Rows that are in the store, by the identity of their factors, and where they came from.
        self._from: dict[int, tuple[Rows, bytes]] = {}
        self._base = self._parts = b""
        if store is not None:
            kinds = [(part.path, part.kind) for part in scene.parts]
            self._parts = digest(
                scene.patches.part_index, scene.two_sided, scene.closed, kinds, scene.see_through
            )
            self._base = digest(scene.patches, self._parts)

    def with_more(self, *of: Any) -> Kept:
        """The same, of values that depend on ``of`` besides the surfaces."""
        out = copy.copy(self)
        if self.store is not None:
            out._base, out._parts = digest(self._base, of), digest(self._parts, of)
        return out

    def find(self, name: str, of: tuple[Any, ...], make: Callable[[], Value]) -> Value:
        """What ``make`` returns, which depends on the surfaces and on ``of`` alone.

        Warnings of the run that found it are given again.
        """
        if self.store is None:
            return make()
        key = digest(self._base, name, of)
        found = self.store.get(key)
        self.hits.setdefault(name, [0, 0])[found is None] += 1
        if found is None:
            before = len(self.stages.warnings)
            value = make()
            self.store.put(key, (value, tuple(self.stages.warnings[before:])))
            return value
        self.stages.warnings.extend(found[1])
        return found[0]  # type: ignore[no-any-return]

    def rows(
        self,
        name: str,
        asked: Ask,
        more: tuple[Any, ...],
        make: Callable[[], RowsAndMore],
        sees_sky: Callable[[Ask], Rows] | None = None,
        renew: Renew[RowsAndMore] | None = None,
        sees_out: Callable[[RowsAndMore], bool] = lambda found: True,
        which: str = "",
    ) -> RowsAndMore:
        """Rows as ``make`` returns them, first of what may be more.

        They depend on what is ``asked`` and on ``more``. What they see of another sky than that
        they were found under is found anew by ``sees_sky``, where it matters. With ``renew`` pairs
        of an earlier run that moved parts do not touch are kept, see `moved`; it finds the others.
        ``sees_out`` tells whether light could leave the scene when rows were found, ``which`` sets
        of rows of one name apart.
        """
        if self.store is None:
            return make()
        before = list(self.hits.get(name, (0, 0)))
        sky = self.scene.sky
        tone = np.empty(0) if sky is None else np.asarray(sky_tone(sky))
        known = None if sees_sky is None else tone
        of = tolerances(asked.budget)
        where = digest(self._parts, name, which, of, more)
        value = self.find(
            name,
            (of, *_of_rows(asked), more),
            lambda: (
                self._after_moves(where, asked, known, renew, sees_out) or make(),
                tone,
                _new_mark(),
            ),
        )
        found: RowsAndMore = value[0]
        self._mark(found[0], value[2])
        there = self.hits.get(name, [0, 0])[0] > before[0]
        if there:
            self._count(len(found[0].factors), found[0].factors.size)
        if there and sees_sky is not None and not np.array_equal(value[1], tone):
            find = sees_sky

            def look(some: Ask) -> Rows:
                self.hits[name][1] += 1
                return find(some)

            out: Any = (under_sky(found[0], value[1], tone, asked, look), *found[1:])
            found = out
        if renew is not None:
            nets = self.scene.patches.control_points
            self.store.put(where, Arrangement.of(nets, asked, found, tone))
        return found

    def _count(self, rows: int, pairs: int) -> None:
        self.stages.count({"rows_reused": rows, "pairs_reused": pairs})

    def _after_moves(
        self,
        where: bytes,
        asked: Ask,
        tone: FloatArray | None,
        renew: Renew[RowsAndMore] | None,
        sees_out: Callable[[RowsAndMore], bool],
    ) -> RowsAndMore | None:
        """Rows of an earlier run whose parts stood elsewhere, put right; None where all are new.

        Where they know of the sky, it must be of the same ``tone``.
        """
        before = None if renew is None or self.store is None else self.store.get(where)
        if before is None or renew is None:
            return None
        if tone is not None and not np.array_equal(before.tone, tone):
            return None
        out = sees_out(before.found)
        changed = before.changed(self.scene.patches, asked, sees_out=out)
        if changed is None:
            return None
        pairs = int(changed.pairs.sum())
        if pairs > MOST_CHANGED * changed.pairs.size:
            return None
        found = renew(before.found, changed)
        if found is not None:
            self._count(int((~changed.again).sum()), changed.pairs.size - pairs)
            self.stages.count({"pairs_renewed": pairs})
        return found

    def _mark(self, rows: Rows, mark: bytes) -> None:
        if self.store is not None:
            self._from[id(rows.factors)] = rows, mark

    def of_rows(
        self, name: str, rows: Rows, of: tuple[Any, ...], make: Callable[[], Value]
    ) -> Value:
        """What ``make`` finds from ``rows``, from what they were asked for, and from ``of`` alone.

        Rows that are not in the store have nothing there. Rows made of others count as they do.
        """
        known = self._from.get(id(rows.factors))
        if known is None:
            return make()
        found, mark = self.find(name, (known[1], of), lambda: (make(), _new_mark()))
        if isinstance(found, Rows):
            self._mark(found, mark)
        return found

    def factors(self, unknowns: Unknowns, rows: Rows, asked: Ask) -> MatrixArray:
        """Form factors (m, N) of the unknowns by those of the elements."""
        how = asked.receivers, asked.sources, asked.budget.moments
        if not isinstance(rows.factors, np.ndarray) or unknowns.basis is None:
            return unknowns.factors(rows, *how)
        of = (unknowns.element, unknowns.areas, unknowns.basis.pieces)
        return self.of_rows("factors of nodes", rows, of, lambda: unknowns.factors(rows, *how))

    def gather(self, unknowns: Unknowns, rows: Rows, asked: Ask, light: FloatArray) -> FloatArray:
        """Light (m, b) that receivers get when the unknowns are ``light`` (N, b)."""
        how = asked.receivers, asked.sources, asked.budget.moments
        even = unknowns.even(light, asked.budget.moments)
        self.stages.count({"pairs_of_even_light": len(rows.factors) * int(even.sum())})
        known = None
        if id(rows.factors) in self._from:
            known = partial(self.factors, unknowns, rows, asked)
        return unknowns.gather(rows, *how, light, even, known)

    def tell(self) -> None:
        """Say which stages were as in a run before: they are skipped, not run."""
        seconds = self.stages.seconds
        for name in ("form factors", "iterated gather"):
            if self.hits.get(name, [0, 1])[1] == 0:
                self.stages.skipped[name] = "as in an earlier run: same surfaces, same mesh"
                # What is left of it is the time of finding out.
                seconds["reuse"] = seconds.get("reuse", 0.0) + seconds.pop(name, 0.0)

    def of_parts(self, name: str, of: tuple[Any, ...]) -> Any:
        """What was kept last for the same parts, wherever they stood; None where nothing was."""
        return None if self.store is None else self.store.get(digest(self._parts, name, of))

    def keep_of_parts(self, name: str, of: tuple[Any, ...], value: Any) -> None:
        """Keep what may hold for the same parts elsewhere."""
        if self.store is not None:
            self.store.put(digest(self._parts, name, of), value)

    def mesh(self, budget: Budget) -> Mesh | None:
        """The mesh of the last run of the same parts, wherever, and the same accuracy."""
        found = self.of_parts("mesh", self._of_mesh(budget))
        return found if isinstance(found, Mesh) else None

    def _of_mesh(self, budget: Budget) -> tuple[Any, ...]:
        """What lamps and sky there are decides on cuts, how bright they are is looked at again."""
        scene = self.scene
        outside = scene.sky is not None or scene.ground is not None
        lit = scene.luminaire_index >= 0
        return tolerances(budget), outside, lit

    def keep_mesh(self, budget: Budget, mesh: Mesh) -> None:
        """Keep the mesh for later runs."""
        self.keep_of_parts("mesh", self._of_mesh(budget), mesh)


def _new_mark() -> bytes:
    """Tells rows from all others that the process has found."""
    return b"%d" % next(_MARKS)


def tolerances(budget: Budget) -> Budget:
    """The same without the number of sensors: nothing else depends on it."""
    return dataclasses.replace(budget, receivers=0)


def _of_rows(asked: Ask) -> tuple[Any, ...]:
    return asked.receivers, asked.sources, asked.lifts, asked.share, asked.first, asked.hidden


def under_sky(
    rows: Rows,
    known: FloatArray,
    tone: FloatArray,
    asked: Ask,
    find: Callable[[Ask], Rows],
) -> Rows:
    """The same rows under another sky, given what kernels need of both (10,), (0,) of none.

    Of another luminance of the same sky they see as much; of another one the rows that see any are
    found once more, for its light alone.
    """
    outside = rows.outside.copy()
    seen = np.flatnonzero(outside[:, 1] > OUTSIDE)
    if not len(tone) or not len(seen):
        return dataclasses.replace(rows, outside=outside)
    same = len(known) and np.array_equal(np.delete(known, LEVEL), np.delete(tone, LEVEL))
    if same and known[LEVEL] > 0.0:
        outside[:, [0, 3]] *= (tone[LEVEL] / known[LEVEL]) ** np.array([1, 2])
    else:
        new = find(asked.taken(seen)).outside
        # Slivers are as bright as what others see.
        bright = float(new[:, 0].sum()) / max(float(new[:, 1].sum()), 1e-300)
        outside[:, 0] = bright * outside[:, 1]
        share = outside[seen, 1] / np.where(new[:, 1] > 0.0, new[:, 1], 1.0)
        outside[seen, 0], outside[seen, 3] = share * new[:, 0], share**2 * new[:, 3]
    return dataclasses.replace(rows, outside=outside)


def digest(*values: Any) -> bytes:
    """Hash of numbers, names, arrays, and of tuples and dataclasses of them."""
    sha = hashlib.sha256()
    for value in values:
        _feed(sha, value)
    return sha.digest()


def _feed(sha: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        sha.update(f"{value.dtype.str}{value.shape}".encode())
        sha.update(np.ascontiguousarray(value).data.cast("B") if value.size else b"")
    elif isinstance(value, (tuple, list)):
        sha.update(f"({len(value)}".encode())
        for item in value:
            _feed(sha, item)
    elif dataclasses.is_dataclass(value):
        sha.update(type(value).__name__.encode())
        for item in dataclasses.fields(value):
            _feed(sha, getattr(value, item.name))
    elif isinstance(value, bytes):
        sha.update(b"b%d" % len(value) + value)
    elif value is None or isinstance(value, (str, int, float, np.generic)):
        sha.update(f"{value!r};".encode())
    else:
        raise TypeError(f"{type(value).__name__}: has no hash by content")


def nbytes(value: Any) -> int:
    """Memory that the arrays in tuples and dataclasses take. [B]"""
    if isinstance(value, np.ndarray):
        return int(value.nbytes)
    if isinstance(value, (tuple, list)):
        return sum(nbytes(item) for item in value)
    if dataclasses.is_dataclass(value):
        return sum(nbytes(getattr(value, item.name)) for item in dataclasses.fields(value))
    return 0
