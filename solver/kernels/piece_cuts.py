"""Where pieces of surfaces are cut: in the middle, across their length, or along a silhouette."""

import numba as nb
import numpy as np

#: A silhouette within this share of a parameter is cut out as a strip.
_STRIP = 0.25
#: A piece longer than this against its width is cut across only.
_STRETCH = 16.0


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
def _zero_range(g, slack, along_u, zone):
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
        if high[k] < 0.0:
            continue
        for m in range(9):
            if low[m] > 0.0:
                continue
            # The segment from a coefficient above to one below.
            drop = high[k] - low[m]
            t = (k + (m - k) * (high[k] / drop if drop > 0.0 else 0.0)) / 8.0
            zone[0], zone[1] = min(zone[0], t), max(zone[1], t)


@nb.njit(cache=True, error_model="numpy")
def _is_longer(s, along_u):
    """Whether a net is far longer in one parameter than in the other."""
    u = v = 0.0
    for i in range(4):
        for k in range(3):
            u = max(u, abs(s[3, i, k] / s[3, i, 3] - s[0, i, k] / s[0, i, 3]))
            v = max(v, abs(s[i, 3, k] / s[i, 3, 3] - s[i, 0, k] / s[i, 0, 3]))
    return u > _STRETCH * v if along_u else v > _STRETCH * u


@nb.njit(cache=True, error_model="numpy")
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
            _zero_range(g, 2.0 * slack, along_u, zone)
            if 0.0 <= zone[1] - zone[0] <= _STRIP:
                for k in range(4):
                    parts[k, across], parts[k, across + 1] = 0.0, 1.0
                    parts[k, own], parts[k, own + 1] = zone[0], zone[1]
                parts[2, across + 1] = parts[3, across] = 0.5
                parts[0, own], parts[0, own + 1] = 0.0, zone[0]
                parts[1, own], parts[1, own + 1] = zone[1], 1.0
                if zone[0] <= 0.0 or zone[1] >= 1.0:
                    # Only one side is left: it takes both places.
                    left = 1 if zone[0] <= 0.0 else 0
                    for k in range(2):
                        parts[k, own], parts[k, own + 1] = parts[left, own], parts[left, own + 1]
                    parts[0, across + 1] = parts[1, across] = 0.5
                return
        if _is_longer(net, along_u):
            for k in range(4):
                parts[k, across], parts[k, across + 1] = 0.0, 1.0
                parts[k, own], parts[k, own + 1] = 0.25 * k, 0.25 * (k + 1)
            return
    for k in range(4):
        parts[k, 0], parts[k, 1] = 0.5 * (k // 2), 0.5 * (k // 2 + 1)
        parts[k, 2], parts[k, 3] = 0.5 * (k % 2), 0.5 * (k % 2 + 1)
