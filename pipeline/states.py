"""States of a scene: which of its parts are there, such as blinds that are down or up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import SceneData
from patchlight.solver.model.result import matching


@dataclass(frozen=True, slots=True)
class State:
    """A named set of parts that are there or not.

    Attributes
    ----------
    name : str
        Of the state.
    present : tuple of str
        Patterns of parts that are there in this state, and of all others only in those that name
        them too.
    absent : tuple of str
        Patterns of parts that are not there in this state.
    """

    name: str
    present: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()


def make_state(
    name: str, present: str | Iterable[str] | None, absent: str | Iterable[str] | None
) -> State:
    """A checked state.

    Raises
    ------
    InputError
        For a name that is none, and patterns that are no text.
    """
    if not isinstance(name, str) or not name:
        raise InputError(f"state {name!r}: must have a name")
    return State(name, _patterns(name, "present", present), _patterns(name, "absent", absent))


def _patterns(name: str, key: str, given: str | Iterable[str] | None) -> tuple[str, ...]:
    found = () if given is None else (given,) if isinstance(given, str) else tuple(given)
    for pattern in found:
        if not isinstance(pattern, str) or not pattern:
            raise InputError(f"state {name!r}: {key} = {pattern!r}: must be a part pattern")
    return found


def absent_parts(states: Iterable[State], name: str, paths: list[str]) -> list[int]:
    """Rows of the parts that are not there in the state ``name``.

    Raises
    ------
    InputError
        If there is no such state, a pattern matches no part, or a part is both there and not.
    """
    states = list(states)
    own = next((s for s in states if s.name == name), None)
    if own is None:
        have = ", ".join(s.name for s in states) or "none"
        raise InputError(f"state {name!r}: there is none of the name; states: {have}")
    mine, there = (_rows(own, key, paths) for key in ("absent", "present"))
    both = sorted(mine & there)
    if both:
        raise InputError(f"state {name!r}: {paths[both[0]]} is both present and absent")
    others: set[int] = set()
    for state in states:
        others |= _rows(state, "present", paths)
    return sorted(mine | (others - there))


def _rows(state: State, key: str, paths: list[str]) -> set[int]:
    out: set[int] = set()
    for pattern in getattr(state, key):
        hits = set(matching(pattern, paths))
        if not hits:
            from difflib import get_close_matches

            near = ", ".join(get_close_matches(pattern, paths, n=3, cutoff=0.0))
            raise InputError(
                f"state {state.name!r}: {key} = {pattern!r}: no part matches; nearest: {near}"
            )
        out |= hits
    return out


def without_parts(data: SceneData, parts: list[int]) -> SceneData:
    """The scene without the patches of some parts."""
    return data.taken(np.flatnonzero(~np.isin(data.patches.part_index, parts)))
