"""The flux ledger: every lumen is emitted, entered, absorbed or escaped, or it is a residual."""

from __future__ import annotations

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.result import Balance, luminous
from .model.scene import SceneData

#: The ledger must close to this share of all light.
RESIDUAL_BOUND = 1e-3


def ledger_warning(balance: Balance, accuracy: float) -> tuple[str, ...]:
    """A line when the ledger lacks so much light that it matters for the ``accuracy`` asked for.

    What it lacks is in the stated errors, `OF_LACKING` times: it matters from where that is as much
    as all else may be.
    """
    from .mesh_error import OF_LACKING

    found = balance.residual_fraction
    if abs(found) <= RESIDUAL_BOUND or OF_LACKING * abs(found) <= 0.5 * accuracy:
        return ()
    what = "is lacking" if found > 0.0 else "comes from nowhere"
    return (
        f"flux ledger: {100.0 * abs(found):.2g} % of all light ({abs(balance.residual_lm):.3g} lm) "
        f"{what}: much beside the accuracy asked for, {accuracy:g}. The stated errors hold it; a "
        "smaller accuracy makes it less",
    )


def make_balance(
    scene: SceneData,
    areas: FloatArray,
    kept: FloatArray,
    reflectance: FloatArray,
    emitted: FloatArray,
    reflected: FloatArray,
    irradiance: FloatArray,
    entered: FloatArray,
    material: IntArray,
    lamp: IntArray,
    mirrored: FloatArray,
) -> Balance:
    """Add up fluxes over the elements.

    What leaves an element and meets no other one has escaped: 1 − Σ_j F_ij of it. The residual is
    then Σ_ij (A_j F_ji − A_i F_ij) B_j, the failure of reciprocity of the form factors.

    Parameters
    ----------
    areas : (n,) array
        Areas that take part in the exchange. [m²]
    kept : (n,) array
        Share of the light leaving each that meets the scene again, Σ_j F_ij.
    reflectance, emitted, reflected, irradiance, entered : (n, b) array
        By band; ``entered`` is the irradiance from sky, sun and ground.
    material, lamp : (n,) int array
        Material and luminaire of each element.
    mirrored : (n,) array
        Share of the light on each that it mirrors: that counts where it comes to.
    """
    stays = 1.0 - mirrored
    absorbed = luminous((stays[:, None] - reflectance) * irradiance) * areas
    leaving = luminous(emitted + reflected) * areas
    names = [m.name or f"material {k + 1}" for k, m in enumerate(scene.materials)]
    by_material: dict[str, float] = {}
    for row in np.unique(material):
        name = names[row] if row >= 0 else "black"
        flux = float(absorbed[material == row].sum())
        by_material[name] = by_material.get(name, 0.0) + flux
    by_group: dict[str, float] = {}
    source = luminous(emitted) * areas
    for row in np.unique(lamp[lamp >= 0]):
        group = scene.luminaires[row].group
        by_group[group] = by_group.get(group, 0.0) + float(source[lamp == row].sum())
    return Balance(
        emitted_lm=float(source.sum()),
        entered_lm=float((luminous(entered) * areas) @ stays),
        absorbed_lm=float(absorbed.sum()),
        escaped_lm=float(leaving @ (1.0 - kept)),
        absorbed_by_material=by_material,
        emitted_by_group=by_group,
    )
