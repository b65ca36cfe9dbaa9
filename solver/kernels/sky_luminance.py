"""Luminance of a sky in one direction; the parameters are packed by `skies.sky_parameters`."""

import math

from .compiled import lean

#: Length of the parameter array: form, a, b, c, d, e, factor [cd/m²].
PARAMETERS = 7
#: Forms: gradation times indicatrix (types 1-15), and the traditional overcast sky (type 16).
GENERAL, TRADITIONAL_OVERCAST = 0.0, 1.0


@lean
def sky_luminance(parameters, sx, sy, sz, dx, dy, dz):
    """Luminance of the sky in the unit direction d, the sun being in the unit direction s. [cd/m²]

    Below the horizon the gradation keeps its value at the horizon, so the result is finite.
    """
    z = max(dz, 0.0)
    if parameters[0] == TRADITIONAL_OVERCAST:
        return parameters[6] * (1.0 + 2.0 * z)
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
