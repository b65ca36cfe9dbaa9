"""Luminance of a sky in one direction; the parameters are packed by `skies.sky_parameters`."""

import math

from .compiled import lean

#: Length of the parameter array: form, a, b, c, d, e, factor [cd/m²].
PARAMETERS = 7
#: Forms: gradation times indicatrix (types 1-15), the traditional overcast sky (type 16), the
#: intermediate sky of Radiance's gensky, and patches of even luminance.
GENERAL, TRADITIONAL_OVERCAST, INTERMEDIATE, PATCHES = 0.0, 1.0, 2.0, 3.0
#: Rows of the patches, from the horizon to the zenith, and their height. [rad]
ROWS, ROW_HEIGHT = 8, math.pi / 15.0
#: Patches of each row, and how many lie below it.
COUNTS, BELOW = (30, 30, 24, 24, 18, 12, 6, 1), (0, 30, 60, 84, 108, 126, 138, 144)


@lean
def patch_number(dx, dy, dz):
    """Number of the patch that a unit direction of the upper hemisphere lies in.

    Patches are counted from the lowest row upwards, in each row clockwise from the one whose middle
    is north.
    """
    row = min(int(math.asin(min(max(dz, 0.0), 1.0)) / ROW_HEIGHT), ROWS - 1)
    count = COUNTS[row]
    turn = math.atan2(dx, dy) / (2.0 * math.pi) * count
    return BELOW[row] + int(math.floor(turn + 0.5)) % count


@lean
def _intermediate(parameters, sx, sy, sz, dx, dy, dz):
    """The intermediate sky over its factor; see `patchlight.solver.gensky`."""
    cosine = sx * dx + sy * dy + sz * dz
    cx, cy, cz = sy * dz - sz * dy, sz * dx - sx * dz, sx * dy - sy * dx
    angle = math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), cosine)
    zenith = math.atan2(math.sqrt(dx * dx + dy * dy), max(dz, 0.0))
    level = (1.35 * math.sin(5.631 - 3.59 * zenith) + 3.12) * parameters[2] + 6.37 - zenith
    return level * math.exp(-0.563 * angle * ((2.629 - zenith) * parameters[4] + 0.812))


@lean
def sky_luminance(parameters, sx, sy, sz, dx, dy, dz):
    """Luminance of the sky in the unit direction d, the sun being in the unit direction s. [cd/m²]

    Below the horizon the gradation keeps its value at the horizon, so the result is finite.

    Of patches the array holds the relative luminances besides, from its place ``parameters[2]`` on.
    """
    z = max(dz, 0.0)
    if parameters[0] == TRADITIONAL_OVERCAST:
        return parameters[6] * (1.0 + 2.0 * z)
    if parameters[0] == PATCHES:
        return parameters[6] * parameters[int(parameters[2]) + patch_number(dx, dy, dz)]
    if parameters[0] == INTERMEDIATE:
        return parameters[6] * _intermediate(parameters, sx, sy, sz, dx, dy, dz)
    gradation = 1.0
    if z > 0.0:
        gradation += parameters[1] * math.exp(parameters[2] / z)
    indicatrix = 1.0
    if parameters[3] != 0.0 or parameters[5] != 0.0:
        cosine = sx * dx + sy * dy + sz * dz
        cx, cy, cz = sy * dz - sz * dy, sz * dx - sx * dz, sx * dy - sy * dx
        # The arc tangent keeps full precision close to the sun, where the luminance has its cusp.
        angle = math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), cosine)
        glow = math.exp(parameters[4] * angle) - math.exp(parameters[4] * 0.5 * math.pi)
        indicatrix += parameters[3] * glow + parameters[5] * cosine * cosine
    return parameters[6] * gradation * indicatrix


@lean
def sky_luminances(parameters, sx, sy, sz, directions, out):
    """`sky_luminance` of unit directions (n, 3) into ``out (n,)``. [cd/m²]"""
    for i in range(directions.shape[0]):
        out[i] = sky_luminance(
            parameters, sx, sy, sz, directions[i, 0], directions[i, 1], directions[i, 2]
        )
