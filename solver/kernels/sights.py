"""Visible shares of bright elements from one receiver, by lines of sight to points on them.

What is told of a lamp by the few meridians that meet it is not enough where its light is most of
what there is. Its elements are asked at many points, each of which a panel hides if it lies within
the panel's outline and behind its plane: the signs of five products of vectors. Only panels that
meet the view cone of the lamp are asked, and a lamp none of them meets is wholly in sight.
"""

import math

import numba as nb
import numpy as np

#: Standard deviation of the share of an element by m points, 0 < share < 1: the first times m to
#: the second. Measured in furnished rooms.
SIGHT_DEVIATION, SIGHT_ORDER = 0.35, -0.6


@nb.njit(cache=True, error_model="numpy")
def _view(x, y, z, radius, views, row):
    """View cone of a sphere in the receiver's frame, into a row of ``views``."""
    distance = math.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / max(distance, 1e-300)
    sine = radius * inverse if distance > radius else 2.0
    views[row, 0], views[row, 1], views[row, 2] = x * inverse, y * inverse, z * inverse
    views[row, 3], views[row, 4] = sine, math.sqrt(max(1.0 - sine * sine, 0.0))
    views[row, 5] = distance - radius


@nb.njit(cache=True, error_model="numpy")
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
    views : (g + p, 6) array
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


@nb.njit(cache=True, error_model="numpy")
def list_meeting(sphere, x, frame, n, views, among, count, near):
    """List those of ``among`` whose view meets that of a sphere, and begins before its end.

    Parameters
    ----------
    sphere : (4,) array
        Middle and radius. [m]
    x, frame, n
        Point, frame and normal of the receiver.
    views : (k, 6) array
        From `view_blockers`.
    among : (k,) int array
        Rows of ``views``, the first ``count`` of them.
    near : (k,) int array
        Receives those found; their number is returned. It may be ``among`` itself.
    """
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    radius, distance = sphere[3], math.sqrt(dx * dx + dy * dy + dz * dz)
    everywhere = distance <= radius
    inverse = 1.0 / max(distance, 1e-300)
    ux = (frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz) * inverse
    uy = (frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz) * inverse
    uz = (n[0] * dx + n[1] * dy + n[2] * dz) * inverse
    sine, end = radius * inverse, distance + radius
    cosine, found = math.sqrt(max(1.0 - sine * sine, 0.0)), 0
    for k in range(count):
        m = among[k]
        along = ux * views[m, 0] + uy * views[m, 1] + uz * views[m, 2]
        other, cosine_other = views[m, 3], views[m, 4]
        # Half-angles that add up to more than a straight angle meet everything.
        wide = (other > 1.0) | (sine * cosine_other + cosine * other <= 0.0) | everywhere
        meets = wide | (along >= cosine * cosine_other - sine * other - 1e-12)
        near[found] = m
        found += 1 if meets & (views[m, 5] < end) else 0
    return found


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
def hide_points(e, nx, ny, nz, limit, points, count, seen):
    """Set ``seen`` to 0 for the points that a panel hides from the origin.

    Parameters
    ----------
    e : (4, 3) array
        From `may_hide`.
    nx, ny, nz, limit : float
        The panel's normal in the receiver's frame, and the product with it below which a point is
        behind its plane.
    points : (3, k) array
        The points in the receiver's frame, the first ``count`` of them. [m]
    seen : (k,) array
        1 for points in sight.
    """
    a0, a1, a2, b0, b1, b2 = e[0, 0], e[0, 1], e[0, 2], e[1, 0], e[1, 1], e[1, 2]
    c0, c1, c2, d0, d1, d2 = e[2, 0], e[2, 1], e[2, 2], e[3, 0], e[3, 1], e[3, 2]
    px, py, pz = points[0], points[1], points[2]
    for m in range(count):
        x, y, z = px[m], py[m], pz[m]
        most = max(a0 * x + a1 * y + a2 * z, b0 * x + b1 * y + b2 * z)
        most = max(most, max(c0 * x + c1 * y + c2 * z, d0 * x + d1 * y + d2 * z))
        hidden = (most <= 0.0) & (nx * x + ny * y + nz * z < limit)
        seen[m] = 0.0 if hidden else seen[m]


@nb.njit(cache=True, error_model="numpy")
def place_sights(x, n, frame, points, areas, begin, total, place, weight, seen):
    """Points of one unit in the receiver's frame, what each weighs, and all of them in sight."""
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    for k in range(total):
        dx = points[0, begin + k] - x0
        dy = points[1, begin + k] - x1
        dz = points[2, begin + k] - x2
        up = n0 * dx + n1 * dy + n2 * dz
        place[0, k] = f0 * dx + f1 * dy + f2 * dz
        place[1, k] = g0 * dx + g1 * dy + g2 * dz
        place[2, k] = up
        facing = areas[0, begin + k] * dx + areas[1, begin + k] * dy + areas[2, begin + k] * dz
        square = dx * dx + dy * dy + dz * dz
        weight[k] = max(up, 0.0) * max(-facing, 0.0) / (square * square)
        seen[k] = 1.0


@nb.njit(cache=True, error_model="numpy")
def share_bright(
    x, n, own, dark, factors, sources, blockers, rounding, listed, count, local, found
):  # fmt: skip
    """Visible shares and deviations of the elements that have points.

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
    listed, count, local
        Panels that turn their front to ``x`` and their points, from `meridian.list_facing`.
    found : shares.Shares
        Receives shares and deviations.
    """
    units, group, spheres = sources.sight_units, sources.group, sources.group_spheres
    start, points, areas = sources.sight_start, sources.sight_points, sources.sight_areas
    corners, planes, solids = sources.panel_corners, sources.panel_planes, sources.panel_solid
    elements, ranges, solid_of = sources.panel_element, sources.unit_ranges, blockers.solid
    bulging = blockers.bulging
    share, deviation = found.share, found.deviation
    clusters, balls, frame = sources.sight_clusters, sources.sight_spheres, found.frame
    views, blocking, every, close, near, place, weight, seen = (
        found.views,
        found.blocking,
        found.every,
        found.close,
        found.near,
        found.sight_place,
        found.sight_weight,
        found.sight_seen,
    )
    edges = np.empty((4, 3))
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    count = view_blockers(
        x, n, frame, spheres, dark, ranges, listed, count, local, corners, views, blocking
    )
    for c in range(clusters.shape[0]):
        around = -1
        for u in range(clusters[c, 0], clusters[c, 1]):
            g = units[u]
            if dark[g]:
                continue
            if around < 0:
                around = list_meeting(balls[c], x, frame, n, views, every, count, close)
            meeting = list_meeting(spheres[g], x, frame, n, views, close, around, near)
            first, end = group[g, 0], group[g, 1]
            begin, total = start[first], start[end] - start[first]
            solid = solid_of[group[g, 2]]
            dx, dy, dz = spheres[g, 0] - x0, spheres[g, 1] - x1, spheres[g, 2] - x2
            radius, cz = spheres[g, 3], n0 * dx + n1 * dy + n2 * dz
            cx, cy = f0 * dx + f1 * dy + f2 * dz, g0 * dx + g1 * dy + g2 * dz
            placed = False
            for m in range(meeting):
                for f in range(blocking[near[m], 0], blocking[near[m], 1]):
                    # What is convex does not hide itself.
                    if ranges[g, 0] <= f < ranges[g, 1] or (bulging[solid] and solids[f] == solid):
                        break
                    if elements[f] == own and own >= 0:
                        continue
                    nx, ny, nz = planes[0, f], planes[1, f], planes[2, f]
                    above = nx * x0 + ny * x1 + nz * x2 - planes[3, f]
                    if above <= rounding or nx * dx + ny * dy + nz * dz + above >= radius:
                        continue  # turned away, or all of the unit lies before its plane
                    if not may_hide(local, corners, f, cx, cy, cz, radius, edges):
                        continue
                    if not placed:
                        placed = True
                        place_sights(x, n, frame, points, areas, begin, total, place, weight, seen)
                    hide_points(
                        edges, f0 * nx + f1 * ny + f2 * nz, g0 * nx + g1 * ny + g2 * nz,
                        n0 * nx + n1 * ny + n2 * nz, -above - 1e-6 * radius, place, total, seen,
                    )  # fmt: skip
            for j in range(first, end):
                if factors[j] <= 0.0:
                    continue
                low, high = start[j] - begin, start[j + 1] - begin
                whole = visible = 0.0
                if placed:
                    for k in range(low, high):
                        whole += weight[k]
                        visible += weight[k] * seen[k]
                if whole > 0.0:
                    part = visible / whole
                    share[j] = 1.0 if part > 1.0 - 1e-9 else part
                    deviation[j] = 0.0
                    if 0.0 < share[j] < 1.0:
                        deviation[j] = SIGHT_DEVIATION * (high - low) ** SIGHT_ORDER
                elif not placed:
                    share[j], deviation[j] = 1.0, 0.0
