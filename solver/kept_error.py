"""What rows of form factors that stayed as they were, though something has moved, may have wrong.

The light on each receiver is off by no more than `change_bounds` tells, with the exitances that
were found, the largest at the unknowns of each element. What that makes of all other light is one
solution more of the system, and one gather, with no negative term. It is a bound to first order:
exitances are those that were found with these rows themselves, between its unknowns an element may
be brighter, and what is missing of the flux of lamps has been given to other elements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .change_bounds import bounds_of_change
from .exchange import products
from .iterated import Finer
from .krylov import solve_all
from .model.arrays import FloatArray, IntArray
from .model.reached import FLOOR, KEPT_BY
from .reuse import Kept, OldRows
from .solved_field import Field, SensorRows

#: Share of the accuracy asked for that rows may have wrong at nearly all sensors of a grid; beyond
#: it they are found anew.
AT_MOST = 0.2
#: Relative residual of what they make of other light.
TOLERANCE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class KeptError:
    """Bounds to first order, by grid of sensors (m,) and on the elements (n,). [lx]"""

    sensors: list[FloatArray]
    elements: FloatArray

    @classmethod
    def none(cls, elements: FloatArray, *sensors: FloatArray) -> KeptError:
        """That of rows that are as they are found now: 0 in arrays like these."""
        return cls([np.zeros(len(grid)) for grid in sensors], np.zeros(len(elements)))

    def is_within(self, accuracy: float, illuminances: list[FloatArray]) -> bool:
        """Whether it is small enough against the light (m,) at the sensors. [lx]"""
        for error, light in zip(self.sensors, illuminances, strict=True):
            mean = float(light.mean())
            relative = error / np.maximum(light, max(FLOOR * mean, 1e-300))
            if np.quantile(relative, KEPT_BY, method="lower") > AT_MOST * accuracy:
                return False
        return True


def kept_error(field: Field, finer: Finer, kept: Kept, seen: dict[str, SensorRows]) -> KeptError:
    """Bound of what old rows have wrong of the light of ``field``, and of ``finer`` light.

    ``seen`` is what sensors see, by the name of their grid.
    """
    elements = len(field.surfaces.areas)
    if not kept.old_rows:
        return KeptError.none(field.surfaces.areas, *(s.rows.sums for s in seen.values()))
    of = kept.scene.patches.part_index
    light, unknowns = field.brightest, field.unknowns
    off = np.zeros(len(unknowns))
    coarse, fine = (kept.old_rows.get(name) for name in ("form factors", "iterated gather"))
    if coarse is not None:
        off = _off(coarse, light, of)
    if fine is not None:
        own = fine.asked.receivers.own
        count = np.bincount(own, minlength=elements)
        mean = np.bincount(own, weights=_off(fine, light, of), minlength=elements)
        off = np.maximum(off, (mean / np.maximum(count, 1))[unknowns.element])
    rho, factors = field.system.reflectance.max(axis=1)[:, None], field.system.factors
    solved = solve_all(
        lambda x, columns: np.asarray(x - rho * products(factors, x)),
        rho * off[:, None],
        tolerance=TOLERANCE,
    )
    sent = (1.0 + TOLERANCE) * np.maximum(solved.values[:, 0], 0.0)
    on_elements = unknowns.mean(off + products(factors, sent))
    whole = unknowns.mean(sent)
    sensors = []
    for name, grid in seen.items():
        old = kept.old_rows.get("sensors" + name)
        found = products(grid.rows.factors, whole)
        sensors.append(found if old is None else found + _off(old, light, of))
    return KeptError(sensors, on_elements)


def _off(old: OldRows, light: FloatArray, of: IntArray) -> FloatArray:
    """Upper bound (m,) of what is wrong of the light on the receivers of some rows. [lx]"""
    history, asked = old.history, old.asked
    stand = history.stands[-1]
    return bounds_of_change(old.rows, history, asked, stand, light, old.which, of)
