"""Form factors between elements, and from points to elements."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .edges import make_edges, near_ratio, point_distance
from .errors import NumericsError
from .kernels.bulk import form_factor_rows
from .kernels.closure import multiply, sum_rows
from .kernels.edges import Edges
from .kernels.facets import Facets
from .kernels.nets import PLANAR
from .kernels.packed import add_products
from .kernels.pyramid import Blockers
from .kernels.rows import CELLS, DARK_PAIRS, SCANNED, TRACED, UNOCCLUDED, Sources
from .kernels.threads import threads_for
from .memory import DOUBLE_BYTES, ROW_BYTES, check_matrix
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.elements import Elements
from .model.sky import CIESky, Sky
from .packed import PackedMatrix
from .quadrics import fit_quadrics, turned
from .skies import sky_tone
from .tables import meridians, no_facets
from .topology import bounding_spheres, normal_cones, shape_flags, writable
from .walls import find_walls, walls_under

#: Rows per kernel call at least, and pairs: short enough to report progress and to obey Ctrl-C.
ROWS_PER_BLOCK, PAIRS_PER_BLOCK = 512, 16384
#: How often a partly hidden element is quartered at most.
LEVELS = 8
#: Products of numbers that NumPy takes no longer for than a kernel, and what a pair is worth.
SMALL, PRODUCTS_OF_PAIR = 1 << 18, 1000
#: Relative rounding of factors of single precision.
ROUNDING = 2.0**-24
#: Form factor of sky and ground above which a receiver sees out.
OUTSIDE = 1e-6

COUNTERS = {
    "pairs_dark": DARK_PAIRS,
    "pairs_without_blocker": UNOCCLUDED,
    "pairs_scanned": SCANNED,
    "pairs_traced": TRACED,
    "pyramid_cells": CELLS,
}


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Form factors from m receivers to n elements.

    Attributes
    ----------
    factors : (m, n) array
        Fraction of the light leaving receiver i that reaches element j, of double precision or,
        those of whole scenes, of single.
    variances : (m, n) float32 array
        Variance of the sampled part of each factor.
    counters : dict
        Pairs and cells by what was done with them.
    outside : (m, 5) array
        What the meridians saw of sky and ground: luminance times form factor of the sky [cd/m²],
        form factors of sky and ground, variances of the first and the last.
    sums : (m, 2) array, optional
        Sums of the factors and of their variances, found here unless they are given. Who changes
        the rows keeps them true.
    """

    factors: MatrixArray
    variances: NDArray[np.float32]
    counters: dict[str, int]
    outside: FloatArray
    sums: FloatArray = field(default_factory=lambda: np.empty((0, 2)))

    def __post_init__(self) -> None:
        if len(self.sums) != len(self.factors):
            sums = np.empty((len(self.factors), 2))
            sum_rows(self.factors, self.variances, sums)
            object.__setattr__(self, "sums", sums)

    def take(self, rows: IntArray) -> Rows:
        """Some of them, with the counters of all."""
        parts = (self.factors[rows], self.variances[rows], self.counters, self.outside[rows])
        return Rows(*parts, self.sums[rows])

    def of_elements(self, some: IntArray) -> MatrixArray:
        """Form factors (k, n) of whole elements in ``some`` rows (k,)."""
        return np.asarray(self.factors[some])

    def put(self, rows: IntArray, other: Rows) -> None:
        """Replace some of them."""
        self.factors[rows], self.variances[rows] = other.factors, other.variances
        self.outside[rows], self.sums[rows] = other.outside, other.sums

    def gather(self, light: FloatArray) -> FloatArray:
        """Light (m, ...) that the receivers get when the elements send ``light`` (n, ...)."""
        return products(self.factors, light)

    def variance_of(self, light: FloatArray) -> FloatArray:
        """Variance (m,) of what the receivers gather when the elements send ``light`` (n,)."""
        return products(self.variances, light**2)


def products(matrix: MatrixArray, light: FloatArray) -> FloatArray:
    """Product (m, ...) of a matrix (m, n) and ``light`` (n, ...), summed in double precision.

    The same bits for any number of threads.
    """
    if isinstance(matrix, PackedMatrix):
        return matrix.products(light)
    columns = writable(light.reshape(len(light), math.prod(light.shape[1:])).T)
    if matrix.size * len(columns) < SMALL:
        out = np.einsum("mn,cn->mc", matrix, columns)
    else:
        out = np.empty((len(matrix), len(columns)))
        with threads_for(matrix.size * len(columns) // PRODUCTS_OF_PAIR):
            multiply(matrix, columns, out)
    return out.reshape(len(matrix), *light.shape[1:])


def transposed_products(matrix: MatrixArray, values: FloatArray) -> FloatArray:
    """Product (n, ...) of a transposed matrix (m, n) and ``values`` (m, ...), as `products`."""
    if isinstance(matrix, PackedMatrix):
        return matrix.transposed_products(values)
    rows = writable(values.reshape(len(values), math.prod(values.shape[1:])).T)
    out = np.zeros((len(rows), matrix.shape[1]))
    add_products(matrix, rows, out)
    return np.ascontiguousarray(out.T).reshape(matrix.shape[1], *values.shape[1:])


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """How weak pairs are done.

    Attributes
    ----------
    facets : Facets
        Of the elements, from `tables.make_facets`.
    lines : int
        Meridians about each node.
    exact_above : (n,) array
        Unoccluded form factor above which a pair is traced by pyramids all the same.
    point_eps : float
        Error allowed to the unoccluded factor of a distant element told by one point, relative to
        the factor of one that faces the receiver; 0 for none. Elements with lines of sight are
        never done so.
    """

    facets: Facets
    lines: int
    exact_above: FloatArray
    point_eps: float = 0.0


def make_sources(
    elements: Elements,
    patch_nets: FloatArray,
    cell_eps: FloatArray,
    scan: Scan | None = None,
    dim: FloatArray | None = None,
    quadrics: FloatArray | None = None,
) -> Sources:
    """Pack elements as sources; they must be sorted by patch and side, as `make_elements` does.

    Parameters
    ----------
    elements : Elements
        n elements.
    patch_nets : (p, 4, 4, 4) array
        Control nets of the patches they lie on.
    cell_eps : (n,) array
        Form factor below which a partly hidden cell is sampled.
    scan : Scan, optional
        Finds the shares of weak pairs along meridians; without, every pair is traced.
    dim : (n,) array, optional
        Share of the error allowed to unoccluded factors that each may have; all of it by default.
    quadrics : (p, 5, 4) array, optional
        That the patches lie on, where they are known: see `kept_quadrics`.
    """
    key = elements.patch_index * 2 + elements.side
    first = np.flatnonzero(np.concatenate([[True], np.diff(key) != 0]))
    end = np.concatenate([first[1:], [len(key)]])
    patch = elements.patch_index[first]
    group_nets = patch_nets[patch].copy()
    flip = elements.side[first] == 1
    group_nets[flip] = group_nets[flip][:, ::-1]
    flags = shape_flags(group_nets)
    cones = normal_cones(elements.nets)
    own = np.zeros((len(first), 5, 4))
    curved = np.flatnonzero(flags & PLANAR == 0)
    of = patch[curved]
    fits = fit_quadrics(patch_nets[of]) if quadrics is None else quadrics[of]
    own[curved] = turned(fits, flip[curved])
    own = np.repeat(own, end - first, axis=0)
    edges = make_edges(
        elements.nets,
        patch_nets,
        elements.patch_index,
        elements.boxes,
        elements.side,
        cones,
        shared=scan is None,
    )
    return Sources(
        nets=writable(elements.nets),
        cones=cones,
        spheres=bounding_spheres(elements.nets),
        flags=np.repeat(flags, end - first),
        quadrics=writable(own),
        cell_eps=writable(cell_eps),
        patch=writable(elements.patch_index, np.int64),
        group=writable(np.stack([first, end, patch], axis=1), np.int64),
        group_points=writable(group_nets[:, 0, 0, :3] / group_nets[:, 0, 0, 3:]),
        group_cones=normal_cones(group_nets),
        group_spheres=bounding_spheres(group_nets),
        azimuths=meridians(0 if scan is None else scan.lines),
        exact_above=np.zeros(len(key)) if scan is None else writable(scan.exact_above),
        point_from=_point_from(edges, scan),
        dim=np.ones(len(key)) if dim is None else writable(dim),
        **find_walls(own, elements.areas)._asdict(),
        **edges._asdict(),
        **(no_facets() if scan is None else scan.facets)._asdict(),
    )


def _point_from(edges: Edges, scan: Scan | None) -> FloatArray:
    """Square of the distance (n,) from which elements are told by one point. [m²]"""
    if scan is None or scan.point_eps == 0.0:
        return np.full(edges.mean_point.shape[1], np.inf)
    told = np.diff(scan.facets.sight_start) > 0
    return np.where(told, np.inf, point_distance(edges, scan.point_eps) ** 2)


def form_factor_matrix(
    nodes: FloatArray,
    normals: FloatArray,
    weights: FloatArray,
    patches: IntArray,
    sources: Sources,
    blockers: Blockers,
    *,
    eps: float = 1e-6,
    trace: bool = True,
    levels: int = LEVELS,
    own: IntArray | None = None,
    lifts: FloatArray | None = None,
    sky: Sky | None = None,
    single: bool = False,
    first: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Rows:
    """Mean form factors from receivers (m, q, 3) to every source element.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node, rows summing to 1; 0 for nodes that get no light.
    patches : (m,) int array
        Patch each receiver lies on, −1 in the open.
    sources, blockers
        From `make_sources` and `topology.make_blockers`.
    eps : float
        Relative accuracy of unoccluded factors.
    trace : bool
        False where nothing can hide anything.
    levels : int
        How often a partly hidden element is quartered at most.
    own : (m,) int array, optional
        Element each receiver lies on, −1 in the open.
    lifts : (m,) array, optional
        How far the facets may lie before the surface a receiver is on. [m]
    sky : Sky, optional
        What is seen where the meridians meet nothing.
    single : bool
        Whether the factors are kept in single precision, to `ROUNDING` of each: 8 bytes a pair
        instead of 12, and the time to have them.
    first : int
        Number of the first receiver among all there are: meridians start at angles that differ
        from receiver to receiver.
    progress : callable, optional
        Called as ``progress(rows_done, rows_total)``.

    Raises
    ------
    NumericsError
        If a form factor is not finite.
    OutOfMemoryError
        If the factors do not fit into the memory that is free.
    """
    m, n = len(nodes), len(sources.nets)
    check_matrix(m, n, pair_bytes=ROW_BYTES if single else DOUBLE_BYTES)
    factors = np.empty((m, n), dtype=np.float32 if single else np.float64)
    variances, none = np.empty((m, n), dtype=np.float32), np.empty((0, n), dtype=np.float32)
    counters = np.zeros((m, len(COUNTERS)), dtype=np.int64)
    outside, sums = np.zeros((m, 5)), np.zeros((m, 2))
    # Without a sky its form factor is still asked for: one of 1 cd/m² all over tells its variance.
    tone = sky_tone(CIESky(5, zenith_luminance_cd_m2=1.0) if sky is None else sky)
    own = np.full(m, -1) if own is None else own
    lifts = np.zeros(m) if lifts is None else lifts
    walls = walls_under(nodes, normals, weights, sources.wall_spheres)
    block = max(ROWS_PER_BLOCK, PAIRS_PER_BLOCK // max(n, 1))
    for start in range(0, m, block):
        rows = slice(start, min(start + block, m))
        # What is traced takes a hundred times as long.
        with threads_for(len(nodes[rows]) * n * (100 if trace else 1)) as threads:
            form_factor_rows(
                writable(nodes[rows]),
                writable(normals[rows]),
                writable(weights[rows]),
                writable(patches[rows], np.int64),
                writable(own[rows], np.int64),
                walls[rows],
                writable(lifts[rows]),
                first + start,
                sources,
                blockers,
                near_ratio(eps),
                eps,
                trace,
                levels,
                tone,
                threads,
                np.empty((0, n)) if single else factors[rows],
                factors[rows] if single else none,
                variances[rows],
                outside[rows],
                sums[rows],
                counters[rows],
            )
        if not np.isfinite(sums[rows, 0]).all():
            i, j = np.argwhere(~np.isfinite(factors[rows]))[0]
            raise NumericsError(f"form factor from receiver {start + i} to element {j}: not finite")
        if progress is not None:
            progress(rows.stop, m)
    total = counters.sum(axis=0)
    counted = {name: int(total[c]) for name, c in COUNTERS.items()}
    by_area = np.bincount(sources.wall[sources.wall >= 0], minlength=len(sources.wall_spheres))
    nodes_on = (weights > 0.0).sum(axis=1)[walls >= 0]
    counted["pairs_by_area"] = int(by_area[walls[walls >= 0]] @ nodes_on)
    return Rows(factors, variances, counted, outside, sums)
