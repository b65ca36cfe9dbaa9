"""What a simulation returns."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .arrays import FloatArray, IntArray
from .bands import LUMINANCE_WEIGHTS, SPECTRAL
from .colorimetry import SpectralLight
from .daylight import DaylightShares
from .elements import Elements
from .reprs import result_repr, sensors_repr
from .scene import SceneData
from .views import Camera

#: Largest upward component of the normal of a sensor that stands upright.
UPRIGHT = 1e-6


def luminous(values: FloatArray) -> FloatArray:
    """Photometric value of band values (..., b), b = 1, 3 or 20; see `bands`."""
    if values.shape[-1] == 1:
        return values[..., 0]
    if values.shape[-1] == SPECTRAL:
        return np.asarray(values.sum(axis=-1))
    return np.asarray(values @ np.array(LUMINANCE_WEIGHTS))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SensorResult:
    """Illuminance on one grid; row i of every array is the same sensor.

    Attributes
    ----------
    points, normals : (n, 3) array
        Positions [m] and unit normals.
    area_m2 : (n,) array
        Weights of averages. [m²]
    illuminance_lx, error_lx : (n,) array
        Illuminance and the half-width of its numerical error. [lx]
    components : dict of (n,) arrays
        ``"<group>.direct"`` and ``"<group>.indirect"``, summing to ``illuminance_lx``. [lx]
    daylight : DaylightShares or None
        Daylight factors and their shares, under an overcast sky or where they were asked for. [1]
    outline : tuple of (k, 3) arrays
        Outlines of the measured area. [m]
    spectral : SpectralLight or None
        Colour and melanopic values of the light, where they were asked for.
    """

    name: str
    points: FloatArray
    normals: FloatArray
    area_m2: FloatArray
    illuminance_lx: FloatArray
    error_lx: FloatArray
    components: Mapping[str, FloatArray]
    daylight: DaylightShares | None = None
    outline: tuple[FloatArray, ...] = ()
    spectral: SpectralLight | None = None

    def __repr__(self) -> str:
        return sensors_repr(self)

    def mean(self, values: FloatArray) -> float:
        """Area-weighted mean of ``values`` (n,)."""
        return float(np.average(values, weights=self.area_m2))

    @property
    def daylight_factor(self) -> FloatArray | None:
        """Daylight factors (n,) as fractions, where they are known."""
        return None if self.daylight is None else self.daylight.total

    @property
    def faces_sideways(self) -> bool:
        """Whether every sensor stands upright, so that what it gets of the sky is vertical."""
        return bool((np.abs(self.normals[:, 2]) < UPRIGHT).all())

    @property
    def metrics(self) -> dict[str, float]:
        """Illuminances, uniformity and, where they are known, daylight factors by name.

        E_avg_lx, E_min_lx, E_max_lx, U0; DF_avg_percent, DF_median_percent and the means of the
        shares SC, ERC and IRC; of upright sensors the mean vertical sky component VSC_avg_percent.
        Where light was told by wavelength, EDI_avg_lx and EDI_min_lx, and means over the sensors
        CCT_avg_K, Duv_avg and DER_avg, unless some sensor's light has none.
        """
        mean, e = self.mean(self.illuminance_lx), self.illuminance_lx[self._counted]
        values = {
            "E_avg_lx": mean,
            "E_min_lx": float(e.min()),
            "E_max_lx": float(e.max()),
            "U0": float(e.min() / mean) if mean > 0.0 else 0.0,
        }
        if self.daylight is not None:
            total = self.daylight.total
            values["DF_avg_percent"] = 100.0 * self.mean(total)
            values["DF_median_percent"] = 100.0 * weighted_median(total, self.area_m2)
            values |= {name: 100.0 * self.mean(share) for name, share in self._shares().items()}
        return values | self._spectral_metrics

    @property
    def _spectral_metrics(self) -> dict[str, float]:
        """Metrics of the colour of light, as far as there are."""
        told = self.spectral
        if told is None:
            return {}
        edi = told.melanopic_edi_lx
        values = {"EDI_avg_lx": self.mean(edi), "EDI_min_lx": float(edi.min())}
        means = {"CCT_avg_K": told.cct_k, "Duv_avg": told.duv, "DER_avg": told.melanopic_der}
        return values | {k: self.mean(v) for k, v in means.items() if np.isfinite(v).all()}

    @property
    def _spectral_errors(self) -> dict[str, float]:
        """Half-width of the error of each of them."""
        told = self.spectral
        if told is None:
            return {}
        edi, error = told.melanopic_edi_lx, self.edi_error_lx
        values = {"EDI_avg_lx": self.mean(error), "EDI_min_lx": float(error[np.argmin(edi)])}
        means = {
            "CCT_avg_K": told.cct_error_k,
            "Duv_avg": told.duv_error,
            "DER_avg": told.der_error,
        }
        return values | {k: self.mean(v) for k, v in means.items() if np.isfinite(v).all()}

    @property
    def edi_error_lx(self) -> FloatArray:
        """Half-width (n,) of the error of the melanopic illuminance where it is told, else 0."""
        if self.spectral is None:
            return np.zeros(len(self.error_lx))
        # In the dark neither is a number.
        ratio, off = (
            np.nan_to_num(v) for v in (self.spectral.melanopic_der, self.spectral.der_error)
        )
        return np.asarray(self.error_lx * (ratio + off) + self.illuminance_lx * off)

    @property
    def _counted(self) -> NDArray[np.bool_]:
        """Sensors (n,) that count: those of no area, which lie inside solids, do not."""
        found = np.asarray(self.area_m2 > 0.0)
        return found if found.any() else ~found

    def _shares(self) -> dict[str, FloatArray]:
        """Shares (n,) of the daylight factor by the name of their mean."""
        if self.daylight is None:
            return {}
        found = {
            "SC_avg_percent": self.daylight.sky,
            "ERC_avg_percent": self.daylight.external,
            "IRC_avg_percent": self.daylight.internal,
        }
        return found | ({"VSC_avg_percent": self.daylight.sky} if self.faces_sideways else {})

    @property
    def metric_errors(self) -> dict[str, float]:
        """Half-width of the numerical error of each of `metrics`, in its unit."""
        mean, mean_error = self.mean(self.illuminance_lx), self.mean(self.error_lx)
        e, error = self.illuminance_lx[self._counted], self.error_lx[self._counted]
        values = {
            "E_avg_lx": mean_error,
            "E_min_lx": float(error[np.argmin(e)]),
            "E_max_lx": float(error[np.argmax(e)]),
        }
        relative = (values["E_min_lx"] + mean_error) / mean if mean > 0.0 else 0.0
        values["U0"] = float(relative)
        if self.daylight is not None:
            # No share of it is known worse than the whole; one that nothing sends is known.
            share = 100.0 * self.mean(self.daylight.error)
            values |= dict.fromkeys(("DF_avg_percent", "DF_median_percent"), share)
            values |= {name: share if v.any() else 0.0 for name, v in self._shares().items()}
        return values | self._spectral_errors


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Smallest value at which half of the weight is reached."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(cumulative, 0.5 * cumulative[-1])])


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceResult:
    """Elements of the parts that match a pattern; row i of every array is the same element."""

    element_index: IntArray
    area_m2: FloatArray
    illuminance_lx: FloatArray
    direct_lx: FloatArray
    indirect_lx: FloatArray
    exitance_lm_m2: FloatArray
    error_lx: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """A rendered view.

    Attributes
    ----------
    rgb : (h, w, 3) array
        Linear sRGB scaled so that 0.2126 R + 0.7152 G + 0.0722 B is the luminance. [cd/m²]
    illuminance_lx, depth_m : (h, w) array
        Of the surface seen; NaN where a ray leaves the scene.
    normals : (h, w, 3) array
        Unit normals towards the viewer; NaN where a ray leaves the scene.
    part_index : (h, w) int array
        Row of the part seen; −1 for the sky and the ground.
    """

    camera: Camera
    rgb: FloatArray
    illuminance_lx: FloatArray
    depth_m: FloatArray
    normals: FloatArray
    part_index: IntArray

    @property
    def luminance_cd_m2(self) -> FloatArray:
        """Luminance (h, w). [cd/m²]"""
        return luminous(self.rgb)


@dataclass(frozen=True, slots=True)
class Balance:
    """Flux ledger. [lm]

    ``emitted + entered = absorbed + escaped + residual``: luminaires emit, sky, sun and ground
    enter through the surfaces they first strike, materials absorb, the rest leaves the scene.
    """

    emitted_lm: float
    entered_lm: float
    absorbed_lm: float
    escaped_lm: float
    absorbed_by_material: Mapping[str, float] = field(default_factory=dict)
    emitted_by_group: Mapping[str, float] = field(default_factory=dict)

    @property
    def residual_lm(self) -> float:
        """What the ledger does not account for. [lm]"""
        return self.emitted_lm + self.entered_lm - self.absorbed_lm - self.escaped_lm

    @property
    def residual_fraction(self) -> float:
        """Residual relative to all light."""
        total = self.emitted_lm + self.entered_lm
        return self.residual_lm / total if total > 0.0 else 0.0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Result:
    """A solved scene.

    Attributes
    ----------
    scene : SceneData
        What was solved.
    elements : Elements
        n curved elements.
    components : dict of (n, b) arrays
        Irradiance of the elements by ``"<group>.direct"`` and ``"<group>.indirect"`` and band.
        [lx, or its band share]
    exitance : (n, b) array
        Emitted and reflected exitance. [lm/m²]
    element_error_lx : (n,) array
        Half-width of the numerical error of the elements' illuminance. [lx]
    sensors : dict of SensorResult
        By grid name.
    images : dict of CameraImage
        By camera name.
    balance : Balance
        Flux ledger.
    row_sums : (n,) array
        Sum of each element's form factors to all others, raw; NaN where nothing is reflected and
        none are found.
    stages : dict
        Seconds spent, by stage that was run.
    skipped : dict
        Reason, by stage that was not run.
    counters : dict
        Work done and work avoided.
    settings : dict
        All settings that influence the numbers.
    warnings : tuple of str
        Named warnings, one line each.
    """

    scene: SceneData
    elements: Elements
    components: Mapping[str, FloatArray]
    exitance: FloatArray
    element_error_lx: FloatArray
    sensors: Mapping[str, SensorResult]
    images: Mapping[str, CameraImage]
    balance: Balance
    row_sums: FloatArray
    stages: Mapping[str, float]
    skipped: Mapping[str, str]
    counters: Mapping[str, int]
    settings: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    converged: bool = True

    def __repr__(self) -> str:
        return result_repr(self)

    @property
    def illuminance_lx(self) -> FloatArray:
        """Illuminance of the elements (n,). [lx]"""
        return self._sum(("direct", "indirect"))

    def _sum(self, kinds: tuple[str, ...]) -> FloatArray:
        total = np.zeros(len(self.elements))
        for name, values in self.components.items():
            if name.rsplit(".", 1)[1] in kinds:
                total += luminous(values)
        return total

    @property
    def surfaces(self) -> SurfaceSelector:
        """Elements by part pattern: ``result.surfaces["*/wall*"]``."""
        return SurfaceSelector(self)


@dataclass(frozen=True, slots=True)
class SurfaceSelector:
    """Indexing with a part pattern; see `Result.surfaces`."""

    result: Result

    def __getitem__(self, pattern: str) -> SurfaceResult:
        result = self.result
        scene = result.scene
        paths = [part.path for part in scene.parts]
        hits = matching(pattern, paths)
        if not hits:
            from difflib import get_close_matches

            near = get_close_matches(pattern, paths, n=3, cutoff=0.0)
            raise InputError(f"surfaces[{pattern!r}]: no part matches; nearest: {', '.join(near)}")
        part_of = scene.patches.part_index[result.elements.patch_index]
        rows = np.flatnonzero(np.isin(part_of, hits))
        return SurfaceResult(
            element_index=rows,
            area_m2=result.elements.areas[rows],
            illuminance_lx=result.illuminance_lx[rows],
            direct_lx=result._sum(("direct",))[rows],
            indirect_lx=result._sum(("indirect",))[rows],
            exitance_lm_m2=luminous(result.exitance)[rows],
            error_lx=result.element_error_lx[rows],
        )


def matching(pattern: str, paths: Sequence[str]) -> list[int]:
    """Which part paths match a pattern, as in `matches`.

    One that is the path or last segment of a part, letter for letter, means that part alone, also
    where it holds ``[``, ``?`` or ``*``.
    """
    exact = [i for i, p in enumerate(paths) if pattern in (p, p.rsplit("/", 1)[-1])]
    return exact or [i for i, path in enumerate(paths) if matches(pattern, path)]


def matches(pattern: str, path: str) -> bool:
    """Whether a part path matches: ``*`` stays in a segment, ``**`` crosses segments.

    A pattern without ``/`` is compared with the last segment.
    """
    if "/" not in pattern and pattern != "**":
        return fnmatch.fnmatchcase(path.rsplit("/", 1)[-1], pattern)
    return _segments_match(pattern.split("/"), path.split("/"))


def _segments_match(pattern: list[str], path: list[str]) -> bool:
    if not pattern:
        return not path
    if pattern[0] == "**":
        return any(_segments_match(pattern[1:], path[k:]) for k in range(len(path) + 1))
    if not path or not fnmatch.fnmatchcase(path[0], pattern[0]):
        return False
    return _segments_match(pattern[1:], path[1:])
