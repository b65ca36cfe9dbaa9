"""Elements of one mesh as sources of light: the brighter one is, the more finely it is told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .budget import EXACT_AT_SENSORS, Budget
from .exchange import Scan, make_sources
from .fineness import Fineness
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.result import luminous
from .model.scene import SceneData
from .pane_field import PaneField
from .sights import with_sights
from .surfaces import Surfaces
from .tables import facet_turn, make_facets, meridians

if TYPE_CHECKING:
    from .solved_field import Field

#: Size of sampled cells at sensors against those between surfaces.
SENSOR_SHARE = 0.1
#: Exitance of elements told by lines of sight, against the mean of all surfaces.
BRIGHT = 4.0
#: Error of factors told by one point against that of other unoccluded factors: it has either sign,
#: and few elements come near to it.
POINT_SHARE = 2.5
#: The same of large meshes, whose elements pave what is far off: errors of neighbours cancel.
POINT_SHARE_OF_MANY = 25.0


def fineness_of(scene: SceneData, panes: PaneField, budget: Budget, surfaces: Surfaces) -> Fineness:
    """How finely each source is told: the brighter one is, the finer."""
    count = len(panes.opaque(surfaces.elements))
    emitted, areas = (a[:count] for a in (luminous(surfaces.emitted), surfaces.areas))
    # What all there is would get of the lamps' light, or a box about it where most escapes.
    mean = float(emitted @ areas) / max(float(areas.sum()), _box_area(scene))
    dim = np.where(emitted > mean, mean / np.maximum(emitted, 1e-300), 1.0)
    cell_eps = budget.cell_eps * mean / np.maximum(emitted, max(mean, 1e-300))
    cell_eps = np.where(emitted > 0.0, cell_eps, budget.cell_eps)
    cell_eps = np.clip(cell_eps, budget.lamp_cell_eps, budget.cell_eps)
    return Fineness(cell_eps, emitted > BRIGHT * mean, dim)


def _box_area(scene: SceneData) -> float:
    """Surface of the box about all patches and sensors. [m²]"""
    ends = [scene.patches.bounds(), *((g.points, g.points) for g in scene.sensors)]
    low = np.min([np.min(np.atleast_2d(a), axis=0) for a, _ in ends], axis=0)
    high = np.max([np.max(np.atleast_2d(b), axis=0) for _, b in ends], axis=0)
    x, y, z = high - low
    return float(2.0 * (x * y + y * z + z * x))


def sources_of(
    scene: SceneData,
    blockers: Blockers,
    panes: PaneField,
    budget: Budget,
    elements: Elements,
    fineness: Fineness,
    quadrics: FloatArray,
    *,
    trace: bool,
) -> tuple[Sources, FloatArray]:
    """Elements as sources, and how far their facets leave them.

    The finer cells of one are cut, the weaker are the pairs that are traced. ``quadrics`` (p, 5, 4)
    are those that the patches lie on.
    """
    nets, opaque = scene.patches.control_points, panes.opaque(elements)
    if not trace:
        sources = make_sources(opaque, nets, fineness.cell_eps, None, fineness.dim, quadrics)
        return sources, np.zeros(len(elements))
    of = nets, blockers.closed, blockers.solid
    size = budget.size if budget.is_large else 0.0
    facets, lifts = make_facets(opaque, *of, size, facet_turn(budget.accuracy))
    facets = with_sights(facets, opaque, blockers.solid, fineness.bright, budget.sights)
    cell_eps = fineness.cell_eps
    exact_above = np.full(len(cell_eps), budget.exact_above)
    # As much light as an element of mean brightness sends at the threshold.
    told = np.diff(facets.sight_start) > 0
    exact_above[~told] *= cell_eps[~told] / budget.cell_eps
    share = POINT_SHARE_OF_MANY if budget.is_large else POINT_SHARE
    scan = Scan(facets, budget.lines, exact_above, share * budget.eps)
    sources = make_sources(opaque, nets, cell_eps, scan, fineness.dim, quadrics)
    return sources, panes.lifts(lifts, elements)


def sources_at_sensors(field: Field, budget: Budget) -> Sources:
    """Those of a solved field as sensors see them.

    No average over nodes and bounces hides the sampling of a single sensor.
    """
    sources = field.sources
    fine = sources._replace(
        cell_eps=sources.cell_eps * SENSOR_SHARE,
        exact_above=np.where(
            field.fineness.bright,
            sources.cell_eps * (EXACT_AT_SENSORS * budget.accuracy / budget.cell_eps),
            sources.cell_eps * (budget.sensor_exact_above / budget.cell_eps),
        ),
        azimuths=meridians(budget.sensor_lines if len(sources.azimuths) else 0),
        point_from=np.full_like(sources.point_from, np.inf),
    )
    if field.surfaces.emission is not None:
        # Which part of a lamp is hidden counts where its parts differ.
        fine.exact_above[field.surfaces.emission.element] = 0.0
    return fine
