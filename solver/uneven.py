"""Direct light of lamps whose exitance varies over them, beyond that of even ones."""

from __future__ import annotations

import numpy as np

from .exchange import Rows
from .model.arrays import FloatArray
from .model.scene import SceneData
from .row_finder import Ask
from .stages import Stages
from .surfaces import Surfaces

#: Error of the shares of nodes in a form factor, against that of light that has been reflected.
FINE = 0.1


def add_uneven(
    direct: dict[str, FloatArray],
    rows: Rows,
    surfaces: Surfaces,
    asked: Ask,
    scene: SceneData,
    stages: Stages,
) -> FloatArray:
    """Add what the light of uneven lamps differs from that of even ones by; see `emission`.

    Parameters
    ----------
    direct : dict of (m, b) arrays
        Light of every group, with the means of all elements; changed in place. [lx]
    rows : Rows
        Form factors from m receivers to the elements of ``surfaces``.
    asked : Ask
        What the rows were asked for.

    Returns
    -------
    (m,) array
        Variance by what the polynomials miss. [lx²]
    """
    emission = surfaces.emission
    if emission is None:
        return np.zeros(len(rows.factors))
    with stages.run("uneven lamps"):
        factors = np.asarray(rows.factors[:, emission.element], dtype=np.float64)
        eps = FINE * asked.budget.moments
        light = factors * emission.light(factors, asked.receivers, asked.sources, eps)
        groups = np.array([scene.luminaires[row].group for row in emission.lamp])
        for group in dict.fromkeys(groups):
            own = groups == group
            direct[group] = direct[group] + light[:, own] @ emission.color[own]
        stages.count({"uneven_pairs": factors.size})
        # Half of the most that may be wrong is taken for a standard deviation.
        return np.asarray((0.5 * factors @ emission.missed) ** 2)
