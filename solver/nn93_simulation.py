"""The simulation of a frozen scene by the method of Nishita and Nakamae 1993, for comparison.

What is not the method's own is as in `simulation`: light of sky, sun and ground on the corners,
pictures, and the ledger. The paper states no error; here the scene is solved besides on a mesh of
twice the size, and the difference is given for one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .errors import InputError
from .exchange import ROUNDING
from .field import FieldSolver
from .field_balance import balance_of
from .iterated import as_it_is
from .kept_error import KeptError
from .mesh import Boxes
from .mesh_error import MeshError
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.scene import SceneData
from .nn93_field import CornerField, CornerSolver, Eyes
from .reuse import Kept
from .rule_error import OF_RULES
from .sensor_results import sensor_result
from .simulation import Options, Simulation, Solved
from .stages import Stages

#: Said with every result.
STATED = (
    "method nn93: errors are the difference to a mesh of twice the size; those of shadows and of "
    "polygons are not in them"
)


class Nn93Simulation(Simulation):
    """One run by the method of 1993."""

    method, basis = "nn93", "corners"
    #: Unknowns of the mesh that is taken.
    _corners = 0

    def __init__(
        self,
        scene: SceneData,
        accuracy: float,
        visibility: str,
        stages: Stages,
        options: Options,
    ) -> None:
        if options.basis is not None:
            raise InputError(f"basis = {options.basis!r}: not used together with method = 'nn93'")
        without = (
            (bool(scene.glazings), "glass"),
            (any(m.mirror_bands.any() for m in scene.materials), "mirrors"),
            (any(lamp.web is not None for lamp in scene.luminaires), "photometric files"),
            (bool(scene.outdoor_parts), "parts that stand outdoors"),
        )
        for there, what in without:
            if there:
                raise InputError(f"method = 'nn93': it knows no {what}; use the default method")
        super().__init__(scene, accuracy, visibility, stages, replace(options, cache=False))

    def solved(self, solver: FieldSolver, kept: Kept) -> Solved:
        self.stages.warnings.append(STATED)
        solver.highlights.conserving = False  # eq. 15 and 16
        corners = CornerSolver(solver, self.budget)
        fine, coarse = corners.boxes()
        found = corners.solve(fine, adapt=True)
        # The coarser mesh is left as it is: that what the cuts change is an error, too, is on the
        # safe side.
        rough = corners.solve(coarse, adapt=False)
        field = corners.as_field(found)
        self._corners = len(found.vertices)
        finer = replace(as_it_is(field), shift=_difference(found, rough, coarse))
        balance = balance_of(field, finer, solver, self.budget.accuracy)
        error = MeshError(0.0, 0.0)
        sensors, without_mesh = {}, {}
        for k, grid in enumerate(self.scene.sensors):
            eyes = Eyes.of_sensors(grid)
            with self.stages.run("sensors"):
                seen = corners.look(eyes, found.surfaces, found.vertices)
                light = found.gathered(seen)
                before = rough.gathered(corners.look(eyes, rough.surfaces, rough.vertices))
            off = np.abs(light.luminous() - before.luminous())
            # One value's difference may pass through zero.
            shift = error.of(light, np.maximum(off, np.sqrt(np.mean(off**2))))
            light = solver.highlights.added(
                light, grid, corners.rows(seen), field, finer, self.budget
            )
            rules = (OF_RULES * self.budget.fine_eps + ROUNDING) * light.luminous()
            sensors[grid.name] = sensor_result(self.scene, k, light, shift + rules)
            without_mesh[grid.name] = sensor_result(self.scene, k, light, rules)
        nothing = KeptError.none(np.zeros(len(field.surfaces.areas)))
        return Solved(field, finer, balance, error, nothing, sensors, without_mesh)

    def _count(self, elements: Elements, unknowns: int) -> None:
        super()._count(elements, self._corners)  # nodes only hand them on


def _difference(found: CornerField, rough: CornerField, coarse: Boxes) -> FloatArray:
    """By how much (n,) the illuminance of elements differs from that on a coarser mesh. [lx]"""
    elements = found.surfaces.elements
    middle = elements.boxes.reshape(-1, 2, 2).mean(axis=2)
    out = np.empty(len(elements))
    light, corners = rough.illuminance[rough.vertices.of], found.vertices.of
    own = found.illuminance[corners].mean(axis=1)
    for k, (patch, side) in enumerate(zip(elements.patch_index, elements.side, strict=True)):
        low = np.searchsorted(coarse.patch, patch)
        high = np.searchsorted(coarse.patch, patch, side="right")
        ends, at = coarse.ends[low:high], middle[k]
        inside = (coarse.side[low:high] == side) & (ends[:, 0] <= at[0]) & (at[0] <= ends[:, 1])
        row = low + int(np.argmax(inside & (ends[:, 2] <= at[1]) & (at[1] <= ends[:, 3])))
        u0, u1, v0, v1 = coarse.ends[row]
        s, t = (at[0] - u0) / (u1 - u0), (at[1] - v0) / (v1 - v0)
        if side == 1:
            s = 1.0 - s  # nets of − sides run the other way along u
        share = np.array([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t])
        out[k] = abs(own[k] - share @ light[row])
    return out
