"""What a run found, kept for later runs of the same process.

Values are kept under a hash of all that they are made of, so that a later run gets what it would
find itself, to the bit; but for rows renewed in part after moves (`renewed`), which are as good,
and for rows left as they were, whose error is stated (`kept_error`).
Form factors depend on surfaces, mesh and tolerances, on no paint and no lamp: a scene that is
painted or dimmed anew needs none, as long as its mesh stays. Where the light of the lamps decides
on the mesh it would move with every change; so the mesh of the run before is taken again while it
is good enough for the new light, see `kept_mesh`.
"""

from __future__ import annotations

import copy
import dataclasses
import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from .arrangement import Arrangement, Changed
from .budget import Budget
from .change_bounds import Choose, Worth
from .exchange import Rows
from .kept_mesh import Mesh
from .kept_sights import Sights, joined, without
from .kept_sky import under_sky
from .model.arrays import FloatArray, MatrixArray
from .model.scene import SceneData
from .moved import moved_patches
from .row_finder import Ask
from .skies import sky_tone
from .stages import Stages
from .stand import History, Stand
from .store import Store, digest
from .unknowns import Unknowns

Value = TypeVar("Value")
RowsAndMore = TypeVar("RowsAndMore", bound=tuple[Any, ...])
#: Finds anew what has changed of an earlier run's rows; None where that does not do.
Renew = Callable[[tuple[Any, ...], Changed], RowsAndMore | None]

#: Share of the pairs above which rows are found anew as wholes after parts have moved.
MOST_CHANGED = 0.7
_MARKS = itertools.count()


class _Known(NamedTuple):
    """Rows that are in the store."""

    rows: Rows
    #: Tells them from all others.
    mark: bytes
    #: Name of the last rows for the same.
    where: bytes = b""
    #: The mark of rows that some of these are, and which are not.
    source: tuple[bytes, NDArray[np.bool_]] | None = None


class _Found(NamedTuple):
    """What is in the store of some rows."""

    found: tuple[Any, ...]
    tone: FloatArray
    mark: bytes
    history: History
    source: tuple[bytes, NDArray[np.bool_]] | None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class OldRows:
    """Rows that are taken though something has moved since they were found."""

    rows: Rows
    history: History
    asked: Ask

    @property
    def which(self) -> NDArray[np.bool_]:
        """Which (m,) of them."""
        return np.asarray(self.history.since < len(self.history.stands) - 1)


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
    beside : str
        What a run is for that is made beside those of the scene itself, such as daylight factors:
        what its light decides on does not take the place of what theirs did.
    """

    def __init__(
        self,
        scene: SceneData,
        *,
        stages: Stages,
        store: Store | None = None,
        beside: str = "",
    ) -> None:
        self.scene, self.stages, self.store, self.beside = scene, stages, store, beside
        #: How often something of a name was there, or was not.
        self.hits: dict[str, list[int]] = {}
        #: Rows that are in the store, by the identity of their factors, and where they came from.
        self._from: dict[int, _Known] = {}
        #: How elements stand now, by the identity of their nets.
        self._stands: dict[int, Stand] = {}
        #: What of the light matters, as a run before this one found it: with it rows may stay.
        self.worth: Worth | None = None
        #: Whether all rows are to be as they would be found now.
        self.exact = False
        #: Rows that are not, by name.
        self.old_rows: dict[str, OldRows] = {}
        #: Arrays of sources, and their digests: several sets of rows ask for the same ones.
        self._digests: dict[int, tuple[Any, bytes]] = {}
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
        key = self._key(name, of)
        found = self.store.get(key)
        self.hits.setdefault(name, [0, 0])[found is None] += 1
        if found is None:
            before = len(self.stages.warnings)
            value = make()
            self.store.put(key, (value, tuple(self.stages.warnings[before:])))
            return value
        self.stages.warnings.extend(found[1])
        return found[0]  # type: ignore[no-any-return]

    def _key(self, name: str, of: tuple[Any, ...]) -> bytes:
        return digest(self._base, name, of)

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
        *,
        choose: Choose | None = None,
    ) -> RowsAndMore:
        """Rows as ``make`` returns them, first of what may be more.

        They depend on what is ``asked`` and on ``more``. What they see of another sky than that
        they were found under is found anew by ``sees_sky``, where it matters. With ``renew`` pairs
        of an earlier run that moved parts do not touch are kept, see `arrangement`; it finds the
        others. ``sees_out`` tells whether light could leave the scene when rows were found,
        ``which`` sets of rows of one name apart. With ``choose`` some may stay as they are
        although something has moved: they are among `old_rows` then.
        """
        if self.store is None:
            return make()
        before = list(self.hits.get(name, (0, 0)))
        sky = self.scene.sky
        tone = np.empty(0) if sky is None else np.asarray(sky_tone(sky))
        known = None if sees_sky is None else tone
        of = (tolerances(asked.budget), *self._of_rows(asked), more)
        where = digest(self._parts, self.beside, name, which, of[0], more)
        stand = self._stand(asked)
        self.old_rows.pop(name + which, None)
        history = History.new(stand, len(asked.receivers.nodes))

        def made() -> _Found:
            return _Found(make(), tone, _new_mark(), history, None)

        def find() -> _Found:
            last = None if renew is None or self.store is None else self.store.get(where)
            if last is None or renew is None:
                return made()
            how = None if self.exact else choose
            value = self._after_moves(last, asked, stand, known, renew, sees_out, how)
            return made() if value is None else value._replace(tone=tone)

        value = self.find(name, of, find)
        there = self.hits.get(name, [0, 0])[0] > before[0]
        if value.history.is_old and there and self.exact and renew is not None:
            last = self._arrangement(asked, value)
            renewed = self._after_moves(last, asked, stand, known, renew, sees_out, None)
            value = made() if renewed is None else renewed._replace(tone=tone)
            self.store.put(self._key(name, of), (value, ()))
            there = False
        found: RowsAndMore = value.found  # type: ignore[assignment]
        self._mark(_Known(found[0], value.mark, where, value.source))
        if value.history.is_old:
            self.old_rows[name + which] = OldRows(found[0], value.history, asked)
        if there:
            self._count(len(found[0].factors), found[0].factors.size)
        if there and sees_sky is not None and not np.array_equal(value.tone, tone):
            look = sees_sky

            def seen(some: Ask) -> Rows:
                self.hits[name][1] += 1
                return look(some)

            out: Any = (under_sky(found[0], value.tone, tone, asked, seen), *found[1:])
            found = out
        # What a run beside another took of it is the other's to renew after moves.
        if renew is not None and not (there and self.beside):
            self.store.put(where, self._arrangement(asked, value._replace(found=found, tone=tone)))
        return found

    def _arrangement(self, asked: Ask, value: _Found) -> Arrangement:
        return Arrangement.of(value.history, asked, value.found, value.tone, value.mark)

    def _stand(self, asked: Ask) -> Stand:
        """How surfaces and elements stand now."""
        stand, nets = self._stands.get(id(asked.sources.nets)), self.scene.patches.control_points
        if stand is None:
            stand = self._stands[id(asked.sources.nets)] = Stand.of(nets, asked.sources)
        return stand

    def _count(self, rows: int, pairs: int) -> None:
        self.stages.count({"rows_reused": rows, "pairs_reused": pairs})

    def _of_rows(self, asked: Ask) -> tuple[Any, ...]:
        for array in asked.sources:
            if id(array) not in self._digests:
                self._digests[id(array)] = array, digest(array)
        sources = [self._digests[id(array)][1] for array in asked.sources]
        return asked.receivers, sources, asked.lifts, asked.fine, asked.first, asked.hidden

    def _after_moves(
        self,
        before: Arrangement,
        asked: Ask,
        stand: Stand,
        tone: FloatArray | None,
        renew: Renew[RowsAndMore],
        sees_out: Callable[[RowsAndMore], bool],
        choose: Choose | None,
    ) -> _Found | None:
        """Rows of an earlier run whose parts stood elsewhere, put right; None where all are new.

        Where they know of the sky, it must be of the same ``tone``.
        """
        if tone is not None and not np.array_equal(before.tone, tone):
            return None
        out = sees_out(before.found)  # type: ignore[arg-type]
        if choose is not None and self._has_moved_a_back(before.history):
            choose = None  # what it hides has no elements that would tell
        changed = before.changed(
            self.scene.patches, asked, stand, sees_out=out, worth=self.worth, choose=choose
        )
        if changed is None:
            return None
        pairs = int(changed.pairs.sum())
        if pairs > MOST_CHANGED * changed.pairs.size:
            return None
        found = renew(before.found, changed)
        if found is None:
            return None
        self._count(int((~changed.again).sum()), changed.pairs.size - pairs)
        self.stages.count({"pairs_renewed": pairs})
        source = before.mark, changed.again
        return _Found(found, before.tone, _new_mark(), changed.history, source)

    def _has_moved_a_back(self, history: History) -> bool:
        """Whether patches have moved whose backs are no surface, as those of sheets and solids."""
        bare = ~(self.scene.closed | self.scene.two_sided)
        nets = self.scene.patches.control_points
        return bool(bare.any()) and any(
            stand.nets.shape != nets.shape or (moved_patches(stand.nets, nets) & bare).any()
            for stand in history.stands
        )

    def _mark(self, known: _Known) -> None:
        if self.store is not None:
            self._from[id(known.rows.factors)] = known

    def of_rows(
        self, name: str, rows: Rows, of: tuple[Any, ...], make: Callable[[], Value]
    ) -> Value:
        """What ``make`` finds from ``rows``, from what they were asked for, and from ``of`` alone.

        Rows that are not in the store have nothing there. Rows made of others count as they do.
        """
        known = self._from.get(id(rows.factors))
        if known is None:
            return make()
        found, mark = self.find(name, (known.mark, of), lambda: (make(), _new_mark()))
        if isinstance(found, Rows):
            self._mark(_Known(found, mark))
        return found

    def factors(self, unknowns: Unknowns, rows: Rows, asked: Ask) -> MatrixArray:
        """Form factors (m, N) of the unknowns by those of the elements."""
        how = asked.receivers, asked.sources, asked.budget.moments
        if not isinstance(rows.factors, np.ndarray) or unknowns.basis is None:
            return unknowns.factors(rows, *how)
        name = "factors of nodes"
        of = (unknowns.element, unknowns.areas, unknowns.basis.pieces)
        known = self._from.get(id(rows.factors))

        def find() -> MatrixArray:
            before = None if known is None else self._of_source(known, unknowns)
            if before is None or known is None or known.source is None:
                return unknowns.factors(rows, *how)
            again = np.flatnonzero(known.source[1])
            some = asked.taken(again)
            found = before.copy()
            found[again] = unknowns.factors(rows.take(again), some.receivers, *how[1:])
            return found

        found = self.of_rows(name, rows, of, find)
        if known is not None and self.store is not None and known.where:
            key = self._key(name, (known.mark, of))
            self.store.put(known.where + b"nodes", (known.mark, of[::2], key))
        return found

    def _of_source(self, known: _Known, unknowns: Unknowns) -> MatrixArray | None:
        """Factors of the unknowns in the rows that most of ``known`` ones were taken from."""
        last = None if self.store is None else self.store.get(known.where + b"nodes")
        if last is None or known.source is None or last[0] != known.source[0]:
            return None
        element, pieces = last[1]
        assert self.store is not None and unknowns.basis is not None
        same = np.array_equal(element, unknowns.element)
        if not same or not np.array_equal(pieces, unknowns.basis.pieces):
            return None
        found = self.store.get(last[2])
        return None if found is None else found[0][0]  # type: ignore[no-any-return]

    def keeps(self, rows: Rows) -> bool:
        """Whether something of ``rows`` can be kept: they are in the store."""
        return self.store is not None and id(rows.factors) in self._from

    def sights(self, rows: Rows) -> Sights | None:
        """Which points of elements the receivers of ``rows`` are known to see."""
        known = self._from.get(id(rows.factors))
        if known is None or self.store is None:
            return None
        found: Sights | None = self.store.get(digest("sights", known.mark))
        if found is not None or known.source is None:
            return found
        before: Sights | None = self.store.get(digest("sights", known.source[0]))
        # What was found anew sees something else.
        return None if before is None else without(before, known.source[1])

    def keep_sights(self, rows: Rows, parts: list[Sights]) -> None:
        """Keep which points of elements the receivers of ``rows`` see, part after part.

        Not of rows that stay though something has moved: what they see is as it is now, and they
        are as before.
        """
        known = self._from.get(id(rows.factors))
        if known is None or self.store is None or not parts:
            return
        found = joined(parts)
        for old in self.old_rows.values():
            if old.rows.factors is rows.factors:
                found = without(found, old.which)
        self.store.put(digest("sights", known.mark), found)

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

    def worth_before(self, of: tuple[Any, ...]) -> Worth | None:
        """What of the light mattered in the last run of the same parts and for the same."""
        found = self.of_parts("worth", (self.beside, *of))
        return found if isinstance(found, Worth) else None

    def keep_worth(self, of: tuple[Any, ...], worth: Worth) -> None:
        """Keep what of the light matters for later runs."""
        self.keep_of_parts("worth", (self.beside, *of), worth)

    def mesh(self, budget: Budget) -> Mesh | None:
        """The mesh of the last run of the same parts, wherever, and the same accuracy.

        A run beside another that has none of its own takes that of the other.
        """
        for beside in dict.fromkeys((self.beside, "")):
            found = self.of_parts("mesh", (beside, *self._of_mesh(budget)))
            if isinstance(found, Mesh):
                return found
        return None

    def _of_mesh(self, budget: Budget) -> tuple[Any, ...]:
        """What lamps and sky there are decides on cuts; how bright they are, and whether and where
        there is a sun, is looked at again.
        """
        scene = self.scene
        outside = scene.sky is not None or scene.ground is not None
        lit = scene.luminaire_index >= 0
        return tolerances(budget), outside, lit

    def keep_mesh(self, budget: Budget, mesh: Mesh) -> None:
        """Keep the mesh for later runs."""
        self.keep_of_parts("mesh", (self.beside, *self._of_mesh(budget)), mesh)


def _new_mark() -> bytes:
    """Tells rows from all others that the process has found."""
    return b"%d" % next(_MARKS)


def tolerances(budget: Budget) -> Budget:
    """The same without the number of sensors: nothing else depends on it."""
    return dataclasses.replace(budget, receivers=0)
