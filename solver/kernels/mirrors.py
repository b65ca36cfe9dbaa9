"""What receivers see in mirrors, by rays to even places on the mirrors and on from there.

A mirror element gives a receiver the form factor F of the element times what is seen in it. F is
known; where its light comes from is told by rays to strata of the element, each with its share of
F. They go on from mirror to mirror until they end, and leave their share where they do.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .bvh import STACK
from .compiled import lean, parallel
from .dimmed import left_on_ray, next_pane
from .panes import MOST_CROSSED
from .paths import LEAST_SHARE, MOST_MIRRORS, Walk, element_at, frame_at, mirrored, next_hit
from .ray_patch import WORK
from .sky_luminance import sky_luminance

#: Most strata a direction on one mirror element seen from one node.
_MOST = 48
#: How often a stratum of a mirror that no image is made of is quartered where it may show a lamp,
#: until what comes from it is this small against the lamp; rays to an element at most.
_LEVELS, _FOOT, _MOST_RAYS = 6, 0.5, 100_000
#: Variance of a share by stratified rays against that by independent ones.
_EVEN = 0.5
#: Surfaces that light meets on its way where nothing hides anything, and ways parted at mirrors.
_MOST_MET, _BRANCHES = 512, 32
#: Columns of what is seen beyond the scene: sky and ground in one imaged mirror alone, then others.
SKY_IMAGED, SKY, GROUND_IMAGED, GROUND = range(4)


class Seen(NamedTuple):
    """What mirrors are looked at for.

    Attributes
    ----------
    element : (k,) int array
        Elements that are mirrors.
    row : (k,) int array
        Patch side of each.
    imaged : (2p,) bool array
        Sides in which lamps, sky and sun are found by images.
    lamp : (n,) int array
        Column of each element that is a lamp, −1 for others.
    lamp_spheres : (s, 4) array
        About the lamps.
    tone : (10,) array, or (0,)
        Luminance of the sky, as in `pyramid.visible_factor`.
    """

    element: np.ndarray
    row: np.ndarray
    imaged: np.ndarray
    lamp: np.ndarray
    lamp_spheres: np.ndarray
    tone: np.ndarray


@lean
def _scrambled(seed):
    return (seed * 1103515245 + 12345) & 0x7FFFFFFF


@lean
def _shows_edge(x, net, box, side, spheres, place, ends):
    """Whether a cell of a mirror may show part of a lamp, and is not small against it.

    The rays over its middle and its corners tell how wide the mirrored bundle is. ``place`` (6,)
    and ``ends`` (2, 3) are scratch.
    """
    wide = long = 0.0
    for k in range(5):
        u = 0.5 * (box[0] + box[1]) if k == 0 else (box[0] if k < 3 else box[1])
        v = 0.5 * (box[2] + box[3]) if k == 0 else (box[2] if k % 2 == 0 else box[3])
        frame_at(net, u, v, place)
        dx, dy, dz = place[0] - x[0], place[1] - x[1], place[2] - x[2]
        r = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / r, dy / r, dz / r
        d = 2.0 * (dx * place[3] + dy * place[4] + dz * place[5])
        dx, dy, dz = dx - d * place[3], dy - d * place[4], dz - d * place[5]
        if k == 0:
            ends[0, 0], ends[0, 1], ends[0, 2] = place[0], place[1], place[2]
            ends[1, 0], ends[1, 1], ends[1, 2] = dx, dy, dz
            continue
        off = (place[0] - ends[0, 0]) ** 2 + (place[1] - ends[0, 1]) ** 2
        long = max(long, off + (place[2] - ends[0, 2]) ** 2)
        off = (dx - ends[1, 0]) ** 2 + (dy - ends[1, 1]) ** 2 + (dz - ends[1, 2]) ** 2
        wide = max(wide, off)
    long, wide = math.sqrt(long), math.sqrt(wide)
    for k in range(spheres.shape[0]):
        radius = spheres[k, 3]
        dx, dy = spheres[k, 0] - ends[0, 0], spheres[k, 1] - ends[0, 1]
        dz = spheres[k, 2] - ends[0, 2]
        along = dx * ends[1, 0] + dy * ends[1, 1] + dz * ends[1, 2]
        away2 = dx * dx + dy * dy + dz * dz
        off = math.sqrt(max(away2 - along * along, 0.0))
        foot = long + wide * math.sqrt(away2)
        if along > -radius and off <= radius + 1.5 * foot and foot > _FOOT * radius:
            return True
    return False


@lean
def _to_mirror(x, n, net, box, side, seed, near, trace, tree, panes, walk, pane, row, ray):
    """Share of a cell, with the mirrored ray from it into ``ray``; 0 where it is not seen."""
    seed = _scrambled(seed)
    u = box[0] + (box[1] - box[0]) * (seed >> 8) / 8388608.0
    seed = _scrambled(seed)
    v = box[2] + (box[3] - box[2]) * (seed >> 8) / 8388608.0
    area = frame_at(net, u, v, walk.place)
    sign = -1.0 if side == 1 else 1.0
    r2 = here = there = 0.0
    for k in range(3):
        d = walk.place[k] - x[k]
        walk.ray[k] = x[k]
        walk.ray[3 + k] = d
        r2 += d * d
        here += d * n[k]
        there -= d * sign * walk.place[3 + k]
    if here <= 0.0 or there <= 0.0 or r2 == 0.0:
        return 0.0
    r = math.sqrt(r2)
    for k in range(3):
        walk.ray[3 + k] /= r
    if trace:
        hit, _, _ = next_hit(tree, walk, near)
        if hit != row:
            return 0.0
        off = 0.0
        for k in range(3):
            off = max(off, abs(walk.place[k] - x[k] - r * walk.ray[3 + k]))
        if off > 1e-6 * r + near:
            return 0.0  # another part of the same side
    elif side == 1:
        for k in range(3):
            walk.place[3 + k] = -walk.place[3 + k]
    here *= left_on_ray(
        panes, x[0], x[1], x[2], walk.ray[3], walk.ray[4], walk.ray[5], near, r - near, walk, pane
    )
    mirrored(walk.ray, walk.place)
    for k in range(6):
        ray[k] = walk.ray[k]
    return here * there * area / (r2 * r2) * (box[1] - box[0]) * (box[3] - box[2])


@lean
def _leave(e, share, emits, found, spread, touched, count):
    """Leave ``share`` on element ``e``; ``found`` (n, 2) holds all of it, and the lamps' part.

    ``spread`` (n, 2) holds the sums of their squares.
    """
    if found[e, 0] == 0.0 and share > 0.0:
        touched[count] = e
        count += 1
    found[e, 0] += share
    spread[e, 0] += share * share
    if emits:
        found[e, 1] += share
        spread[e, 1] += share * share
    return count


@lean
def _leave_scene(walk, share, by_image, seen, away):
    """Add to ``away`` (4,) what the walk's ray sees of ground or sky."""
    x, y, z = walk.ray[3], walk.ray[4], walk.ray[5]
    if z <= 0.0:
        away[GROUND_IMAGED if by_image else GROUND] += share
    elif seen.tone.size:
        tone = seen.tone
        level = sky_luminance(tone, tone[7], tone[8], tone[9], x, y, z)
        away[SKY_IMAGED if by_image else SKY] += share * level


@lean
def _cross(
    share, reach, emits, tree, panes, sides, near, walk, pane, found, spread, touched, count
):  # fmt: skip
    """Leave light on the panes that the walk's ray crosses before ``reach`` [m].

    Returns the share left, and the count of touched elements.
    """
    ray, at, first = walk.ray, near, tree.nets.shape[0]
    for _ in range(MOST_CROSSED):
        p, at, u, v, side, left = next_pane(
            panes, ray[0], ray[1], ray[2], ray[3], ray[4], ray[5], at, reach, walk, pane
        )
        if p < 0:
            break
        e = element_at(sides, 2 * (first + p) + side, u, v)
        if e >= 0:
            count = _leave(e, share, emits, found, spread, touched, count)
        share *= left
    return share, count


@lean
def _follow(
    ray, share, row, seen, tree, panes, sides, near, walk, pane, found, spread, touched, count,
    away,
):  # fmt: skip
    """Follow one ray that a mirror has turned; returns the count of touched, and what is lost.

    ``away`` (4,) receives the luminance of the sky, or 1 for the ground, times the share.
    """
    for k in range(6):
        walk.ray[k] = ray[k]
    start = share
    imaged = seen.imaged[row]
    for turn in range(MOST_MIRRORS):
        by_image = imaged and turn == 0
        hit, u, v = next_hit(tree, walk, near)
        if panes.nets.shape[0]:
            reach = 1e300 * start / start  # not a literal, which would compile the callees anew
            if hit >= 0:
                reach = 0.0
                for k in range(3):
                    reach += (walk.place[k] - walk.ray[k]) * walk.ray[3 + k]
                reach -= near
            share, count = _cross(
                share, reach, not by_image, tree, panes, sides, near, walk, pane, found, spread,
                touched, count,
            )  # fmt: skip
        if hit < 0:
            _leave_scene(walk, share, by_image, seen, away)
            return count, 0.0
        e = element_at(sides, hit, u, v)
        if e < 0:
            return count, share  # a side that no light was computed for
        count = _leave(e, share, not by_image, found, spread, touched, count)
        share *= sides.mirror[hit]
        if share <= LEAST_SHARE * start:
            return count, share
        mirrored(walk.ray, walk.place)
    return count, share


@lean
def _follow_through(
    ray, share, row, seen, tree, sides, near, walk, found, spread, touched, count, away, branch
):  # fmt: skip
    """The same where nothing hides anything: light goes on through all it meets.

    ``branch`` (k, 8) is room for what mirrors on the way turn aside.
    """
    for k in range(6):
        branch[0, k] = ray[k]
    branch[0, 6], branch[0, 7] = share, 1.0 if seen.imaged[row] else 0.0
    start, lost, top = share, 0.0, 1
    for _ in range(_MOST_MET):
        if top == 0:
            break
        top -= 1
        for k in range(6):
            walk.ray[k] = branch[top, k]
        share, by_image = branch[top, 6], branch[top, 7] > 0.0
        hit, u, v = next_hit(tree, walk, near)
        if hit < 0:
            _leave_scene(walk, share, by_image, seen, away)
            continue
        # On through what is met; what lies behind it comes after what it turns aside.
        for k in range(3):
            branch[top, k] = walk.place[k]
        top += 1
        e = element_at(sides, hit, u, v)
        if e < 0:
            continue
        count = _leave(e, share, not by_image, found, spread, touched, count)
        share *= sides.mirror[hit]
        if share <= LEAST_SHARE * start:
            continue
        if top == branch.shape[0]:
            lost += share
            continue
        mirrored(walk.ray, walk.place)
        for k in range(6):
            branch[top, k] = walk.ray[k]
        branch[top, 6], branch[top, 7] = share, 0.0
        top += 1
    for k in range(top):
        lost += branch[k, 6]
    return count, lost


@parallel
def mirror_rows(
    nodes, normals, weights, factors, seen, tree, panes, sides, rays, levels, near, trace, rows,
    variances, lamps, away, lost,
):  # fmt: skip
    """Add what mirrors show to rows of form factors.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node.
    factors : (m, k) array
        Form factors of the mirror elements.
    seen, tree, panes, sides
        `Seen`, `paths.Tree`, `panes.Panes`, whose patches follow those of the tree, and
        `paths.Sides` of them all.
    rays : float
        Rays for a form factor of 1.
    levels : int
        How often strata that may show a lamp are quartered at most.
    near : float
        Distance within which rays do not hit what they start on. [m]
    trace : bool
        Whether anything hides anything.
    rows, variances : (m, n) array
        Added to: form factors of elements by way of mirrors, and their variances.
    lamps : (m, 2, l) array
        Receives the form factors of lamps that no image finds, and their variances.
    away : (m, 2, 4) array
        Receives luminance x form factor of the sky, and form factors of the ground, seen in
        mirrors, and their variances.
    lost : (m, 2) array
        Receives the form factor of what was followed no further, and the number of rays.
    """
    n = rows.shape[1]
    for i in nb.prange(nodes.shape[0]):
        walk = Walk(np.empty(6), np.empty(6), np.empty(STACK, dtype=np.int64), np.empty(WORK))
        found, touched = np.zeros((n, 2)), np.empty(n + 1, dtype=np.int64)
        # Not a constant: the size grows to what is needed.
        kept = np.empty((64, 7))
        stack, level = np.empty((4 * _LEVELS, 4)), np.empty(4 * _LEVELS, dtype=np.int64)
        ends, spread = np.empty((2, 3)), np.zeros((n, 2))
        one, before, branch = np.zeros(4), np.zeros(4), np.empty((_BRANCHES, 8))
        squares, pane = np.zeros(4), np.empty(6)
        for c in range(seen.element.shape[0]):
            form = factors[i, c]
            row = seen.row[c]
            mirror = sides.mirror[row]
            if form <= 0.0 or mirror <= 0.0:
                continue
            e, side = seen.element[c], row % 2
            net, box = tree.nets[row // 2], sides.boxes[e]
            count = row * 0  # not a literal, which would compile the callees once more
            total = 0.0
            for q in range(nodes.shape[1]):
                if weights[i, q] == 0.0:
                    continue
                wanted = math.sqrt(rays * form * weights[i, q])
                strata = min(max(int(math.ceil(wanted)), 2), _MOST)
                seed = _scrambled(_scrambled(i * 7919 + c * 104729 + q * 31))
                for place in range(strata * strata):
                    a, b = place // strata, place % strata
                    stack[0, 0] = box[0] + (box[1] - box[0]) * a / strata
                    stack[0, 1] = box[0] + (box[1] - box[0]) * (a + 1) / strata
                    stack[0, 2] = box[2] + (box[3] - box[2]) * b / strata
                    stack[0, 3] = box[2] + (box[3] - box[2]) * (b + 1) / strata
                    level[0] = 0
                    top = 1
                    while top > 0:
                        top -= 1
                        cell, deep = stack[top], level[top]
                        if (
                            deep < min(levels, _LEVELS)
                            and not seen.imaged[row]
                            and count < _MOST_RAYS
                            and _shows_edge(
                                nodes[i, q], net, cell, side, seen.lamp_spheres, walk.place, ends
                            )
                        ):
                            u0, u1, v0, v1 = cell[0], cell[1], cell[2], cell[3]
                            u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
                            for k in range(4):
                                stack[top, 0], stack[top, 1] = (u0, u) if k < 2 else (u, u1)
                                stack[top, 2], stack[top, 3] = (v0, v) if k % 2 == 0 else (v, v1)
                                level[top] = deep + 1
                                top += 1
                            continue
                        if count == kept.shape[0]:
                            larger = np.empty((2 * count, 7))
                            larger[:count] = kept
                            kept = larger
                        seed = _scrambled(seed)
                        share = _to_mirror(
                            nodes[i, q], normals[i, q], net, cell, side, seed, near, trace, tree,
                            panes, walk, pane, row, kept[count],
                        )  # fmt: skip
                        lost[i, 1] += 1.0
                        if share > 0.0:
                            kept[count, 6] = share * weights[i, q]
                            total += kept[count, 6]
                            count += 1
            if total == 0.0:
                lost[i, 0] += form * mirror
                continue
            scale = form * mirror / total
            top = row * 0
            for k in range(4):
                one[k] = squares[k] = 0.0
            for s in range(count):
                for k in range(4):
                    before[k] = one[k]
                if trace:
                    top, left = _follow(
                        kept[s, :6], scale * kept[s, 6], row, seen, tree, panes, sides, near, walk,
                        pane, found, spread, touched, top, one,
                    )  # fmt: skip
                else:
                    top, left = _follow_through(
                        kept[s, :6], scale * kept[s, 6], row, seen, tree, sides, near, walk, found,
                        spread, touched, top, one, branch,
                    )  # fmt: skip
                lost[i, 0] += left
                for k in range(4):
                    squares[k] += (one[k] - before[k]) ** 2
            whole = form * mirror
            for t in range(top):
                j = touched[t]
                share, own = found[j, 0], found[j, 1]
                rows[i, j] += share
                # Of independent rays, and as the share tells how many of all of them it is.
                variances[i, j] += _EVEN * spread[j, 0] * max(1.0 - share / whole, 0.0)
                if own > 0.0 and seen.lamp[j] >= 0:
                    lamps[i, 0, seen.lamp[j]] += own
                    left = max(1.0 - own / whole, 0.0)
                    lamps[i, 1, seen.lamp[j]] += _EVEN * spread[j, 1] * left
                spread[j, 0] = spread[j, 1] = 0.0
                found[j, 0] = found[j, 1] = 0.0
            for k in range(4):
                away[i, 0, k] += one[k]
                away[i, 1, k] += _EVEN * max(squares[k] - one[k] ** 2 / count, 0.0)
