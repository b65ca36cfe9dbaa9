"""The flux ledger of a solved field, with what panes and webs add to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .iterated import Finer
from .ledger import make_balance
from .model.result import Balance
from .solved_field import Field

if TYPE_CHECKING:
    from .field import FieldSolver


def balance_of(field: Field, finer: Finer, solver: FieldSolver, accuracy: float) -> Balance:
    """Flux ledger of a solved field, ``accuracy`` being what was asked for."""
    surfaces, of = field.surfaces, finer.unknowns.element
    lamps = {f"{group}.direct" for group in solver.lamp_groups}
    nothing = np.zeros((len(of), solver.bands))
    entered = [
        values
        for name, values in finer.arriving.components.items()
        if name.endswith(".direct") and name not in lamps
    ]
    balance = make_balance(
        solver.scene,
        finer.unknowns.areas,
        finer.kept,
        surfaces.reflectance[of],
        surfaces.diffuse_at(finer.unknowns),
        np.asarray(sum(finer.sent.values(), nothing)),
        np.asarray(sum(finer.arriving.components.values(), nothing)),
        np.asarray(sum(entered, nothing)),
        surfaces.material[of],
        np.where(surfaces.web, -1, surfaces.lamp)[of],
        solver.mirrors.share_of(surfaces)[of],
    )
    balance = solver.panes.in_ledger(
        balance,
        surfaces,
        lambda rows: field.unknowns.of_whole(field.system.factors, rows),
        surfaces.diffuse + finer.reflected,
        finer.light.components,
    )
    return solver.webs.in_ledger(balance, surfaces, accuracy, field.sees_out)
