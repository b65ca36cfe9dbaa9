"""Interreflection: the linear system of the reflected exitance, (I − ρ F) B = ρ E_direct.

Few right-hand sides are solved by GMRES, all at once; many by a decomposition, made once; and where
fewer sensors are asked for than there are right-hand sides, the transposed system is solved, once a
sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .errors import ConvergenceError
from .exchange import products, transposed_products
from .factorised import LU_BYTES, Factorised
from .krylov import solve_all
from .memory import has_room
from .model.arrays import FloatArray, IntArray, MatrixArray
from .packed import PackedMatrix
from .scattering import Scattering
from .spectral import ABSORBED, check_radius, radius_bound

#: Relative residual asked of GMRES at least, and for each unit of accuracy asked for: what is left
#: is far less than what meshes and form factors leave.
TOLERANCE, TOLERANCE_SHARE = 1e-9, 1e-4
#: Right-hand sides of one reflectance from which a matrix is decomposed: at least, and the inverse
#: of their number for each unknown. By counting operations, some 15 products a right-hand side
#: against 2/3 n³ at a higher rate; not measured.
LU_AT_LEAST, LU_UNKNOWNS_A_SIDE = 24, 100
#: Unknowns above which no matrix is decomposed.
LU_UNKNOWNS = 16_000
#: Rounding by which one light may differ from a multiple of another, against its largest value.
ALIKE = 1e-14
#: Right-hand sides that GMRES takes at a time: each keeps some thirty directions.
GMRES_SIDES = 64


def check_absorbs(factors: MatrixArray, reflectance: FloatArray) -> float:
    """Upper bound of the spectral radius of ρ F in any band; `NumericsError` when it may be 1.

    Below 1 light dies out; in a closed scene that absorbs nothing it grows without end, and no
    balance exists.
    """
    radius = _bound(factors, reflectance.max(axis=1))
    if radius >= 1.0 - ABSORBED and reflectance.shape[1] > 1:
        # What is white in no band in all places may still absorb some of each.
        radius = max(_bound(factors, rho) for rho in reflectance.T)
    check_radius(radius, bool((reflectance >= 1.0 - 1e-9).all()))
    return radius


def _bound(factors: MatrixArray, rho: FloatArray) -> float:
    return radius_bound(lambda light: np.asarray(rho * products(factors, light)), len(factors))


class RadiositySystem:
    """Reflection in one scene on one mesh.

    Parameters
    ----------
    factors : (n, n) array or PackedMatrix
        Form factors, row i what element i sees.
    reflectance : (n, b) array
        Diffuse reflectance by band.
    accuracy : float
        Relative accuracy asked for.
    scattering : Scattering, optional
        What panels send on to their other side: ρ becomes ρ + S, and B holds it besides.

    Attributes
    ----------
    radius : float
        Upper bound of the spectral radius of ρ F.
    products : int
        Passes over the matrix that GMRES has made; columns solved together share them.
    decomposed : int
        How many matrices were decomposed.

    Raises
    ------
    NumericsError
        If there is light that is never absorbed.
    """

    def __init__(
        self,
        factors: MatrixArray,
        reflectance: FloatArray,
        *,
        accuracy: float = 0.0,
        scattering: Scattering | None = None,
    ) -> None:
        self.factors, self.reflectance, self.scattering = factors, reflectance, scattering
        self.tolerance = max(TOLERANCE, TOLERANCE_SHARE * accuracy)
        self.products = self.decomposed = 0
        kept = reflectance if scattering is None else reflectance + scattering.share[:, None]
        self.radius = check_absorbs(factors, kept)

    @cached_property
    def _kinds(self) -> tuple[FloatArray, IntArray]:
        """Different reflectances (k, n), and which one each band has."""
        kinds: list[FloatArray] = []
        band = []
        for column in self.reflectance.T:
            same = [k for k, kind in enumerate(kinds) if np.array_equal(kind, column)]
            band.append(same[0] if same else len(kinds))
            if not same:
                kinds.append(column)
        return np.array(kinds), np.array(band)

    def solve(self, direct: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Reflected exitance (n, b) [lm/m²] by light group of direct irradiance (n, b). [lx]

        Raises
        ------
        ConvergenceError
            If the tolerance is not reached.
        """
        names, bands = list(direct), self.reflectance.shape[1]
        if not names:
            return {}
        light = np.stack([direct[name] for name in names], axis=1)  # (n, groups, b)
        out = np.zeros(light.shape)
        band = np.tile(np.arange(bands), len(names))
        flat, found = light.reshape(len(light), -1), out.reshape(len(light), -1)
        lit = np.asarray((self.reflectance[:, band] * flat).any(axis=0))
        lit |= self._scattered(flat).any(axis=0)
        same, factor = self._multiples(flat, lit)
        lit[same != np.arange(len(same))] = False
        for columns in self._by_lu(flat, found, band, lit):
            lit[columns] = False
        rest = np.flatnonzero(lit)
        for start in range(0, len(rest), GMRES_SIDES):
            some = rest[start : start + GMRES_SIDES]
            rho = self.reflectance[:, band[some]]

            def operate(b: FloatArray, columns: IntArray, rho: FloatArray = rho) -> FloatArray:
                light = products(self.factors, b)
                return np.asarray(b - rho[:, columns] * light - self._scattered(light))

            def name(column: int, some: IntArray = some) -> str:
                return f"light group {names[int(some[column]) // bands]!r}"

            source = rho * flat[:, some] + self._scattered(flat[:, some])
            solved = solve_all(operate, source, tolerance=self.tolerance, names=name)
            found[:, some] = solved.values
            self.products += solved.products
        more = np.flatnonzero(same != np.arange(len(same)))
        found[:, more] = found[:, same[more]] * factor[more]
        return {name: out[:, k] for k, name in enumerate(names)}

    def _multiples(self, light: FloatArray, lit: NDArray[np.bool_]) -> tuple[IntArray, FloatArray]:
        """Which column (k,) of ``light`` each is a multiple of, and by what factor (k,).

        Light of a group has one colour where all its sources have; surfaces that reflect some
        bands alike keep it the same in these.
        """
        bands = self.reflectance.shape[1]
        same, factor = np.arange(light.shape[1]), np.ones(light.shape[1])
        for first in range(0, light.shape[1] if bands > 1 else 0, bands):
            known: dict[int, list[int]] = {}
            for column in first + np.flatnonzero(lit[first : first + bands]):
                others = known.setdefault(int(self._kinds[1][column - first]), [])
                own = light[:, column]
                for other in others:
                    at = int(np.argmax(np.abs(light[:, other])))
                    ratio = own[at] / light[at, other]
                    if (np.abs(own - ratio * light[:, other]) <= ALIKE * np.abs(own[at])).all():
                        same[column], factor[column] = other, ratio
                        break
                else:
                    others.append(int(column))
        return same, factor

    def _scattered(self, light: FloatArray, *, back: bool = False) -> FloatArray:
        """What panels send on (n, k) of light (n, k) on them; ``back`` transposed."""
        if self.scattering is None:
            return np.zeros((1, light.shape[1]))
        return self.scattering.sent(light, back=back)

    def _by_lu(
        self, light: FloatArray, found: FloatArray, band: IntArray, lit: NDArray[np.bool_]
    ) -> Iterator[IntArray]:
        """Solve the columns that are worth a decomposition; yields which were."""
        n = len(self.factors)
        if isinstance(self.factors, PackedMatrix) or n > LU_UNKNOWNS or self.scattering is not None:
            return
        kinds, kind_of = self._kinds
        for kind, rho in enumerate(kinds):
            columns = np.flatnonzero(lit & (kind_of[band] == kind))
            if len(columns) < max(LU_AT_LEAST, n // LU_UNKNOWNS_A_SIDE):
                continue
            if not has_room(LU_BYTES * n**2):
                continue
            try:
                taken_apart = Factorised(self.factors, rho)
                found[:, columns] = taken_apart.solve(light[:, columns], tolerance=self.tolerance)
            except ConvergenceError:
                continue  # next to singular: GMRES has all digits
            self.decomposed += 1
            yield columns

    def importance(self, rows: MatrixArray, *, tolerance: float | None = None) -> FloatArray:
        """How much light on each element matters at some receivers.

        Indirect light E_s = Σ_j F_sj B_j is Σ_j w_sj ρ_j E_j of the direct light E, with
        w = (I − Fᵀ ρ)⁻¹ F_s: one transposed system a receiver instead of one a light.

        Parameters
        ----------
        rows : (s, n) array
            Form factors from the receivers to the elements.
        tolerance : float, optional
            Relative residual; that of `solve` when not given.

        Returns
        -------
        (s, n, b) array
            Weights w by band.
        """
        kinds, kind_of = self._kinds
        weights = np.empty((len(kinds), *rows.shape))
        for kind, rho in enumerate(kinds):
            reflectance = rho[:, None]

            def operate(
                w: FloatArray, columns: IntArray, reflectance: FloatArray = reflectance
            ) -> FloatArray:
                light = reflectance * w + self._scattered(w, back=True)
                return np.asarray(w - transposed_products(self.factors, light))

            for start in range(0, len(rows), GMRES_SIDES):
                some = np.asarray(rows[start : start + GMRES_SIDES], dtype=np.float64)
                solved = solve_all(
                    operate,
                    np.ascontiguousarray(some.T),
                    tolerance=self.tolerance if tolerance is None else tolerance,
                    names=lambda column, start=start: f"sensor {start + column}",  # type: ignore[misc]
                )
                weights[kind, start : start + GMRES_SIDES] = solved.values.T
                self.products += solved.products
        return np.ascontiguousarray(np.moveaxis(weights[kind_of], 0, 2))

    def indirect(self, rows: MatrixArray, direct: FloatArray) -> FloatArray:
        """Indirect light (s, k, b) at receivers of many lights (n, k, b) on the elements. [lx]

        The transposed system is solved where there are fewer receivers than lights.

        Parameters
        ----------
        rows : (s, n) array
            Form factors from the receivers to the elements.
        direct : (n, k, b) array
            Direct irradiance of each of k lights. [lx]
        """
        if len(rows) < direct.shape[1]:
            weights = self.importance(rows)
            sent = self.reflectance[:, None] * direct
            sent += self._scattered(direct.reshape(len(direct), -1)).reshape(-1, *direct.shape[1:])
            return np.einsum("snb,nkb->skb", weights, sent, optimize=True)
        reflected = self.solve({str(k): direct[:, k] for k in range(direct.shape[1])})
        return products(rows, np.stack(list(reflected.values()), axis=1))


def solve_radiosity(
    factors: MatrixArray,
    reflectance: FloatArray,
    direct: Mapping[str, FloatArray],
    *,
    accuracy: float = 0.0,
    scattering: Scattering | None = None,
) -> tuple[dict[str, FloatArray], int]:
    """Reflected exitance of every light group, (I − ρ F) B = ρ E_direct.

    With panels that scatter, ρ becomes ρ + S, and B holds what they scatter besides.

    Parameters
    ----------
    factors, reflectance, accuracy
        As of `RadiositySystem`.
    direct : dict of (n, b) arrays
        Direct irradiance by light group. [lx]

    Returns
    -------
    dict of (n, b) arrays, int
        Reflected exitance by light group [lm/m²], and the number of passes over the matrix.

    Raises
    ------
    NumericsError
        If there is light that is never absorbed.
    ConvergenceError
        If the tolerance is not reached.
    """
    system = RadiositySystem(factors, reflectance, accuracy=accuracy, scattering=scattering)
    return system.solve(direct), system.products
