"""Errors fall with the size of the elements and with the accuracy asked for."""

import dataclasses

import numpy as np
import pytest
from patchlight.pipeline import simulate
from patchlight.solver.budget import Budget
from patchlight.solver.field import FieldSolver
from patchlight.solver.iterated import as_it_is
from patchlight.solver.mesh import Boxes
from patchlight.solver.stages import Stages

from ..solver.fixtures_light import Body, setup


def errors_of_meshes(reference, divisions, basis):
    """Root mean square relative errors on uniform meshes, without the iterated gather."""
    data, truth, found = reference.scene(), reference.truth(), []
    # As one closed cavity nothing hides anything: the meshes are all that there is of errors.
    parts = setup(Body(data.patches))
    for count in divisions:
        budget = Budget.of(data, 1e-5, basis)
        counts = np.maximum(np.round(count * extents(data.patches)), 1).astype(int)
        budget = dataclasses.replace(budget, divisions=counts, size=0.0)
        solver = FieldSolver(data, parts.blockers, trace=False, stages=Stages())
        boxes = Boxes.regular(counts, np.zeros(len(counts), bool))
        field = solver.solve(budget, boxes)
        seen = solver.seen(data.sensors[0], budget, field)
        light, *_ = solver.gather(data.sensors[0], seen, field, as_it_is(field))
        found.append(float(np.sqrt(np.mean((light.luminous() / truth - 1.0) ** 2))))
    return np.array(found)


def extents(patches):
    """Lengths (p, 2) of the sides along u and v of flat rectangles, in metres."""
    corner = patches.evaluate(0.0, 0.0)
    return np.stack(
        [np.linalg.norm(patches.evaluate(*at) - corner, axis=1) for at in ((1.0, 0.0), (0.0, 1.0))],
        axis=1,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("basis", "least"), [("bilinear", 2.0), ("constant", 1.5)])
def test_order_of_uniform_meshes(basis, least):
    """Errors at the work plane of a plain room fall with that power of the elements' size."""
    from references import reference

    divisions = np.array([0.5, 1.0, 2.0, 4.0])
    errors = errors_of_meshes(reference("C3"), divisions, basis)
    slope = -np.polyfit(np.log(divisions), np.log(errors), 1)[0]
    assert slope >= least, (errors, slope)


ACCURACIES = (0.1, 0.03, 0.01, 0.003, 0.001)


@pytest.mark.parametrize(
    "name",
    [
        "CIE_5.3",
        "C2_rho50",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("C3", "C3_surf", "CIE_5.7", "D2", "D2_clear", "Ward", "dome")
        ),
    ],
)
def test_errors_never_grow_with_the_accuracy(name):
    """By no more than a fifth, beside single precision and what is unknown of the truth."""
    from references import reference

    one = reference(name)
    data, truth = one.scene(), one.truth()
    least = 2e-7 + one.doubt
    found = []
    for accuracy in ACCURACIES:
        values = simulate(data, accuracy=accuracy).sensors["sensors"].illuminance_lx
        found.append(float(np.sqrt(np.mean((values / truth - 1.0) ** 2))))
    for k, error in enumerate(found):
        assert error <= ACCURACIES[k]
        assert k == 0 or error <= 1.2 * found[k - 1] + least, found
