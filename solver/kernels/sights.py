"""Visible shares of bright elements from one receiver, by lines of sight to points on them.

What is told of a lamp by the few meridians that meet it is not enough where its light is most of
what there is. Its elements are asked at many points, each of which a panel hides if it lies within
the panel's outline and behind its plane: the signs of five products of vectors. Only panels that
meet the view cone of the lamp are asked, and a lamp none of them meets is wholly in sight.
"""

import math

from .compiled import lean

#: Standard deviation of the share of an element by m points, 0 < share < 1: the first times m to
#: the second. Measured in furnished rooms.
SIGHT_DEVIATION, SIGHT_ORDER = 0.35, -0.6


@lean
def _view(x, y, z, radius, views, row):
    """View cone of a sphere in the receiver's frame, into a column of ``views``."""
    distance = math.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / max(distance, 1e-300)
    sine = radius * inverse if distance > radius else 2.0
    views[0, row], views[1, row], views[2, row] = x * inverse, y * inverse, z * inverse
    views[3, row], views[4, row] = sine, math.sqrt(max(1.0 - sine * sine, 0.0))
    views[5, row] = distance - radius


@lean
def view_blockers(
    x, n, frame, spheres, dark, ranges, listed, count, local, corners, views, panels
):  # fmt: skip
    """View cones of all units that are not dark, and of the backs of one-sided patches.

    Parameters
    ----------
    spheres : (g, 4) array
        About the units.
    ranges : (g + 1, 4) int array
        `facets.Facets.unit_ranges`.
    listed, count, local, corners
        Panels that turn their front to ``x``, their points and which of them each has.
    views : (6, g + p) array
        Receives direction (3) in the receiver's frame, sine and cosine of the half-angle, and
        nearest distance.
    panels : (g + p, 2) int array
        Receives first and end of the panels of each.

    Returns
    -------
    int
        How many there are.
    """
    kept, units = 0, dark.shape[0]
    for g in range(units):
        if dark[g]:
            continue
        dx, dy, dz = spheres[g, 0] - x[0], spheres[g, 1] - x[1], spheres[g, 2] - x[2]
        _view(
            frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz,
            frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz,
            n[0] * dx + n[1] * dy + n[2] * dz,
            spheres[g, 3], views, kept,
        )  # fmt: skip
        panels[kept, 0], panels[kept, 1] = ranges[g, 0], ranges[g, 1]
        kept += 1
    m = count - 1
    while m >= 0 and listed[m] >= ranges[units, 0]:
        f = listed[m]
        c0, c1, c2, c3 = corners[f, 0], corners[f, 1], corners[f, 2], corners[f, 3]
        mx = 0.25 * (local[0, c0] + local[0, c1] + local[0, c2] + local[0, c3])
        my = 0.25 * (local[1, c0] + local[1, c1] + local[1, c2] + local[1, c3])
        mz = 0.25 * (local[2, c0] + local[2, c1] + local[2, c2] + local[2, c3])
        square = 0.0
        for e in range(4):
            c = corners[f, e]
            dx, dy, dz = local[0, c] - mx, local[1, c] - my, local[2, c] - mz
            square = max(square, dx * dx + dy * dy + dz * dz)
        _view(mx, my, mz, math.sqrt(square), views, kept)
        panels[kept, 0], panels[kept, 1] = f, f + 1
        kept += 1
        m -= 1
    return kept


@lean
def list_meeting(sphere, x, frame, n, views, count, meets, near):
    """List the views that meet that of a sphere, and begin before its end; returns how many.

    Parameters
    ----------
    sphere : (4,) array
        Middle and radius. [m]
    x, frame, n
        Point, frame and normal of the receiver.
    views : (6, k) array
        From `view_blockers`, the first ``count`` of them.
    meets : (k,) bool array
        Scratch.
    near : (k + 1,) int array
        Receives those found.
    """
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    radius, distance = sphere[3], math.sqrt(dx * dx + dy * dy + dz * dz)
    everywhere = distance <= radius
    inverse = 1.0 / max(distance, 1e-300)
    ux = (frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz) * inverse
    uy = (frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz) * inverse
    uz = (n[0] * dx + n[1] * dy + n[2] * dz) * inverse
    sine, end = radius * inverse, distance + radius
    cosine = math.sqrt(max(1.0 - sine * sine, 0.0))
    vx, vy, vz, sines, cosines, nearest = views[0], views[1], views[2], views[3], views[4], views[5]
    for m in range(count):
        along = ux * vx[m] + uy * vy[m] + uz * vz[m]
        other, cosine_other = sines[m], cosines[m]
        # Half-angles that add up to more than a straight angle meet everything.
        wide = (other > 1.0) | (sine * cosine_other + cosine * other <= 0.0) | everywhere
        meet = wide | (along >= cosine * cosine_other - sine * other - 1e-12)
        meets[m] = meet & (nearest[m] < end)
    found = 0
    for m in range(count):
        near[found] = m
        found += 1 if meets[m] else 0
    return found


@lean
def may_hide(local, corners, f, x, y, z, radius, e):
    """Whether a sphere at (x, y, z) of the receiver's frame reaches into panel ``f``'s outline.

    Receives into ``e`` (4, 3) the normals of the planes through the receiver and the panel's edges.
    """
    a = corners[f, 3]
    for k in range(4):
        b = corners[f, k]
        ex = local[1, a] * local[2, b] - local[2, a] * local[1, b]
        ey = local[2, a] * local[0, b] - local[0, a] * local[2, b]
        ez = local[0, a] * local[1, b] - local[1, a] * local[0, b]
        e[k, 0], e[k, 1], e[k, 2] = ex, ey, ez
        out = ex * x + ey * y + ez * z
        # Inside a panel seen from its front all are negative.
        if out > 0.0 and out * out > radius * radius * (ex * ex + ey * ey + ez * ez):
            return False
        a = b
    return True


@lean
def hide_points(e, nx, ny, nz, limit, points, first, end, seen):
    """Set ``seen`` to 0 for the points that a panel hides from the origin.

    Parameters
    ----------
    e : (4, 3) array
        From `may_hide`.
    nx, ny, nz, limit : float
        The panel's normal in the receiver's frame, and the product with it below which a point is
        behind its plane.
    points : (3, k) array
        The points in the receiver's frame [m]; ``first`` … ``end`` are asked for.
    seen : (k,) array
        1 for points in sight.
    """
    a0, a1, a2, b0, b1, b2 = e[0, 0], e[0, 1], e[0, 2], e[1, 0], e[1, 1], e[1, 2]
    c0, c1, c2, d0, d1, d2 = e[2, 0], e[2, 1], e[2, 2], e[3, 0], e[3, 1], e[3, 2]
    px, py, pz, out = (
        points[0, first:end],
        points[1, first:end],
        points[2, first:end],
        seen[first:end],
    )
    for m in range(out.shape[0]):
        x, y, z = px[m], py[m], pz[m]
        most = max(a0 * x + a1 * y + a2 * z, b0 * x + b1 * y + b2 * z)
        most = max(most, max(c0 * x + c1 * y + c2 * z, d0 * x + d1 * y + d2 * z))
        hidden = (most <= 0.0) & (nx * x + ny * y + nz * z < limit)
        out[m] = 0.0 if hidden else out[m]


@lean
def place_sights(x, n, frame, points, areas, first, end, at, place, weight, seen):
    """Points ``first`` … ``end`` in the receiver's frame, what each weighs, and all in sight.

    ``place`` (3, k), ``weight`` and ``seen`` (k,) receive them from ``at`` on.
    """
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    px, py, pz = points[0, first:end], points[1, first:end], points[2, first:end]
    ax, ay, az = areas[0, first:end], areas[1, first:end], areas[2, first:end]
    last = at + end - first
    along, across, height = place[0, at:last], place[1, at:last], place[2, at:last]
    weights, sights = weight[at:last], seen[at:last]
    for k in range(px.shape[0]):
        dx, dy, dz = px[k] - x0, py[k] - x1, pz[k] - x2
        up = n0 * dx + n1 * dy + n2 * dz
        along[k] = f0 * dx + f1 * dy + f2 * dz
        across[k] = g0 * dx + g1 * dy + g2 * dz
        height[k] = up
        facing = ax[k] * dx + ay[k] * dy + az[k] * dz
        square = dx * dx + dy * dy + dz * dz
        weights[k] = max(up, 0.0) * max(-facing, 0.0) / (square * square)
        sights[k] = 1.0


@lean
def _place_cluster(c, x, n, dark, sources, found):
    """Place the points of all units of cluster ``c`` that are not dark; returns how many."""
    units, clusters = sources.sight_units, sources.sight_clusters
    start, total = sources.sight_start, 0
    for u in range(clusters[c, 0], clusters[c, 1]):
        g = units[u]
        if not dark[g]:
            first, end = start[sources.group[g, 0]], start[sources.group[g, 1]]
            place_sights(
                x, n, found.frame, sources.sight_points, sources.sight_areas, first, end,
                total, found.sight_place, found.sight_weight, found.sight_seen,
            )  # fmt: skip
            total += end - first
    return total


@lean
def _hide_others(c, f, e, nx, ny, nz, limit, total, dark, sources, found):
    """`hide_points` for all of cluster ``c`` but the unit that panel ``f`` is of."""
    clusters, ranges, start = sources.sight_clusters, sources.unit_ranges, sources.sight_start
    at, low, high = 0, 0, 0
    for u in range(clusters[c, 0], clusters[c, 1]):
        g = sources.sight_units[u]
        if dark[g]:
            continue
        count = start[sources.group[g, 1]] - start[sources.group[g, 0]]
        if ranges[g, 0] <= f < ranges[g, 1]:
            low, high = at, at + count
        at += count
    place, seen = found.sight_place, found.sight_seen
    hide_points(e, nx, ny, nz, limit, place, 0, low, seen)
    hide_points(e, nx, ny, nz, limit, place, high, total, seen)


@lean
def _hide_cluster(c, x, n, own, near, meeting, dark, sources, blockers, rounding, found):
    """Find which points of cluster ``c`` are in sight.

    Parameters
    ----------
    near : (k,) int array
        Views that meet that of the cluster, ``meeting`` of them.

    Returns
    -------
    int
        How many points were placed, 0 where nothing may hide any of them.
    """
    corners, planes, solids = sources.panel_corners, sources.panel_planes, sources.panel_solid
    elements, ball, frame = sources.panel_element, sources.sight_spheres[c], found.frame
    above, local, blocking = found.above, found.panel_local, found.blocking
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    n0, n1, n2 = n[0], n[1], n[2]
    solid = blockers.solid[sources.group[sources.sight_units[sources.sight_clusters[c, 0]], 2]]
    dx, dy, dz, radius = ball[0] - x[0], ball[1] - x[1], ball[2] - x[2], ball[3]
    cx, cy = f0 * dx + f1 * dy + f2 * dz, g0 * dx + g1 * dy + g2 * dz
    cz = n0 * dx + n1 * dy + n2 * dz
    total, edges = 0, found.edges
    for m in range(meeting):
        for f in range(blocking[near[m], 0], blocking[near[m], 1]):
            # What is convex does not hide itself.
            if blockers.bulging[solid] and solids[f] == solid:
                break
            if above[f] <= rounding or (own >= 0 and elements[f] == own):
                continue
            nx, ny, nz = planes[0, f], planes[1, f], planes[2, f]
            if nx * dx + ny * dy + nz * dz + above[f] >= radius:
                continue  # all of the cluster lies before its plane
            if not may_hide(local, corners, f, cx, cy, cz, radius, edges):
                continue
            if total == 0:
                total = _place_cluster(c, x, n, dark, sources, found)
            lx, ly = f0 * nx + f1 * ny + f2 * nz, g0 * nx + g1 * ny + g2 * nz
            lz, limit = n0 * nx + n1 * ny + n2 * nz, -above[f] - 1e-6 * radius
            if solids[f] == solid:
                _hide_others(c, f, edges, lx, ly, lz, limit, total, dark, sources, found)
            else:
                hide_points(edges, lx, ly, lz, limit, found.sight_place, 0, total, found.sight_seen)
    return total


@lean
def _sum_unit(g, at, placed, factors, sources, found):
    """Shares and deviations of the elements of unit ``g``, whose points begin at ``at``."""
    group, start, weight, seen = (
        sources.group,
        sources.sight_start,
        found.sight_weight,
        found.sight_seen,
    )
    share, deviation = found.share, found.deviation
    offset, points, spread = at - start[group[g, 0]], 0, 0.0
    for j in range(group[g, 0], group[g, 1]):
        if factors[j] <= 0.0:
            continue
        whole = visible = 0.0
        if placed:
            for k in range(start[j] + offset, start[j + 1] + offset):
                whole += weight[k]
                visible += weight[k] * seen[k]
        if whole > 0.0:
            part = visible / whole
            share[j] = 1.0 if part > 1.0 - 1e-9 else part
            if start[j + 1] - start[j] != points:
                points = start[j + 1] - start[j]
                spread = SIGHT_DEVIATION * points**SIGHT_ORDER
            deviation[j] = spread if 0.0 < share[j] < 1.0 else 0.0
        elif not placed:
            share[j], deviation[j] = 1.0, 0.0


@lean
def share_bright(x, n, own, dark, factors, sources, blockers, rounding, count, found):
    """Visible shares and deviations of the elements that have points.

    What may hide a cluster, the bright units of one solid, is looked for once for all of them.

    Parameters
    ----------
    own : int
        Flat element the receiver lies in, −1 where there is none.
    dark : (g,) bool array
        Units of which nothing is seen.
    factors : (n,) array
        Unoccluded form factors.
    rounding : float
        `contour.horizon_tolerance` of the receiver. [m]
    count : int
        How many panels turn their front to ``x``.
    found : shares.Shares
        Knows these panels; receives shares and deviations.
    """
    units, clusters, frame = sources.sight_units, sources.sight_clusters, found.frame
    group, start, views = sources.group, sources.sight_start, found.views
    viewed = False
    for c in range(clusters.shape[0]):
        lit = False
        for u in range(clusters[c, 0], clusters[c, 1]):
            g = units[u]
            if not dark[g]:
                for j in range(group[g, 0], group[g, 1]):
                    lit |= factors[j] > 0.0
        if not lit:
            continue
        if not viewed:
            viewed = True
            count = view_blockers(
                x, n, frame, sources.group_spheres, dark, sources.unit_ranges, found.listed, count,
                found.panel_local, sources.panel_corners, views, found.blocking,
            )  # fmt: skip
        meeting = list_meeting(
            sources.sight_spheres[c], x, frame, n, views, count, found.meets, found.close
        )
        total = _hide_cluster(
            c, x, n, own, found.close, meeting, dark, sources, blockers, rounding, found
        )
        at = 0
        for u in range(clusters[c, 0], clusters[c, 1]):
            g = units[u]
            if not dark[g]:
                _sum_unit(g, at, total > 0, factors, sources, found)
                at += start[group[g, 1]] - start[group[g, 0]]
