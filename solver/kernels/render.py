"""Luminance of what rays hit: curved elements, the sky, the sun's disc, the ground."""

import math

import numba as nb
import numpy as np

from .compiled import kernel, lean, parallel
from .sky_luminance import PARAMETERS, sky_luminance

_GROUP = 256
#: Layout of the environment array after the sky's parameters: sun of the sky (3), colour of the
#: sky (3, zero without a sky), ground [cd/m²] (3), direction of the disc (3), its squared chord
#: (negative without a sun), its luminance [cd/m²] (3).
SKY_SUN = PARAMETERS
SKY_COLOR = SKY_SUN + 3
GROUND = SKY_COLOR + 3
DISC = GROUND + 3
DISC_CHORD = DISC + 3
DISC_LUMINANCE = DISC_CHORD + 1
ENVIRONMENT = DISC_LUMINANCE + 3


@lean
def _basis(t, b, d):
    s = 1.0 - t
    b[0], b[1], b[2], b[3] = s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t
    d[0], d[3] = -3 * s * s, 3 * t * t
    d[1], d[2] = 3 * s * (s - 2 * t), 3 * t * (2 * s - t)


@kernel
def unit_normal(net, u, v, out):
    """Unit +normal of a net at (u, v) into ``out (3,)``; taken from nearby on collapsed edges."""
    b, c, db, dc = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    h, hu, hv = np.empty(4), np.empty(4), np.empty(4)
    for _ in range(3):
        _basis(u, b, db)
        _basis(v, c, dc)
        for k in range(4):
            h[k] = hu[k] = hv[k] = 0.0
            for i in range(4):
                for j in range(4):
                    x = net[i, j, k]
                    h[k] += b[i] * c[j] * x
                    hu[k] += db[i] * c[j] * x
                    hv[k] += b[i] * dc[j] * x
        # Quotient rule; the common factor w does not turn the normal, as all weights are positive.
        for k in range(3):
            hu[k] -= hu[3] * h[k] / h[3]
            hv[k] -= hv[3] * h[k] / h[3]
        x, y = hu[1] * hv[2] - hu[2] * hv[1], hu[2] * hv[0] - hu[0] * hv[2]
        z = hu[0] * hv[1] - hu[1] * hv[0]
        length = math.sqrt(x * x + y * y + z * z)
        along_u = math.sqrt(hu[0] * hu[0] + hu[1] * hu[1] + hu[2] * hu[2])
        along_v = math.sqrt(hv[0] * hv[0] + hv[1] * hv[1] + hv[2] * hv[2])
        if length > 1e-9 * along_u * along_v and length > 0.0:
            out[0], out[1], out[2] = x / length, y / length, z / length
            return
        u += 1e-4 * (0.5 - u)
        v += 1e-4 * (0.5 - v)
    out[0] = out[1] = out[2] = math.nan


@lean
def environment_luminance(environment, x, y, z, out):
    """Luminance (3,) of sky, sun or ground in the unit direction (x, y, z). [cd/m²]"""
    if z <= 0.0:
        for k in range(3):
            out[k] = environment[GROUND + k]
        return
    level = sky_luminance(
        environment, environment[SKY_SUN], environment[SKY_SUN + 1], environment[SKY_SUN + 2],
        x, y, z,
    )  # fmt: skip
    a, b = x - environment[DISC], y - environment[DISC + 1]
    c = z - environment[DISC + 2]
    in_disc = a * a + b * b + c * c <= environment[DISC_CHORD]
    for k in range(3):
        out[k] = level * environment[SKY_COLOR + k]
        if in_disc:
            out[k] += environment[DISC_LUMINANCE + k]


@lean
def _find_element(start, order, boxes, row, u, v):
    """Element of patch side ``row`` that holds (u, v), −1 if there is none."""
    for k in range(start[row], start[row + 1]):
        e = order[k]
        if u >= boxes[e, 0] and u <= boxes[e, 1] and v >= boxes[e, 2] and v <= boxes[e, 3]:
            return e
    return -1


@parallel
def shade(
    nets, start, order, boxes, corners, emitted, environment,
    directions, patch, u, v, facing, rgb, illuminance, normals,
):  # fmt: skip
    """Fill ``rgb (m, 3)`` [cd/m²], ``illuminance (m,)`` [lx] and ``normals (m, 3)`` of hits.

    ``start (2p + 1,)`` and ``order`` list the elements of patch side 2 p + side; ``corners``
    (n, 4, b + 1) are the reflected exitance and the illuminance at the corners (u0, v0), (u1, v0),
    (u1, v1), (u0, v1) of each element's box, ``emitted (n, 4, b)`` its emitted exitance there.
    """
    bands = emitted.shape[2]
    for group in nb.prange((directions.shape[0] + _GROUP - 1) // _GROUP):
        for r in range(group * _GROUP, min((group + 1) * _GROUP, directions.shape[0])):
            p = patch[r]
            if p < 0:
                if math.isnan(directions[r, 0]):
                    rgb[r, 0] = rgb[r, 1] = rgb[r, 2] = 0.0
                else:
                    environment_luminance(
                        environment, directions[r, 0], directions[r, 1], directions[r, 2], rgb[r]
                    )
                continue
            side = 1 if facing[r] < 0 else 0
            unit_normal(nets[p], u[r], v[r], normals[r])
            if side == 1:
                for k in range(3):
                    normals[r, k] = -normals[r, k]
            e = _find_element(start, order, boxes, 2 * p + side, u[r], v[r])
            if e < 0:
                # A side that no light was computed for: the inside of a solid.
                rgb[r, 0] = rgb[r, 1] = rgb[r, 2] = illuminance[r] = 0.0
                continue
            x = (u[r] - boxes[e, 0]) / (boxes[e, 1] - boxes[e, 0])
            y = (v[r] - boxes[e, 2]) / (boxes[e, 3] - boxes[e, 2])
            w0, w1, w2, w3 = (1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y
            for k in range(bands):
                value = (
                    w0 * (corners[e, 0, k] + emitted[e, 0, k])
                    + w1 * (corners[e, 1, k] + emitted[e, 1, k])
                    + w2 * (corners[e, 2, k] + emitted[e, 2, k])
                    + w3 * (corners[e, 3, k] + emitted[e, 3, k])
                )
                rgb[r, k] = value / math.pi
            for k in range(bands, 3):
                rgb[r, k] = rgb[r, 0]
            illuminance[r] = (
                w0 * corners[e, 0, bands]
                + w1 * corners[e, 1, bands]
                + w2 * corners[e, 2, bands]
                + w3 * corners[e, 3, bands]
            )
