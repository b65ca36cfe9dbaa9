"""Where light is read: sensor grids and cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from .arrays import FloatArray, check_finite, check_shape, frozen

PROJECTIONS = ("perspective", "parallel", "fisheye", "panorama")


@dataclass(frozen=True, slots=True, eq=False)
class Sensors:
    """Resolved sensor points of one grid; row i of every array is the same sensor.

    Attributes
    ----------
    name : str
        Key of the result.
    points, normals : (n, 3) array
        Positions [m] and unit normals.
    area_m2 : (n,) array
        Area each point stands for, used as weight in averages. [m²]
    quantity : str
        ``"planar"`` illuminance.
    outline : tuple of (k, 3) arrays
        Closed outlines of the measured area, for plans. [m]
    spectral : bool
        Whether colour temperature and melanopic values are asked for, too.
    """

    name: str
    points: FloatArray
    normals: FloatArray
    area_m2: FloatArray = field(default=None)  # type: ignore[arg-type, assignment]
    quantity: str = "planar"
    outline: tuple[FloatArray, ...] = ()
    spectral: bool = False

    def __post_init__(self) -> None:
        points, normals = frozen(self.points), np.asarray(self.normals, dtype=np.float64)
        if normals.shape == (3,):
            normals = np.broadcast_to(normals, points.shape)
        check_shape(f"sensors {self.name!r}: points", points, (None, 3))
        if not len(points):
            raise InputError(f"sensors {self.name!r}: no points, there must be at least one")
        check_shape(f"sensors {self.name!r}: normals", normals, (len(points), 3))
        check_finite(f"sensors {self.name!r}: points", points)
        check_finite(f"sensors {self.name!r}: normals", normals)
        length = np.linalg.norm(normals, axis=1)
        if (length == 0.0).any():
            raise InputError(f"sensors {self.name!r}: normal {int(np.argmin(length))} is zero")
        area = np.ones(len(points)) if self.area_m2 is None else self.area_m2
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "normals", frozen(normals / length[:, None]))
        object.__setattr__(self, "area_m2", frozen(area))
        check_shape(f"sensors {self.name!r}: area_m2", self.area_m2, (len(points),))
        if self.quantity != "planar":
            raise InputError(
                f"sensors {self.name!r}: quantity {self.quantity!r}: only 'planar' is computed"
            )

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, slots=True)
class Camera:
    """A view; ``fov_deg`` is the horizontal field of view. [deg]

    Attributes
    ----------
    eye, target : (x, y, z)
        Position and point looked at. [m]
    name : str
        Name of the image files.
    size : (width, height)
        In pixels.
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    name: str
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    fov_deg: float = 60.0
    size: tuple[int, int] = (800, 600)
    projection: str = "perspective"

    def __post_init__(self) -> None:
        eye, target = np.asarray(self.eye, float), np.asarray(self.target, float)
        for name, value in (("eye", eye), ("target", target), ("up", np.asarray(self.up, float))):
            check_shape(f"camera {self.name!r}: {name}", value, (3,))
            check_finite(f"camera {self.name!r}: {name}", value)
        view = target - eye
        length = float(np.linalg.norm(view))
        if np.linalg.norm(np.cross(view, self.up)) <= 1e-12 * max(1.0, length):
            raise InputError(f"camera {self.name!r}: the view direction is zero or along up")
        if self.projection not in PROJECTIONS:
            raise InputError(
                f"camera {self.name!r}: projection {self.projection!r}: one of {PROJECTIONS}"
            )
        limit = 179.0 if self.projection == "perspective" else 360.0
        if not 0.0 < self.fov_deg <= limit:
            raise InputError(f"camera {self.name!r}: fov_deg = {self.fov_deg}: 0 to {limit:g}")
        if not all(1 <= int(s) <= 16384 for s in self.size):
            raise InputError(f"camera {self.name!r}: size {self.size}: 1 to 16384 pixels")

    def rays(self, *, subpixel: tuple[float, float] = (0.5, 0.5)) -> tuple[FloatArray, FloatArray]:
        """Origins and unit directions (height, width, 3); NaN outside a fisheye's circle."""
        width, height = (int(s) for s in self.size)
        eye = np.asarray(self.eye, float)
        forward = np.asarray(self.target, float) - eye
        distance = float(np.linalg.norm(forward))
        forward /= distance
        right = np.cross(forward, np.asarray(self.up, float))
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        x = (2.0 * (np.arange(width) + subpixel[0]) / width - 1.0)[None, :]
        y = (1.0 - 2.0 * (np.arange(height) + subpixel[1]) / height)[:, None] * height / width
        half = math.radians(0.5 * self.fov_deg)
        origins = np.broadcast_to(eye, (height, width, 3))
        if self.projection == "perspective":
            t = math.tan(half)
            d = forward + (t * x)[..., None] * right + (t * y)[..., None] * up
        elif self.projection == "parallel":
            # As wide as a perspective view of this field is at the target.
            t = math.tan(min(half, 1.5)) * distance
            origins = eye + (t * x)[..., None] * right + (t * y)[..., None] * up
            d = np.broadcast_to(forward, (height, width, 3))
        elif self.projection == "fisheye":
            radius = np.hypot(x, y)
            angle = np.where(radius <= 1.0, radius * half, np.nan)
            with np.errstate(invalid="ignore", divide="ignore"):
                s = np.where(radius > 0.0, np.sin(angle) / radius, half)
            d = (
                np.cos(angle)[..., None] * forward
                + (s * x)[..., None] * right
                + (s * y)[..., None] * up
            )
        else:
            azimuth, altitude = half * x, half * y
            d = (
                np.cos(altitude)[..., None]
                * (np.cos(azimuth)[..., None] * forward + np.sin(azimuth)[..., None] * right)
                + np.sin(altitude)[..., None] * up
            )
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
        return np.ascontiguousarray(origins), np.ascontiguousarray(d)
