"""States of a scene: which of its parts are there, such as blinds that are down or up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import SceneData

from .assigning import full_path, matched_parts, row_offsets

if TYPE_CHECKING:
    from .scene import Entry


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
    group : str
        Window group that it is a state of; the whole scene where it is empty.
    """

    name: str
    present: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    group: str = ""


@dataclass(frozen=True, slots=True)
class Setting:
    """One state of each window group, all at once: what a year is solved in.

    Attributes
    ----------
    name : str
        The names of its states; where one group alone differs from its first state, that one's.
    states : tuple of str
        Names of its states, one a group.
    group : str
        The group that is not in its first state; empty where all are.
    """

    name: str
    states: tuple[str, ...]
    group: str = ""


def make_state(
    name: str,
    present: str | Iterable[str] | None,
    absent: str | Iterable[str] | None,
    group: str | None = None,
) -> State:
    """A checked state.

    Raises
    ------
    InputError
        For a name that is none, and patterns and groups that are no text.
    """
    if not isinstance(name, str) or not name:
        raise InputError(f"state {name!r}: must have a name")
    if group is not None and (not isinstance(group, str) or not group):
        raise InputError(f"state {name!r}: group = {group!r}: must be a name")
    there, gone = _patterns(name, "present", present), _patterns(name, "absent", absent)
    return State(name, there, gone, group or "")


def settings_of(states: Iterable[State]) -> list[Setting]:
    """What a year is solved in: all groups in their first state, then each in every other one.

    Of one group these are its states.

    Raises
    ------
    InputError
        Where some states have a group and others have none.
    """
    groups: dict[str, list[str]] = {}
    for state in states:
        groups.setdefault(state.group, []).append(state.name)
    if len(groups) > 1 and "" in groups:
        raise InputError(
            f"state {groups[''][0]!r}: has no group, but others have; give all states a group or "
            "none"
        )
    if len(groups) == 1:
        return [Setting(name, (name,)) for name in next(iter(groups.values()))]
    first = {group: names[0] for group, names in groups.items()}
    out = [Setting(" + ".join(first.values()), tuple(first.values()))]
    for group, names in groups.items():
        for name in names[1:]:
            out.append(Setting(name, tuple({**first, group: name}.values()), group))
    return out


def _patterns(name: str, key: str, given: str | Iterable[str] | None) -> tuple[str, ...]:
    found = () if given is None else (given,) if isinstance(given, str) else tuple(given)
    for pattern in found:
        if not isinstance(pattern, str) or not pattern:
            raise InputError(f"state {name!r}: {key} = {pattern!r}: must be a part pattern")
    return found


def absent_parts(
    states: Iterable[State], names: Iterable[str], entries: Mapping[str, Entry]
) -> list[int]:
    """Rows of the parts that are not there in the states ``names`` together.

    Patterns mean what they do in assignments; rows count the parts of all ``entries``.

    Raises
    ------
    InputError
        If there is no such state, a pattern matches no part, or a part is both there and not.
    """
    states, wanted = list(states), list(names)
    own = [s for s in states if s.name in wanted]
    for name in wanted:
        if name not in {s.name for s in own}:
            have = ", ".join(s.name for s in states) or "none"
            raise InputError(f"state {name!r}: there is none of the name; states: {have}")
    absent: set[int] = set()
    there: set[int] = set()
    for state in own:
        absent |= _rows(state, "absent", entries)
        there |= _rows(state, "present", entries)
    both = sorted(absent & there)
    if both:
        which = " + ".join(wanted)
        paths = [full_path(e, part) for e in entries.values() for part in e.model.parts]
        raise InputError(f"state {which!r}: {paths[both[0]]} is both present and absent")
    others: set[int] = set()
    for state in states:
        others |= _rows(state, "present", entries)
    return sorted(absent | (others - there))


def _rows(state: State, key: str, entries: Mapping[str, Entry]) -> set[int]:
    starts = row_offsets(entries)[0]
    return {
        starts[name] + row
        for pattern in getattr(state, key)
        for name, row in matched_parts(
            entries, pattern, label=f"state {state.name!r}: {key} = {pattern!r}"
        )
    }


def without_parts(data: SceneData, parts: list[int]) -> SceneData:
    """The scene without the patches of some parts."""
    return data.taken(np.flatnonzero(~np.isin(data.patches.part_index, parts)))
