"""Direct light of the sun's disc: its area, cut by the shadow edges that a receiver sees across it.

Past flat surfaces with straight sides it is exact (`kernels.sun_disc`); past others the disc is
quartered until each part has one edge at most, which is found (`kernels.disc_cells`).

Both are of a disc of even brightness. One whose brightness depends on the distance from its middle
is a stack of even discs of different size: with W(μ) the brightness and μ from 1 in the middle to 0
at the rim,

    ∫ W f dA = W(0) A(0) f(0) + ∫ W'(μ) A(μ) f(μ) dμ

A(μ) being the area within μ, and f(μ) the share of it that is seen.

.. [1] A. N. Cox (ed.), "Allen's Astrophysical Quantities", 4th ed., Springer, 2000, section 14.7:
   I(μ) / I(1) = 1 − u − v + u μ + v μ², at 550 nm with u = 0.93 and v = −0.23.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import NumericsError
from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray
from .model.bezier import gauss_rule, surface_points
from .model.sky import Sun, direction
from .outside_light import curved_sides
from .surfaces import Receivers
from .topology import writable

#: Limb darkening u and v. [1]
DARKENING = (0.93, -0.23)
#: Discs that a darkened or large one is a stack of, besides the whole.
DISCS = 16
#: How uneven a disc may be, seen on the plane perpendicular to it, to be taken for even: one of
#: 38 arcmin in radius is as much.
_EVEN = 2.5e-4
#: Quarterings of the square about a disc at least and at most.
_LEVELS = (4, 10)
#: Height of a corner over the line of its neighbours, against their distance, that is none.
_STRAIGHT = 1e-9
#: Cosine below 1 up to which normals are the same: an angle of 0.08 degrees.
_BEND = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SeenDisc:
    """Light of the disc; row i of every array is the same of m receivers.

    Attributes
    ----------
    illuminance : (m,) array
        [lx]
    deviation : (m,) array
        Standard deviation of what was found by rays of it, and half of what taking the disc for
        even may leave where it is seen in part. [lx]
    counters : dict
        Receivers with something curved before the disc, and parts of it that were looked at.
    """

    illuminance: FloatArray
    deviation: FloatArray
    counters: dict[str, int]


class DiscLight:
    """What may hide the sun.

    Parameters
    ----------
    blockers : Blockers
        Patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    """

    def __init__(self, blockers: Blockers, *, trace: bool) -> None:
        self.blockers, self.trace = blockers, trace
        self.straight, self.smooth = straight_sided(blockers), smooth_sides(blockers)

    def on(self, receivers: Receivers, sun: Sun, share: float) -> SeenDisc:
        """Mean light of ``sun`` over the nodes of receivers; see `at`."""
        used = receivers.weights > 0.0
        found = self.at(receivers.nodes[used], receivers.normals[used], sun, share)
        light, spread = np.zeros((2, *used.shape))
        light[used], spread[used] = found.illuminance, found.deviation**2
        weights = receivers.weights
        return SeenDisc(
            np.asarray((weights * light).sum(axis=1)),
            np.sqrt((weights**2 * spread).sum(axis=1)),
            found.counters,
        )

    def at(self, points: FloatArray, normals: FloatArray, sun: Sun, share: float) -> SeenDisc:
        """What receivers at ``points`` (m, 3) get of the disc of ``sun``.

        Parameters
        ----------
        points, normals : (m, 3) array
            Receivers [m] and unit normals.
        sun : Sun
            Its place, size and limb; what of it is below the horizon z = 0 does not shine.
        share : float
            Share of the disc below which a part that several edges cross is sampled.

        Raises
        ------
        NumericsError
            If a value is not finite.
        """
        from .kernels.disc_cells import disc_cell_rows
        from .kernels.sun_disc import LEFT, disc_rows

        points, normals = writable(points), writable(normals)
        toward = np.array(direction(sun.altitude_deg, sun.azimuth_deg))
        out, deviation = np.zeros((2, len(points)))
        counters = {"sun_past_curves": 0, "sun_parts": 0}
        stack = stack_of(sun)
        for radius, weight in stack:
            found = np.empty((len(points), 1))
            disc_rows(
                points, normals, toward[None], radius, self.blockers, self.straight, self.trace,
                found,
            )  # fmt: skip
            left = np.flatnonzero(found[:, 0] == LEFT)
            if len(left):
                more, parts = np.zeros((len(left), 2)), np.zeros(len(left), dtype=np.int64)
                places = writable(points[left]), writable(normals[left])
                disc_cell_rows(
                    *places, toward, radius, self.blockers, self.smooth, _levels(share), more, parts
                )
                found[left, 0] = more[:, 0]
                # The same edges cross all discs of a stack: their errors are not independent.
                deviation[left] += abs(weight) * np.sqrt(more[:, 1])
                counters["sun_past_curves"] = max(counters["sun_past_curves"], len(left))
                counters["sun_parts"] += int(parts.sum())
            out += weight * found[:, 0]
        if len(stack) == 1:
            # Of brightness 1 + e (1/2 − r²) within r = 1 a part of the area f has e f (1 − f) / 2
            # more at most.
            whole = np.maximum(normals @ toward, 0.0)
            unseen = np.clip(whole - out, 0.0, None) / np.where(whole > 0.0, whole, 1.0)
            deviation += 0.25 * _unevenness(sun) * out * unseen
        if not np.isfinite(out).all():
            bad = int(np.flatnonzero(~np.isfinite(out))[0])
            raise NumericsError(f"light of the sun at receiver {bad}: not finite")
        level = sun.normal_illuminance_lx
        return SeenDisc(level * out, level * deviation, counters)


def is_up(sun: Sun) -> bool:
    """Whether the sun shines, any of its disc being above the horizon."""
    above = sun.altitude_deg > -sun.angular_radius_arcmin / 60.0
    return above and sun.normal_illuminance_lx > 0.0


def _unevenness(sun: Sun) -> float:
    """By how much a disc is brighter in its middle than at its rim, on a plane: cos⁴ there."""
    return 2.0 * math.sin(math.radians(sun.angular_radius_arcmin / 60.0)) ** 2


def stack_of(sun: Sun) -> tuple[tuple[float, float], ...]:
    """Tangent of the radius, and weight, of the even discs that make up that of ``sun``.

    Weights add up to 1: each is light on a plane facing the sun.
    """
    sine = math.sin(math.radians(sun.angular_radius_arcmin / 60.0))
    whole = math.tan(math.radians(sun.angular_radius_arcmin / 60.0))
    if not sun.limb_darkening and _unevenness(sun) < _EVEN:
        return ((whole, 1.0),)
    u, v = DARKENING if sun.limb_darkening else (0.0, 0.0)
    x, w = gauss_rule(DISCS)
    mu = np.append(x, 0.0)
    # Cosine squared from the middle: a part of a plane that far out is seen the smaller.
    cos2 = 1.0 - sine**2 * (1.0 - mu**2)
    bright, slope = 1.0 - u - v + u * mu + v * mu**2, u + 2.0 * v * mu
    weight = np.append(w, 1.0) * np.where(
        mu > 0.0, slope * cos2**2 + 4.0 * bright * cos2 * sine**2 * mu, bright * cos2**2
    )
    radius = np.sqrt((1.0 - cos2) / cos2)
    weight *= radius**2
    return tuple(zip(radius.tolist(), (weight / weight.sum()).tolist(), strict=True))


def _levels(share: float) -> int:
    """Quarterings of the square about the disc until one is below ``share`` of the disc."""
    least, most = _LEVELS
    return min(max(math.ceil(0.5 * math.log2(4.0 / (math.pi * share))), least), most)


def straight_sided(blockers: Blockers) -> NDArray[np.bool_]:
    """Which patches (p,) are flat and convex, and have straight sides."""
    corners = blockers.nets[:, [0, 3, 3, 0], [0, 0, 3, 3]]
    points = corners[..., :3] / corners[..., 3:]
    before, after = np.roll(points, 1, axis=1) - points, np.roll(points, -1, axis=1) - points
    turn = np.einsum("pkx,px->pk", np.cross(after, before), blockers.cones[:, :3])
    size = np.linalg.norm(before, axis=2) * np.linalg.norm(after, axis=2)
    high = (turn >= -_STRAIGHT * size).all(axis=1) | (turn <= _STRAIGHT * size).all(axis=1)
    flat = blockers.flags & PLANAR != 0
    return np.ascontiguousarray(flat & ~curved_sides(blockers.nets).any(axis=1) & high)


def smooth_sides(blockers: Blockers) -> NDArray[np.bool_]:
    """Across which sides (p, 4) patches go on without a bend, as far as their middles tell."""
    u, v = np.array([[0.5, 1.0, 0.5, 0.0], [0.0, 0.5, 1.0, 0.5]])
    count = len(blockers.nets)
    at = (np.broadcast_to(a, (count, 4)) for a in (u, v))
    points, su, sv = surface_points(blockers.nets, *at)
    normals = np.cross(su, sv)
    normals /= np.maximum(np.linalg.norm(normals, axis=2), 1e-300)[..., None]
    other = np.maximum(blockers.adjacent, 0)
    away = np.linalg.norm(points[other] - points[:, :, None], axis=3)
    near = away.argmin(axis=2)
    along = np.take_along_axis(normals[other], near[..., None, None], axis=2)[:, :, 0]
    bend = 1.0 - np.einsum("pkx,pkx->pk", along, normals)
    meet = away.min(axis=2) <= _STRAIGHT * np.abs(points).max(initial=0.0)
    return np.ascontiguousarray((blockers.adjacent >= 0) & meet & (bend < _BEND))
