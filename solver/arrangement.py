"""Form factors after parts have moved: only those of pairs between which the change may be.

A form factor stays when no line of sight from its receiver to its element can meet what moved, at
its old place or its new one: when that lies behind the receiver, or behind the element where it is
flat, or misses the hull of both. What has moved itself is found anew, and what it sees. Rows whose
light the change alters by so little that it does not matter may stay as they are altogether: see
`change_bounds`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .change_bounds import Choose, Worth, bounds_of_change
from .exchange import OUTSIDE, Rows
from .model.arrays import FloatArray, IntArray
from .model.patches import PatchSet
from .moved import moved_patches, places_of
from .row_finder import Ask
from .stand import History, Stand
from .surfaces import Receivers
from .topology import writable

#: Places whose rows may be kept: more are found anew.
MOST_STANDS = 16
#: Exitance that is more than none, of what is dark. [lm/m²]
DARK = 1e-100
#: Rounding of distances that depend on where the scene's points are counted from.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """What of some rows must be found anew.

    Attributes
    ----------
    again : (m,) bool array
        Rows of which anything must.
    pairs : (m, n) bool array
        Form factors that must.
    places : (b, 4) array
        Balls about the parts that have moved, where they were and where they are. [m]
    whole : (m,) bool array
        Rows in which what is seen of sky and ground must be found, too.
    history : History
        Of the rows once that is done.
    """

    again: NDArray[np.bool_]
    pairs: NDArray[np.bool_]
    places: FloatArray
    whole: NDArray[np.bool_]
    history: History


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """Rows that were found among surfaces, to be compared with others of the same parts.

    Attributes
    ----------
    history : History
        How the surfaces stood for each of the m rows.
    receivers : Receivers
        Of the rows.
    lifts : (m,) array or None
        As in `Ask`.
    patch : (n,) array
        Patches that the elements are of.
    cell_eps, dim, exact_above, point_from : (n,) arrays
        Of the elements, as in `Sources`.
    azimuths : (lines, 2) array
        As there.
    found : tuple
        The rows, and what was told with them.
    tone : (10,) or (0,) array
        Of the sky they were found under.
    mark : bytes
        Tells these rows from all others.
    """

    history: History
    receivers: Receivers
    lifts: FloatArray | None
    patch: IntArray
    cell_eps: FloatArray
    dim: FloatArray
    exact_above: FloatArray
    point_from: FloatArray
    azimuths: FloatArray
    found: tuple[object, ...]
    tone: FloatArray
    mark: bytes

    @classmethod
    def of(
        cls,
        history: History,
        asked: Ask,
        found: tuple[object, ...],
        tone: FloatArray,
        mark: bytes,
    ) -> Arrangement:
        sources = asked.sources
        return cls(
            history=history,
            receivers=asked.receivers,
            lifts=asked.lifts,
            patch=sources.patch,
            cell_eps=sources.cell_eps,
            dim=sources.dim,
            exact_above=sources.exact_above,
            point_from=sources.point_from,
            azimuths=sources.azimuths,
            found=found,
            tone=tone,
            mark=mark,
        )

    @property
    def rows(self) -> Rows:
        """What was found."""
        rows = self.found[0]
        assert isinstance(rows, Rows)
        return rows

    def _serves(self, asked: Ask, stood: NDArray[np.bool_]) -> bool:
        """Whether its rows are of what is ``asked``, as finely, but for elements that moved.

        ``stood`` (n,) tells the others.
        """
        new, old, sources = asked.receivers, self.receivers, asked.sources
        return (
            new.nodes.shape == old.nodes.shape
            and np.array_equal(new.own, old.own)
            and np.array_equal(new.patches, old.patches)
            and np.array_equal(self.cell_eps, sources.cell_eps)
            and np.array_equal(self.dim, sources.dim)
            and np.array_equal(self.azimuths, sources.azimuths)
            and bool((self.exact_above <= sources.exact_above)[stood].all())
            and bool((self.point_from >= sources.point_from * (1.0 - _ROUNDING))[stood].all())
            and np.array_equal(self.history.stands[-1].sources[stood], sources.nets[stood])
        )

    def changed(
        self,
        patches: PatchSet,
        asked: Ask,
        stand: Stand,
        *,
        sees_out: bool,
        worth: Worth | None = None,
        choose: Choose | None = None,
    ) -> Changed | None:
        """Which pairs must be found anew among ``patches``; None where nothing is known of them.

        ``stand`` is how the surfaces stand now. Unless light ``sees_out`` of the scene, what rows
        know of sky and ground is rounding. With ``worth`` rows stay as they are that are chosen for
        that.
        """
        new, old, rows, history = asked.receivers, self.receivers, self.rows, self.history
        nets, before = patches.control_points, history.stands[-1]
        if nets.shape != before.nets.shape or not np.array_equal(self.patch, asked.sources.patch):
            return None
        if not self._serves(asked, ~moved_patches(before.nets, nets)[self.patch]):
            return None  # as many elements, but others, or told more coarsely
        whole = (
            (new.nodes != old.nodes).any(axis=(1, 2))
            | (new.normals != old.normals).any(axis=(1, 2))
            | (new.weights != old.weights).any(axis=1)
        )
        lifts = np.zeros(len(whole)) if asked.lifts is None else asked.lifts
        if self.lifts is not None and asked.lifts is not None:
            whole |= self.lifts != asked.lifts
        open_rows = np.zeros(len(whole), dtype=bool)
        if sees_out:
            open_rows = rows.outside[:, 1] + rows.outside[:, 2] > OUTSIDE
        stays, bounds = np.zeros(len(whole), dtype=bool), np.zeros(len(whole))
        if worth is not None and choose is not None:
            oldest = len(history.stands) - MOST_STANDS
            of = patches.part_index
            # Also what is dark moves, and may be painted before the next run.
            light = np.maximum(worth.light, DARK)
            bounds = bounds_of_change(rows, history, asked, stand, light, ~whole, of)
            stays = ~whole & (history.since > oldest)
            stays &= choose(worth, np.where(stays, bounds, np.inf))
        pairs = np.zeros(rows.factors.shape, dtype=bool)
        again, places = whole | stays, []
        pairs[whole] = True
        for k in np.unique(history.since[~stays]):
            rest = ~stays & (history.since == k)
            places.append(self._touch(k, rest, lifts, open_rows, patches, pairs, again))
        again &= ~stays
        # What was asked about, or is out of view of all that moved, is as it would be found now.
        since = np.where(stays & (bounds > 0.0), history.since, len(history.stands))
        return Changed(
            again,
            pairs,
            np.concatenate([np.zeros((0, 4)), *places]),
            sees_out & again & (whole | open_rows),
            history.moved_on(stand, since),
        )

    def _touch(
        self,
        k: int,
        rows: NDArray[np.bool_],
        lifts: FloatArray,
        open_rows: NDArray[np.bool_],
        patches: PatchSet,
        pairs: NDArray[np.bool_],
        again: NDArray[np.bool_],
    ) -> FloatArray:
        """Mark ``pairs`` of some ``rows`` found with stand ``k``, and the rows: in place.

        Returns balls (b, 4) about the places. [m]
        """
        from .kernels.shafts import find_touched_pairs

        stand, nets = self.history.stands[k], patches.control_points
        dirty = moved_patches(stand.nets, nets)
        places = places_of(stand.nets, nets, dirty, patches.part_index)
        pairs[np.ix_(rows, dirty[self.patch])] = True
        # Rows that are marked already are not asked about.
        marked = again | ~rows
        find_touched_pairs(
            writable(self.receivers.nodes),
            writable(self.receivers.normals),
            writable(lifts),
            self.rows.factors,
            stand.seen,
            places,
            open_rows,
            pairs,
            marked,
        )
        again |= marked & rows
        return places.parts
