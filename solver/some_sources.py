"""Some of the elements of a mesh as sources of light, by themselves."""

from __future__ import annotations

import numpy as np

from .kernels.rows import Sources
from .model.arrays import IntArray
from .tables import no_facets
from .topology import writable

#: Arrays of `Sources` whose rows are elements, and those whose columns are.
_ROWS = (
    "nets", "cones", "spheres", "flags", "quadrics", "cell_eps", "patch", "wall", "wall_share",
    "edge_of", "edge_range", "edge_error", "edge_sign", "mean_parts", "exact_above", "point_from",
    "dim",
)  # fmt: skip
_COLUMNS = "area_point", "area_normal", "mean_point", "mean_area", "mean_reach"


def some_sources(sources: Sources, which: IntArray) -> Sources:
    """The elements ``which`` (k,), sorted, without the facets that meridians and rays meet."""
    ends = np.searchsorted(which, sources.group[:, :2])
    return sources._replace(
        **{name: np.ascontiguousarray(getattr(sources, name)[which]) for name in _ROWS},
        **{name: np.ascontiguousarray(getattr(sources, name)[:, which]) for name in _COLUMNS},
        group=writable(np.column_stack([ends, sources.group[:, 2]]), np.int64),
        **no_facets()._asdict(),
    )
