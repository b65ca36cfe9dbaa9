"""Where pieces of surfaces are cut: in the middle, across their length, or along a silhouette."""

import numpy as np

from .compiled import kernel, lean

#: A silhouette within this share of a parameter is cut out as a strip.
STRIP = 0.25
#: A piece longer than this against its width is cut across only.
_STRETCH = 16.0


@lean
def restrict(g, a, b, along_u, work):
    """Coefficients of ``g`` (d, d) on [a, b] of one parameter, in place."""
    d = g.shape[0]
    for m in range(d):
        for k in range(d):
            work[k] = g[k, m] if along_u else g[m, k]
        for step in range(1, d):
            for k in range(d - 1, step - 1, -1):
                work[k] = (1.0 - b) * work[k - 1] + b * work[k]
        t = a / b if b > 0.0 else 0.0
        for step in range(1, d):
            for k in range(d - step):
                work[k] = (1.0 - t) * work[k] + t * work[k + 1]
        for k in range(d):
            if along_u:
                g[k, m] = work[k]
            else:
                g[m, k] = work[k]


@kernel
def zero_range(g, slack, along_u, zone):
    """Range of one parameter in which coefficients (9, 9) may vanish, into ``zone`` (2,).

    Where the convex hull of the coefficients over that parameter meets 0. Beyond the range the
    function is larger than ``slack``.
    """
    zone[0], zone[1] = 1.0, 0.0
    low, high = np.empty(9), np.empty(9)
    for k in range(9):
        low[k], high[k] = 1e300, -1e300
        for m in range(9):
            value = g[k, m] if along_u else g[m, k]
            low[k], high[k] = min(low[k], value), max(high[k], value)
        low[k], high[k] = low[k] - slack, high[k] + slack
    for k in range(9):
        for m in range(9):
            # Segments of the hull from a point above to one below.
            for corner in range(4):
                above = low[k] if corner % 2 == 0 else high[k]
                below = low[m] if corner < 2 else high[m]
                if above < 0.0 or below > 0.0:
                    continue
                drop = above - below
                t = (k + (m - k) * (above / drop if drop > 0.0 else 0.0)) / 8.0
                zone[0], zone[1] = min(zone[0], t), max(zone[1], t)


@lean
def end_value(g, along_u, end):
    """The larger of the values at the two corners at one ``end`` (0, 1) of a parameter.

    Beyond the range of zeros its sign is that of the whole part, whatever the coefficients are.
    """
    k = 8 * end
    a, b = (g[k, 0], g[k, 8]) if along_u else (g[0, k], g[8, k])
    return a if abs(a) > abs(b) else b


@lean
def _is_longer(s, along_u):
    """Whether a net is far longer in one parameter than in the other."""
    u = v = 0.0
    for i in range(4):
        for k in range(3):
            u = max(u, abs(s[3, i, k] / s[3, i, 3] - s[0, i, k] / s[0, i, 3]))
            v = max(v, abs(s[i, 3, k] / s[i, 3, 3] - s[i, 0, k] / s[i, 0, 3]))
    return u > _STRETCH * v if along_u else v > _STRETCH * u


@kernel
def lay_out(net, g, slack, mixed, parts):
    """Where to cut a piece: four boxes (4, 4) in its own parameters.

    Parameters
    ----------
    net : (4, 4, 4) array
        The piece.
    g : (9, 9) array
        Heights over its tangent planes.
    slack : float
        Rounding of ``g``.
    mixed : bool
        Whether both sides of it may be seen.
    parts : (4, 4) array
        Receives u0, u1, v0, v1 of each part.

    Returns
    -------
    first, second : int
        Of the first and the second part: −1, or the end (0, 1) of the parameter cut away from the
        silhouette, where the part shows one side only.
    along_u : bool
        The parameter cut.

    Notes
    -----

    A silhouette along a parameter line, as on a cylinder or a cone, is cut out as a strip that
    narrows with the square of its width: seen from the receiver, it becomes a straight edge.
    This is Bézier clipping of the heights.
    """
    zone = np.empty(2)
    for direction in range(2):
        along_u = direction == 0
        own, across = (0, 2) if along_u else (2, 0)
        if mixed:
            # Twice the rounding: what is cut off has to have a clear sign.
            zero_range(g, 2.0 * slack, along_u, zone)
            if 0.0 <= zone[1] - zone[0] <= STRIP:
                for k in range(4):
                    parts[k, across], parts[k, across + 1] = 0.0, 1.0
                    parts[k, own], parts[k, own + 1] = zone[0], zone[1]
                parts[2, across + 1] = parts[3, across] = 0.5
                parts[0, own], parts[0, own + 1] = 0.0, zone[0]
                parts[1, own], parts[1, own + 1] = zone[1], 1.0
                if zone[0] > 0.0 and zone[1] < 1.0:
                    return 0, 1, along_u
                # Only one side is left: it takes both places.
                left = 1 if zone[0] <= 0.0 else 0
                for k in range(2):
                    parts[k, own], parts[k, own + 1] = parts[left, own], parts[left, own + 1]
                parts[0, across + 1] = parts[1, across] = 0.5
                return left, left, along_u
        if _is_longer(net, along_u):
            for k in range(4):
                parts[k, across], parts[k, across + 1] = 0.0, 1.0
                parts[k, own], parts[k, own + 1] = 0.25 * k, 0.25 * (k + 1)
            return -1, -1, along_u
    for k in range(4):
        parts[k, 0], parts[k, 1] = 0.5 * (k // 2), 0.5 * (k // 2 + 1)
        parts[k, 2], parts[k, 3] = 0.5 * (k % 2), 0.5 * (k % 2 + 1)
    return -1, -1, True
