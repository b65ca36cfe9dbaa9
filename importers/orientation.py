"""Faces of a shell turned so that they agree: each shared edge runs once each way."""

from __future__ import annotations

from collections import deque

#: Edges of a face with the sense in which its boundary runs along them.
Senses = list[tuple[int, bool]]


def flips(faces: list[Senses]) -> tuple[list[bool], bool]:
    """Which faces to turn over, and whether the shell can be oriented at all.

    Only edges shared by exactly two faces count. In each connected piece the smaller number of
    faces is turned.
    """
    shared: dict[int, list[tuple[int, bool]]] = {}
    for i, senses in enumerate(faces):
        own: dict[int, list[bool]] = {}
        for edge, sense in senses:
            own.setdefault(edge, []).append(sense)
        for edge, both in own.items():
            if len(both) == 1:  # a seam runs both ways on one face and says nothing
                shared.setdefault(edge, []).append((i, both[0]))
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in faces]
    for pair in shared.values():
        if len(pair) == 2:
            (i, a), (j, b) = pair
            neighbours[i].append((j, a == b))
            neighbours[j].append((i, a == b))
    turned: list[bool | None] = [None] * len(faces)
    orientable = True
    for start in range(len(faces)):
        if turned[start] is not None:
            continue
        turned[start] = False
        piece, queue = [start], deque([start])
        while queue:
            i = queue.popleft()
            for j, differs in neighbours[i]:
                wanted = bool(turned[i]) ^ differs
                if turned[j] is None:
                    turned[j] = wanted
                    piece.append(j)
                    queue.append(j)
                elif turned[j] != wanted:
                    orientable = False
        if 2 * sum(bool(turned[i]) for i in piece) > len(piece):
            for i in piece:
                turned[i] = not turned[i]
    return [bool(t) for t in turned], orientable
