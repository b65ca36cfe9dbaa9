"""Layout of scene.toml. Unknown keys are errors; every value object checks its own bounds."""

from __future__ import annotations

from typing import Annotated, Literal

from patchlight.solver.model import (
    Air,
    Camera,
    Emitter,
    Glass,
    Material,
    Site,
)
from pydantic import Field, StrictBool

from .assigning import srgb8
from .grids import SensorGrid
from .light_tables import DaylightFactorTable, GroundTable, SkyTable, SunTable
from .requirements import Requirement
from .scene import COLORS
from .scene_table import Number, Table, Text

Triple = tuple[Number, Number, Number]
Reflectance = Number | Triple | list[tuple[Number, Number]]
ProfileValues = list[Number] | list[list[Number]] | list[list[list[Number]]]


class SiteTable(Table):
    """Place and orientation."""

    latitude_deg: Number | None = None
    """Positive north. [deg]"""
    longitude_deg: Number | None = None
    """Positive east. [deg]"""
    elevation_m: Number = 0.0
    timezone: str | None = None
    """Name such as Europe/Berlin."""
    north_deg: Number = 0.0
    """True north, clockwise from +y of the scene. [deg]"""

    def build(self) -> Site | None:
        """The site, or None when only the orientation is given."""
        if self.latitude_deg is None and self.longitude_deg is None:
            return None
        if self.latitude_deg is None or self.longitude_deg is None:
            raise ValueError("give latitude_deg and longitude_deg together")
        return Site(self.latitude_deg, self.longitude_deg, self.elevation_m, self.timezone)


class ModelTable(Table):
    """A STEP file and where it goes."""

    file: Text
    """Relative to the scene file."""
    name: Text | None = None
    """First segment of the part paths; the file's name when not given."""
    scale: Annotated[Number, Field(gt=0)] = 1.0
    unit: Text | None = None
    """Length unit instead of the file's own."""
    up: Literal["z", "y", "x"] = "z"
    at_m: Triple = (0.0, 0.0, 0.0)
    tolerance: Annotated[Number, Field(gt=0)] = 1e-4
    """Largest deviation of a converted face, relative to the part's size."""
    angle_deg: Annotated[Number, Field(gt=0)] = 1.0
    """Largest deviation of its normals. [deg]"""
    heal: StrictBool = True
    """Let the CAD kernel repair parts of which a face cannot be converted."""
    timeout_s: Annotated[Number, Field(gt=0)] = 300.0
    """Limit for reading and converting. [s]"""
    memory_gb: Annotated[Number, Field(gt=0)] | None = None
    """Limit for the memory of the process that does it; what is free when not given. [GB]"""

    def build(self) -> None:
        """Nothing but a look at the unit: files are read when the whole scene file is right."""
        from patchlight.importers.units import unit_metres

        if self.unit is not None:
            unit_metres(self.unit)


class MaterialTable(Table):
    """Opaque surface; its three shares are numbers, linear [r, g, b], or [[wavelength_nm, value],
    ...], 1 together at most."""

    reflectance: Reflectance = 0.5
    """Diffuse share."""
    specular: Reflectance = 0.0
    """Glossy share: Phong's lobe."""
    exponent: Number = 50.0
    """Sharpness of the lobe, 1 to 1e6."""
    mirror: Reflectance = 0.0
    """Share that is reflected as by a mirror."""
    name: str = ""
    back: MaterialTable | None = None
    """Other side of a sheet."""

    def build(self) -> Material:
        """The material."""
        back = None if self.back is None else self.back.build()
        return Material(
            self.reflectance,
            specular=self.specular,
            exponent=self.exponent,
            mirror=self.mirror,
            back=back,
            name=self.name,
        )


class EmitterTable(Table):
    """Light leaving a surface, evenly, by a profile over it, or by a photometric file."""

    flux_lm: Number | None = None
    """Flux of each matched part; with photometry, instead of the file's. [lm]"""
    luminance_cd_m2: Number | None = None
    cct_k: Number = 4000.0
    spectrum: list[tuple[Number, Number]] | None = None
    """[[wavelength_nm, relative power], ...] instead of cct_k."""
    profile: ProfileValues | None = None
    """Relative exitance over the parameters (u, v) of each patch: corners, or a table of rows."""
    side: Literal["both", "front", "back"] = "both"
    group: Text | None = None
    """Light group of the result; the part's name when not given."""
    power_w: Number | None = None
    """Electric power; the photometric file's when not given. [W]"""
    dim: Number = 1.0
    photometry: Text | None = None
    """IES LM-63 or EULUMDAT file with the directions of the light; relative to the scene file."""
    aim: Triple | None = None
    """Where its nadir points; the part's own -z when not given."""
    c0: Triple | None = None
    """Where its C0 half-plane points; the part's own +x when not given."""

    def build(self) -> Emitter:
        """The emitter."""
        return Emitter(**self.given())


class GlassTable(Table):
    """Glass: a pane of it is a slab with two parallel faces."""

    thickness_m: Number | None = None
    """That of the solid when not given. [m]"""
    n: Number = 1.52
    """Refractive index."""
    absorption_per_m: Number = 6.783
    """Absorption coefficient. [1/m]"""
    transmittance: Number | list[tuple[Number, Number]] | None = None
    """Instead of the absorption: at normal incidence, or pairs [angle_deg, transmittance]."""
    diffuse: Number = 0.0
    """Share of the transmitted light that is scattered, 0 to 1."""

    def build(self) -> Glass:
        """The glass."""
        return Glass(**self.given())


class AssignTable(Table):
    """What some parts or faces are made of."""

    parts: Text
    """Part pattern: * stays in a segment, ** crosses."""
    faces: Text | None = None
    """up, down, vertical, #7, a face's name or colour, or a CadQuery selector."""
    layer: Text | None = None
    color: Text | None = None
    """CAD colour such as #ffcc00."""
    material: MaterialTable | None = None
    glass: GlassTable | None = None
    emitter: EmitterTable | None = None
    air: StrictBool = False
    """The parts are the volume of the room itself."""

    def build(self) -> list[Material | Glass | Emitter | Air]:
        """The things to assign."""
        things: list[Material | Glass | Emitter | Air] = []
        if self.material is not None:
            things.append(self.material.build())
        if self.glass is not None:
            things.append(self.glass.build())
        if self.emitter is not None:
            things.append(self.emitter.build())
        if self.air:
            things.append(Air())
        if not things:
            raise ValueError("give material, glass, emitter or air")
        if self.material is not None and self.glass is not None:
            raise ValueError("give material or glass: a face is either")
        if self.color is not None:
            srgb8(self.color, f"assign {self.parts!r}")
        return things


class SensorsTable(Table):
    """A grid: on a plane (z_m), on faces (parts), or given points (points_m)."""

    name: Text
    z_m: Number | None = None
    spacing_m: Number | Literal["en12464"] | None = None
    """Largest cell, or the rule of EN 12464-1; 0.5 when not given. [m]"""
    margin_m: Number | None = None
    over: Text | None = None
    """Part pattern of the floor; the visible floor below z_m when not given."""
    bounds_m: tuple[Number, Number, Number, Number] | None = None
    """Rectangle x0, y0, x1, y1 instead of a floor."""
    parts: Text | None = None
    """Part pattern of faces to put sensors on."""
    faces: Text | None = None
    points_m: list[Triple] | None = None
    normal: Triple | None = None
    """Direction the sensors face; up when not given."""
    quantity: Literal["planar"] = "planar"
    spectral: StrictBool = False
    """Whether colour temperature and melanopic values are asked for: light in 20 bands."""

    def build(self) -> SensorGrid:
        """The grid."""
        forms = [k for k in ("z_m", "parts", "points_m") if getattr(self, k) is not None]
        if len(forms) != 1:
            raise ValueError("give exactly one of z_m, parts and points_m")
        form = forms[0]
        allowed = {
            "z_m": {"margin_m", "over", "bounds_m", "normal", "spacing_m"},
            "parts": {"faces", "spacing_m"},
            "points_m": {"normal"},
        }[form]
        keys = ("spacing_m", "margin_m", "over", "bounds_m", "normal", "faces")
        wrong = [k for k in keys if getattr(self, k) is not None and k not in allowed]
        if wrong:
            raise ValueError(f"{', '.join(wrong)}: not used together with {form}")
        normal = self.normal or (0.0, 0.0, 1.0)
        if self.points_m is not None:
            return SensorGrid(self.points_m, normal, name=self.name, spectral=self.spectral)
        if self.spacing_m is None:
            self.spacing_m = 0.5
        if self.parts is not None:
            if isinstance(self.spacing_m, str):
                raise ValueError("spacing_m: must be a number for sensors on faces")
            return SensorGrid.on_faces(
                self.name,
                self.parts,
                spacing=self.spacing_m,
                faces=self.faces,
                spectral=self.spectral,
            )
        return SensorGrid.on_plane(
            self.name,
            z=float(self.z_m or 0.0),
            spacing=self.spacing_m,
            margin=self.margin_m or 0.0,
            over=self.over,
            bounds=self.bounds_m,
            normal=normal,
            spectral=self.spectral,
        )


class StateTable(Table):
    """Parts that are there or not, such as blinds, in one of the states of a year."""

    name: Text
    present: Text | list[Text] = Field(default_factory=list)
    """Part patterns: there in this state, and in others only if these name them too."""
    absent: Text | list[Text] = Field(default_factory=list)
    """Part patterns: not there in this state."""
    group: Text | None = None
    """Window group whose blinds these are, in a scene with several that are moved apart."""


class ViewOutTable(Table):
    """View out by EN 17037, told by a year: what of the model stands outdoors, and from where."""

    sensors: Text | list[Text] = Field(default_factory=list)
    """Names of grids at the height of eyes; all when not given."""
    outside: Text | list[Text] = Field(default_factory=list)
    """Part patterns of what is seen as landscape."""
    ground: Text | list[Text] = Field(default_factory=list)
    """Part patterns of the ground outdoors."""


class CameraTable(Table):
    """A view."""

    name: Text
    eye_m: Triple
    target_m: Triple
    up: Triple = (0.0, 0.0, 1.0)
    fov_deg: Number = 60.0
    """Horizontal field of view. [deg]"""
    size: tuple[int, int] = (800, 600)
    """Width and height in pixels."""
    projection: Literal["perspective", "parallel", "fisheye", "panorama"] = "perspective"

    def build(self) -> Camera:
        """The camera."""
        return Camera(
            self.eye_m,
            self.target_m,
            self.name,
            up=self.up,
            fov_deg=self.fov_deg,
            size=self.size,
            projection=self.projection,
        )


class RequirementTable(Table):
    """A bound on a metric of a grid."""

    sensors: Text
    metric: Text
    min: Number | None = None
    max: Number | None = None

    def build(self) -> Requirement:
        """The requirement."""
        return Requirement(self.sensors, self.metric, self.min, self.max)


class SceneFile(Table):
    """A whole scene.toml."""

    schema_version: Literal[1]
    title: Text | None = None
    accuracy: Annotated[Number, Field(ge=1e-6, le=0.5)] = 0.01
    """Relative error of sensor illuminance aimed at."""
    method: Literal["default", "nn93"] = "default"
    """nn93: as Nishita and Nakamae published it in 1993, for comparison."""
    basis: Literal["constant", "bilinear", "biquadratic"] | None = None
    """How reflected light varies over elements; bilinear where there are not too many of them."""
    balanced_mesh: StrictBool = False
    """Whether elements are cut until no edge of one has more than two neighbours."""
    maintenance_factor: Annotated[Number, Field(gt=0, le=1)] = 1.0
    """Factor on electric light; daylight has none."""
    colors: Literal["pictures", "reflectance"] = COLORS[0]  # type: ignore[assignment]
    """Whether CAD colours are for pictures only or give unassigned faces their reflectance."""
    site: SiteTable = Field(default_factory=SiteTable)
    model: Annotated[list[ModelTable], Field(min_length=1)]
    assign: list[AssignTable] = Field(default_factory=list)
    sky: SkyTable | None = None
    sun: SunTable | None = None
    ground: GroundTable | None = None
    daylight_factor: StrictBool | DaylightFactorTable = False
    """Whether daylight factors are found beside other light; a table says more."""
    sensors: list[SensorsTable] = Field(default_factory=list)
    cameras: list[CameraTable] = Field(default_factory=list)
    state: list[StateTable] = Field(default_factory=list)
    view_out: ViewOutTable | None = None
    requirements: list[RequirementTable] = Field(default_factory=list)

    def build(self) -> None:
        """Nothing: the tables are built one by one."""
        if self.method == "nn93" and self.basis is not None:
            raise ValueError('basis: not used together with method = "nn93"')
