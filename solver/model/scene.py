"""A frozen scene: everything the solver needs, in world axes and SI units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .arrays import FloatArray, IntArray, check_shape, frozen
from .bands import SPECTRAL
from .cad import Certificate
from .daylight import DaylightFactors
from .glazing import Glazing
from .optics import Material
from .patches import PatchSet
from .photometry import Web
from .profiles import Profile
from .reflectance import Spectrum
from .sky import Ground, Site, Sky, Sun
from .views import Camera, Sensors

#: Row of `SceneData.materials` that reflects nothing.
BLACK = -1
#: Distance above a surface at which it is asked whether something lies on it, relative to the
#: scene's size: faces that look at each other from nearer touch.
CONTACT = 1e-5


@dataclass(frozen=True, slots=True)
class ScenePart:
    """A part of a model in the scene.

    Attributes
    ----------
    path : str
        Model name and part path joined by ``/``.
    model : str
        Name of the model the part came from.
    kind : {"solid", "air", "sheet", "patches"}
        Solids are active outside, air solids inside, sheets on both sides, patches on their
        +side.
    """

    path: str
    model: str
    kind: str
    color: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class SceneFace:
    """A face of a part, so that a number of the result leads back to the CAD file."""

    part: int
    number: int
    kind: str
    name: str | None = None
    color: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Luminaire:
    """One emitting part: its flux is spread over its emitting sides, or follows a web.

    Attributes
    ----------
    part : str
        Path of the part.
    group : str
        Light group; results are kept apart by group.
    flux_lm, area_m2 : float
        Flux leaving the part [lm] and the area it leaves from [m²].
    color : (3,) array
        Linear sRGB of the light, scaled to luminance 1.
    cct_k : float
        Correlated colour temperature; not a number where the light is too far from white. [K]
    power_w : float, optional
        Electric power. [W]
    spectrum : pairs of (wavelength_nm, relative power), optional
        Of the light; without, it is that of white light of ``cct_k``.
    web : Web, optional
        Directions its light takes; without, it is Lambertian.
    profile : Profile, optional
        How its exitance varies over the emitting sides; without, it is even.
    """

    part: str
    group: str
    flux_lm: float
    area_m2: float
    color: FloatArray
    cct_k: float
    power_w: float | None = None
    spectrum: Spectrum | None = None
    web: Web | None = None
    profile: Profile | None = None

    @property
    def exitance_lm_m2(self) -> float:
        """Mean luminous exitance of the emitting sides. [lm/m²]"""
        return self.flux_lm / self.area_m2

    @property
    def luminance_cd_m2(self) -> float:
        """Luminance of the emitting sides; of a web, were it Lambertian. [cd/m²]"""
        return self.exitance_lm_m2 / np.pi


@dataclass(frozen=True, slots=True)
class Source:
    """A model of the scene and where it came from."""

    name: str
    file: str
    sha256: str
    unit: str
    scale: float
    certificate: Certificate


@dataclass(frozen=True, slots=True, eq=False)
class SceneData:
    """The scene the solver works on; row p of every ``patch`` array is the same patch.

    Attributes
    ----------
    patches : PatchSet
        World coordinates [m]; +normal towards the active side. ``part_index`` and ``face_index``
        are rows of ``parts`` and ``faces``.
    two_sided : (p,) bool array
        Both sides receive and reflect (sheets).
    closed : (p,) bool array
        The patch bounds a closed, consistently oriented solid.
    material_index : (p, 2) int array
        Rows of ``materials`` for the + and − side; `BLACK` reflects nothing.
    luminaire_index : (p, 2) int array
        Rows of ``luminaires`` for the + and − side; −1 where nothing is emitted.
    default_faces : (f,) bool array
        Faces that got the default material because nothing was assigned.
    glazings : tuple of Glazing
        Kinds of panes.
    glass_index : (p,) int array
        Rows of ``glazings``, −1 where the patch is no glass. Patches that something is seen
        through come last.
    notes, warnings : tuple of str
        What is remarkable, and what is doubtful, about the scene itself, one line each.
    daylight_factors : DaylightFactors, optional
        Daylight factors to be found beside the light of the scene.
    outdoor_parts : tuple of int
        Rows of the parts that stand outdoors, which only daylight factors ask for.
    """

    patches: PatchSet
    two_sided: IntArray
    closed: IntArray
    material_index: IntArray
    luminaire_index: IntArray
    parts: tuple[ScenePart, ...]
    faces: tuple[SceneFace, ...]
    materials: tuple[Material, ...]
    luminaires: tuple[Luminaire, ...] = ()
    sky: Sky | None = None
    sun: Sun | None = None
    ground: Ground | None = None
    site: Site | None = None
    north_deg: float = 0.0
    maintenance_factor: float = 1.0
    sensors: tuple[Sensors, ...] = ()
    cameras: tuple[Camera, ...] = ()
    sources: tuple[Source, ...] = ()
    default_faces: IntArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    glazings: tuple[Glazing, ...] = ()
    glass_index: IntArray = field(default=None)  # type: ignore[arg-type, assignment]
    title: str = "scene"
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    daylight_factors: DaylightFactors | None = None
    outdoor_parts: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.patches)
        if self.glass_index is None:
            object.__setattr__(self, "glass_index", np.full(n, -1))
        for name, dtype, shape in (
            ("two_sided", np.bool_, (n,)),
            ("closed", np.bool_, (n,)),
            ("material_index", np.int64, (n, 2)),
            ("luminaire_index", np.int64, (n, 2)),
            ("default_faces", np.bool_, (None,)),
            ("glass_index", np.int64, (n,)),
        ):
            array = frozen(getattr(self, name), dtype)
            check_shape(f"SceneData.{name}", array, shape)
            object.__setattr__(self, name, array)
        if self.see_through[: self.opaque_count].any():
            raise InputError("SceneData: patches that something is seen through must come last")

    @property
    def see_through(self) -> NDArray[np.bool_]:
        """Patches (p,) of glass that lets some light straight through."""
        clear = np.array([g.glass.diffuse < 1.0 for g in self.glazings] + [False])
        return np.asarray(clear[self.glass_index])

    @property
    def opaque_count(self) -> int:
        """Number of patches that nothing is seen through: the first of all."""
        return len(self.patches) - int(self.see_through.sum())

    @property
    def without_panes(self) -> SceneData:
        """The same without patches that something is seen through; itself if there are none."""
        count = self.opaque_count
        if count == len(self.patches):
            return self
        return self.taken(np.arange(count))

    def taken(self, rows: IntArray) -> SceneData:
        """The same with some of the patches."""
        names = ("two_sided", "closed", "material_index", "luminaire_index", "glass_index")
        return replace(
            self,
            patches=self.patches.take(rows),
            **{name: getattr(self, name)[rows] for name in names},
        )

    @property
    def outdoors(self) -> NDArray[np.bool_]:
        """Patches (p,) of parts that stand outdoors."""
        return np.isin(self.patches.part_index, self.outdoor_parts)

    @property
    def is_grey(self) -> bool:
        """Whether every used material reflects all bands alike."""
        used = {int(i) for i in np.unique(self.material_index) if i >= 0}
        return all(self.materials[i].is_grey for i in used)

    @property
    def bands(self) -> int:
        """Bands of light: 20 where sensors ask for its spectrum, else 3, or 1 if all is grey."""
        if any(grid.spectral for grid in self.sensors):
            return SPECTRAL
        return 1 if self.is_grey else 3

    @property
    def without_spectra(self) -> SceneData:
        """The same with sensors that do not ask for the spectrum; itself if none does."""
        if self.bands != SPECTRAL:
            return self
        return replace(self, sensors=tuple(replace(grid, spectral=False) for grid in self.sensors))

    @property
    def groups(self) -> tuple[str, ...]:
        """Light groups in order of appearance: luminaire groups, then sky, sun and ground."""
        names = list(dict.fromkeys(lamp.group for lamp in self.luminaires))
        if self.sky is not None:
            names.append("sky")
        if self.sun is not None:
            names.append("sun")
        if self.ground is not None and self.ground.reflectance and (self.sky or self.sun):
            names.append("ground")
        return tuple(names)
