"""Form factors from points and between elements: the public entry, without a scene.

The form factor is the fraction of the light leaving a point that reaches the visible + side of a
patch, F = (1/π) ∫ cosθ_r cosθ_s V / r² dA [1, eq. 4.10; 2, eq. 2].

References
----------
.. [1] J. R. Howell, M. P. Mengüç, K. Daun, R. Siegel, "Thermal Radiation Heat Transfer", 7th ed.,
   CRC Press, 2020.
.. [2] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError
from .memory import DOUBLE_BYTES, check_matrix
from .model.arrays import FloatArray, check_finite, check_shape
from .model.elements import Elements
from .model.form_factors import FormFactors
from .model.patches import PatchSet
from .prepared import Prepared, prepare
from .surfaces import Receivers

if TYPE_CHECKING:
    from .exchange import Rows
    from .kernels.pyramid import Blockers
    from .kernels.rows import Sources

Visibility = Literal["auto", "strict", "none"]

#: No accuracy is asked below this. [1]
ABSOLUTE = 1e-12
#: Levels of quartering of a partly hidden patch: 4^-14 of it.
_LEVELS = 14
#: Cells that may bracket the silhouettes of a source whose hiding is ignored.
_PLAIN_CELLS = 20_000
#: What a pair takes in memory at the same time: six matrices of factors and variances.
_PAIR_BYTES = 6 * DOUBLE_BYTES
#: Cells that a pair may take before "auto" samples it: enough for one outline to 1e-5.
_FEW_CELLS = 2000
#: Share of the accuracy asked for that "auto" states as the error of what it does not sample: twice
#: the largest seen.
_STATED = 0.5
#: Least accuracy asked of the kernel.
_LEAST = 1e-13
#: Factor of what is seen against that of what would face the receiver, below which it is found with
#: more digits.
_GRAZING = 0.2
#: Stands for what a receiver lies on until that is found.
UNKNOWN = -2
#: Standard deviations of the sampled part that "auto" states as its error.
_DEVIATIONS = 3.0


def point_form_factors(
    points: ArrayLike,
    normals: ArrayLike,
    sources: PatchSet,
    blockers: PatchSet | None = None,
    *,
    accuracy: float = 1e-4,
    visibility: Visibility = "auto",
    method: Literal["default", "nn93"] = "default",
) -> FormFactors:
    """Form factors from points to curved patches.

    Parameters
    ----------
    points : (m, 3) array
        Receiving points. [m]
    normals : (m, 3) array
        Their normals, of any length, or one (3,) for all; what lies behind a point does not count.
    sources : PatchSet
        Source patches: they count on their + side only, and hide one another and themselves.
    blockers : PatchSet, optional
        Patches that hide light from both sides besides. One identical to a source is none.
    accuracy : float
        Largest |value − true| relative to the patch's own factor without any hiding, but never
        below 1e-12 absolute.
    visibility : "auto", "strict" or "none"
        "auto" integrates the contour of what is seen, brackets pairs where that does not serve as
        "strict" does as long as it takes few cells, samples partly hidden cells of the rest and
        estimates the error; "strict" proves all brackets, up to rounding; "none" ignores all hiding
        except that of back faces, and brackets the quadrature, proved likewise.
    method : "default" or "nn93"
        "nn93" is the method of Nishita and Nakamae [1] as published, for comparison.

    Returns
    -------
    FormFactors
        (m, n) arrays. [1]

    Raises
    ------
    InputError
        If a shape, value or option cannot be used.
    NumericsError
        If a form factor is not finite.
    OutOfMemoryError
        If the factors do not fit into the memory that is free.

    References
    ----------
    .. [1] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
       Patches", 1993.
    """
    x, n = _receivers(points, normals)
    _check_options(accuracy, visibility)
    _check_patches("sources", sources)
    _check_patches("blockers", blockers, optional=True)
    if method == "nn93":
        from .nn93 import nn93_form_factors

        return nn93_form_factors(x, n, sources, blockers, accuracy=accuracy, visibility=visibility)
    if method != "default":
        raise InputError(f"method = {method!r}: must be 'default' or 'nn93'")
    if len(x) == 0 or len(sources) == 0:
        return _nothing(len(x), len(sources), visibility)
    check_matrix(len(x), len(sources), pair_bytes=_PAIR_BYTES)
    receivers = Receivers.of_points(x, n, np.ones(len(x)), np.full(len(x), UNKNOWN))
    prepared = prepare(sources.control_points, blockers)
    return _factors(receivers, prepared, accuracy=accuracy, visibility=visibility)


def form_factors(
    elements: Elements | PatchSet,
    *,
    blockers: PatchSet | None = None,
    accuracy: float = 1e-4,
    visibility: Visibility = "auto",
) -> FormFactors:
    """Form factors from the collocation nodes of elements to all elements.

    Parameters
    ----------
    elements : Elements or PatchSet
        n elements with q nodes each; a `PatchSet` gives one element with 2 x 2 nodes a patch.
        The factor of a whole element is the mean over its nodes by ``Elements.weights``: of four
        nodes to some percent where elements touch, the better the smaller they are.
    blockers, accuracy, visibility
        As in `point_form_factors`.

    Returns
    -------
    FormFactors
        (n q, n) arrays: the nodes of element 0, of element 1 … Buried nodes get no light. [1]

    Raises
    ------
    InputError, GeometryError, NumericsError, OutOfMemoryError
        As `point_form_factors`; `GeometryError` if a patch has no area.
    """
    _check_options(accuracy, visibility)
    _check_patches("blockers", blockers, optional=True)
    if not isinstance(elements, Elements):
        _check_patches("elements", elements)
        from .mesh import make_elements

        count = len(elements)
        elements = make_elements(elements, np.zeros(count, bool), np.ones((count, 2), np.int64))
    nodes, count = elements.weights.size, len(elements)
    if nodes == 0:
        return _nothing(nodes, count, visibility)
    check_matrix(nodes, count, pair_bytes=_PAIR_BYTES)
    prepared = prepare(elements.nets, blockers)
    receivers = Receivers.of_points(
        elements.nodes.reshape(-1, 3),
        elements.normals.reshape(-1, 3),
        np.where(elements.buried, 0.0, 1.0).ravel(),
        np.repeat(prepared.sources.patch, elements.weights.shape[1]),
    )
    return _factors(receivers, prepared, accuracy=accuracy, visibility=visibility)


def _nothing(m: int, n: int, visibility: str) -> FormFactors:
    """Factors (m, n) of which there are none."""
    empty = np.zeros((m, n))
    return FormFactors(empty, empty, empty, visibility != "auto")


def _check_options(accuracy: float, visibility: str) -> None:
    if not (math.isfinite(accuracy) and 0.0 < accuracy < 1.0):
        raise InputError(f"accuracy = {accuracy}: must lie between 0 and 1")
    if visibility not in ("auto", "strict", "none"):
        raise InputError(f"visibility = {visibility!r}: must be 'auto', 'strict' or 'none'")


def _check_patches(name: str, given: object, *, optional: bool = False) -> None:
    if not (isinstance(given, PatchSet) or (optional and given is None)):
        raise InputError(f"{name}: a {type(given).__name__}, but a PatchSet was expected")


def _receivers(points: ArrayLike, normals: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Points (m, 3) and unit normals (m, 3), checked."""
    x = np.atleast_2d(np.asarray(points, dtype=np.float64))
    check_shape("points", x, (None, 3))
    check_finite("points", x)
    n = np.atleast_2d(np.asarray(normals, dtype=np.float64))
    if len(n) == 1:
        n = np.broadcast_to(n, x.shape)
    check_shape("normals", n, x.shape)
    check_finite("normals", n)
    length = np.linalg.norm(n, axis=1)
    if (length == 0.0).any():
        raise InputError(f"normals[{int(np.argmin(length))}] = (0, 0, 0): must have a direction")
    return x, np.ascontiguousarray(n / length[:, None])


def _factors(
    receivers: Receivers, prepared: Prepared, *, accuracy: float, visibility: Visibility
) -> FormFactors:
    """All three ways; where it is `UNKNOWN` what receivers lie on, that is found here."""
    sources, surfaces = prepared.sources, prepared.surfaces
    x = receivers.nodes[:, 0]
    if (receivers.patches == UNKNOWN).any():
        receivers = replace(receivers, patches=prepared.under(x))
    plain = _plain(receivers, prepared, accuracy)
    if visibility != "auto":
        from .strict import MOST_CELLS, strict_form_factors

        hide = visibility == "strict"
        most_cells = MOST_CELLS if hide else _PLAIN_CELLS
        return strict_form_factors(
            receivers, sources, surfaces, plain, accuracy, hide=hide, most_cells=most_cells
        )
    if prepared.nothing_hides:
        error = _STATED * accuracy * plain.factors + ABSOLUTE
        low, high = np.maximum(plain.factors - error, 0.0), plain.factors + error
        return FormFactors(plain.factors, low, high, False, plain.counters)
    return _estimated(receivers, prepared, plain, accuracy)


def _rows(
    receivers: Receivers, sources: Sources, surfaces: Blockers, eps: float, *, trace: bool
) -> Rows:
    from .exchange import form_factor_matrix

    return form_factor_matrix(
        receivers.nodes,
        receivers.normals,
        receivers.weights,
        receivers.patches,
        sources,
        surfaces,
        eps=eps,
        trace=trace,
        levels=_LEVELS,
    )


def _plain(receivers: Receivers, prepared: Prepared, accuracy: float) -> Rows:
    """Factors without hiding.

    Both a point's distance and a patch's size tell how small a factor may be. What is seen at a
    grazing angle, or just over the horizon, is smaller still, while the errors of its edges are as
    large: once that is known, it is found again with more digits.
    """
    sources, surfaces = prepared.sources, prepared.surfaces
    x = receivers.nodes[:, 0]
    eps = _digits(x, sources, accuracy)
    plain = _rows(receivers, sources, surfaces, eps, trace=False)
    bent = np.flatnonzero(prepared.bent)
    seen = plain.factors[:, bent]
    away = np.linalg.norm(x[:, None] - sources.spheres[bent, :3], axis=2)
    apparent = np.minimum((sources.spheres[bent, 3] / np.maximum(away, 1e-300)) ** 2, 1.0)
    least = np.maximum(seen, ABSOLUTE / accuracy)  # no more is asked of what is smaller
    share = np.where(seen > 0.0, least / apparent, 1.0).min(axis=1, initial=1.0)
    digits = np.ceil(np.log10(_GRAZING / share))
    for more in np.unique(digits[digits > 0.0]):
        rows = np.flatnonzero(digits == more)
        found = _rows(
            receivers.take(rows), sources, surfaces, max(eps * 0.1**more, _LEAST), trace=False
        )
        plain.put(rows, found)
    return plain


def _digits(x: FloatArray, sources: Sources, accuracy: float) -> float:
    """Accuracy for the kernel, which spends fewer digits on patches of a small solid angle.

    It allows 0.05 eps / (r/d)²; here every patch is to have ``accuracy`` of its own factor. None is
    to be summed over points of its surface: the error of that is a share of the whole hemisphere.
    """
    from .kernels.edges import AREA_ERROR

    smallest = np.inf
    for *center, radius in sources.spheres:
        distance = float(np.linalg.norm(x - center, axis=1).max())
        smallest = min(smallest, radius / max(distance, 1e-300))
    eps = min(0.1 * accuracy * min(1.0, 20.0 * smallest**2), 0.5 * AREA_ERROR * smallest**2)
    return float(max(eps, _LEAST))


def _estimated(
    receivers: Receivers, prepared: Prepared, plain: Rows, accuracy: float
) -> FormFactors:
    """The contour of what is seen, and other methods where that does not serve."""
    from .visible import FINEST, visible_factors

    value, solved, left = visible_factors(receivers, prepared, plain.factors, accuracy)
    error = max(_STATED * accuracy, FINEST) * plain.factors + ABSOLUTE
    low, high = np.maximum(value - error, 0.0), np.minimum(value + error, 1.0)
    counters = {**plain.counters, "pairs_by_contour": int(solved.sum())}
    rows = np.flatnonzero(left.any(axis=1))
    if len(rows):
        own, some = receivers.take(rows), plain.take(rows)
        rest = _sampled(own, prepared, some, left[rows], accuracy)
        for ours, theirs in ((value, rest.value), (low, rest.low), (high, rest.high)):
            ours[rows] = np.where(left[rows], theirs, ours[rows])
        _add_counters(counters, rest.counters)
    return FormFactors(value, low, high, False, counters)


def _add_counters(counters: dict[str, int], more: Mapping[str, int]) -> None:
    for name, number in more.items():
        counters[name] = counters.get(name, 0) + number


def _sampled(
    receivers: Receivers,
    prepared: Prepared,
    plain: Rows,
    wanted: NDArray[np.bool_],
    accuracy: float,
) -> FormFactors:
    """Brackets where they take few cells; elsewhere what is partly hidden is sampled in cells.

    Only of the ``wanted`` (m, n) pairs: those of the others are as wide as they happen to be.
    """
    from .strict import strict_form_factors

    sources, surfaces = prepared.sources, prepared.surfaces
    # The middle of a bracket is off by half of its width at most.
    sure = strict_form_factors(
        receivers,
        sources,
        surfaces,
        plain,
        2.0 * accuracy,
        wanted=wanted,
        most_cells=_FEW_CELLS,
    )
    value, low, high = sure.value.copy(), sure.low.copy(), sure.high.copy()
    counters = dict(sure.counters)
    wide = wanted & (sure.width > np.maximum(2.0 * accuracy * plain.factors, 2.0 * ABSOLUTE))
    # Along an outline of a few patch lengths lie 2 … 4 sqrt(F/e) cells of factor e, each sampled
    # with a deviation of 0.2 e: the sum deviates by 0.4 e (F/e)^(1/4), and three times that is
    # to stay below accuracy F.
    relative = (accuracy / (3.0 * 0.4)) ** (4.0 / 3.0)
    eps = _digits(receivers.nodes[:, 0], sources, accuracy)
    for i in np.flatnonzero(wide.any(axis=1)):
        open_ = wide[i]
        cells = np.where(open_, np.maximum(relative * plain.factors[i], 0.01 * ABSOLUTE), 1.0)
        own = sources._replace(cell_eps=cells)
        found = _rows(receivers.take(np.array([i])), own, surfaces, eps, trace=True)
        error = _DEVIATIONS * np.sqrt(found.variances[0]) + _STATED * accuracy * plain.factors[i]
        least = np.maximum(found.factors[0] - error - ABSOLUTE, low[i])
        most = np.minimum(found.factors[0] + error + ABSOLUTE, high[i])
        # Where the sample contradicts the proof, the proof stays.
        open_ &= least <= most
        value[i] = np.where(open_, np.clip(found.factors[0], low[i], high[i]), value[i])
        low[i], high[i] = np.where(open_, least, low[i]), np.where(open_, most, high[i])
        _add_counters(counters, found.counters)
    return FormFactors(value, low, high, False, counters)
