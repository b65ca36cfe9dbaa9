"""What a benchmark case consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from patchlight.solver.model.arrays import FloatArray
from shapes import Shape


@dataclass(frozen=True, eq=False)
class Body:
    """A surface and what it does with light.

    Attributes
    ----------
    shape : Shape
        Where; only its outside shines, and reflects unless it is ``two_sided``.
    radiance : float
        Radiance of the outside. [W/(sr m²)]
    reflectance : float
        Diffuse reflectance of the outside.
    solid : int
        Bodies of one non-negative number bound one closed solid, so that none of their backs is
        seen; −1 for a surface in the open.
    sky : bool
        An opening that shows the sky of the case, ``radiance`` that of the zenith, 0 where there is
        only the sun's disc; darkness below the horizon. It is no surface.
    two_sided : bool
        The inside reflects like the outside; it never shines.
    """

    shape: Shape
    radiance: float = 0.0
    reflectance: float = 0.0
    solid: int = -1
    sky: bool = False
    two_sided: bool = False


@dataclass(frozen=True)
class RadianceSetting:
    """One run of ``rtrace``.

    Attributes
    ----------
    cut : (int, int)
        Pieces along the two sides of a luminous rectangle, or of each patch of other shapes; the
        sun's disc becomes as many suns as the product says.
    options : str
        Added to those that switch interpolation, jitter and chance off.
    shift : bool
        Move the points 1e-4 m back: ``rtrace -I`` evaluates that far in front of them.
    """

    cut: tuple[int, int]
    options: str
    shift: bool = True

    def __str__(self) -> str:
        return f"light {self.cut[0]}x{self.cut[1]} {self.options}" + " shift" * self.shift


@dataclass(frozen=True)
class MitsubaSetting:
    """One run of Mitsuba: samples a sensor, longest path, how direct light is found, and a seed."""

    samples: int
    depth: int = 1
    direct: str = "nee"
    seed: int = 0

    def __str__(self) -> str:
        return f"{self.direct} multijitter depth {self.depth} spp {self.samples}"


@dataclass(frozen=True)
class OurSetting:
    """One run of Patchlight: the one knob, and whether surfaces are new to the process.

    ``whole`` runs the whole simulation where light that comes straight would be asked for alone.
    """

    accuracy: float
    new: bool = False
    whole: bool = False

    def __str__(self) -> str:
        more = ", new surfaces" * self.new + ", whole simulation" * self.whole
        return f"accuracy {self.accuracy:g}{more}"


@dataclass(frozen=True)
class Disc:
    """The sun's disc, evenly bright: 1 lx on a plane that faces it. [deg]"""

    altitude: float
    azimuth: float
    radius: float


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, sensors, the true irradiance there, and how hard each tool tries.

    Attributes
    ----------
    name, title : str
        Short name, and one sentence.
    bodies : tuple of Body
        The scene.
    points, normals : (n, 3) array
        Sensors. [m], [1]
    truth : callable
        Irradiance (n,) at the sensors, computed without the solver. [W/m²]
    how : str
        How the truth is found and how good it is.
    patchlight, radiance, mitsuba : tuple
        Settings from quick to slow.
    sun : (float, float), optional
        Altitude, and azimuth clockwise from north (+y), of the sun of a clear sky, CIE type 12,
        whose disc is left out [deg]; the traditional overcast sky without.
    disc : Disc, optional
        The sun's disc, which then shines alone from a dark sky.
    """

    name: str
    title: str
    bodies: tuple[Body, ...]
    points: FloatArray
    normals: FloatArray
    truth: Callable[[], FloatArray]
    how: str
    patchlight: tuple[OurSetting, ...]
    radiance: tuple[RadianceSetting, ...] = ()
    mitsuba: tuple[MitsubaSetting, ...] = field(default=())
    sun: tuple[float, float] | None = None
    disc: Disc | None = None

    @property
    def reflects(self) -> bool:
        """Whether any light is reflected."""
        return any(body.reflectance > 0.0 for body in self.bodies)

    @property
    def has_sky(self) -> bool:
        """Whether there is an opening to the sky."""
        return any(body.sky for body in self.bodies)


def accuracies(*values: float) -> tuple[OurSetting, ...]:
    """Settings of Patchlight."""
    return tuple(OurSetting(value) for value in values)


def samples(*counts: int, depth: int = 1, direct: str = "nee") -> tuple[MitsubaSetting, ...]:
    """Settings of Mitsuba with more and more samples."""
    return tuple(MitsubaSetting(count, depth, direct) for count in counts)
