"""A conference room of 900 bicubic sheets: tables, chairs with bent seats and backs, 24 lamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Body, Case, accuracies, samples
from patchlight.solver.model import PatchSet
from patchlight.solver.model.arrays import FloatArray
from shapes import Patches, Rectangle

#: Room, and reflectance of its walls, floor and ceiling, of table tops, legs, chairs, their legs.
SIZE = (12.0, 8.0, 3.0)
WALLS, FLOOR, CEILING, TOPS, LEGS, CHAIRS, CHAIR_LEGS = 0.6, 0.3, 0.8, 0.5, 0.4, 0.45, 0.35
#: Tables: middles, size, thickness of the top, side of a leg and its distance from the rim. [m]
TABLES = [(x, y) for y in (1.5, 4.0, 6.5) for x in (1.8, 4.6, 7.4, 10.2)]
TABLE, TOP, LEG, INSET = (1.5, 0.8, 0.74), 0.04, 0.05, 0.05
#: Chairs: one at each long side of a table, and six along a wall; height and side of the seat, side
#: of a leg, sag of seat and back. [m]
SEAT, SIDE, CHAIR_LEG, SAG = 0.44, 0.42, 0.04, 0.05
#: Lamps: middles along x and y, side, distance below the ceiling. [m]
LAMPS = [(x, y) for y in (1.0, 3.0, 5.0, 7.0) for x in (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)]
LAMP, BELOW = 0.6, 0.05
#: Illuminance at the sensors for lamps of radiance 1, from `truth_by_mitsuba.py`.
TRUTH = Path(__file__).with_name("f_conference.npy")


def _box(low: FloatArray, high: FloatArray, *, ends: bool) -> list[FloatArray]:
    """Corners (4, 3) of the upright sides of a box, and of its ends. [m]"""
    (a, b, c), (d, e, f) = low, high
    ring = [(a, b), (d, b), (d, e), (a, e)]
    sides = [
        np.array([(*p, c), (*q, c), (*q, f), (*p, f)])
        for p, q in zip(ring, [*ring[1:], ring[0]], strict=True)
    ]
    caps = [np.array([(*p, c) for p in ring[::-1]]), np.array([(*p, f) for p in ring])]
    return sides + caps * ends


def _legs(x: float, y: float, half: tuple[float, float], side: float, top: float) -> list:
    """Upright sides of four square legs whose outer corners are ``half`` from their middle."""
    legs = []
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            at = np.array([x + sx * (half[0] - 0.5 * side), y + sy * (half[1] - 0.5 * side)])
            low = np.array([*(at - 0.5 * side), 0.0])
            legs += _box(low, np.array([*(at + 0.5 * side), top]), ends=False)
    return legs


def _sheet(points: FloatArray) -> FloatArray:
    """Control net (4, 4, 3) of a bicubic surface through a grid (4, 4, 3) at thirds."""
    t = np.arange(4) / 3.0
    bernstein = np.stack(
        [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3],
        axis=1,
    )
    inverse = np.linalg.inv(bernstein)
    return np.einsum("ia,jb,abk->ijk", inverse, inverse, points)


def _chair(x: float, y: float, turn: float) -> tuple[list[FloatArray], list[FloatArray]]:
    """Nets of a seat and of the four pieces of a back, and corners of the sides of its legs.

    The back is at +y before the chair is turned about the vertical by ``turn``. [rad]
    """
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    place = np.array([x, y, 0.0])
    s = np.linspace(-0.5, 0.5, 4)
    u, v = np.meshgrid(s, s, indexing="ij")
    hollow = SAG * ((2.0 * u) ** 2 + (2.0 * v) ** 2 - 1.0)
    sheets = [np.stack([SIDE * u, SIDE * v, SEAT + hollow], axis=-1)]
    for i in (-0.5, 0.0):
        for j in (0.0, 0.5):
            a, b = np.meshgrid(i + 0.5 * (s + 0.5), j + 0.5 * (s + 0.5), indexing="ij")
            bent = 0.5 * SIDE + 0.12 * b**2 - 2.0 * SAG * (2.0 * a) ** 2 * (1.0 - 0.4 * b)
            sheets.append(np.stack([SIDE * a, bent, SEAT + 0.1 + 0.42 * b], axis=-1))
    legs = _legs(0.0, 0.0, (0.5 * SIDE - 0.01, 0.5 * SIDE - 0.01), CHAIR_LEG, SEAT - 0.06)
    return [_sheet(g) @ rotation + place for g in sheets], [q @ rotation + place for q in legs]


def _chairs() -> list[tuple[float, float, float]]:
    """Places and turns; none stands quite straight."""
    out = []
    for x, y in TABLES:
        out += [(x - 0.3, y - 0.62, np.pi), (x + 0.25, y + 0.6, 0.0)]
    out += [(0.4, y, 0.5 * np.pi) for y in (2.0, 2.65, 3.3, 4.7, 5.35, 6.0)]
    return [(x, y, turn + 0.35 * np.sin(5.0 * k)) for k, (x, y, turn) in enumerate(out)]


def _bodies() -> tuple[Body, ...]:
    """Sheets of one reflectance together; each lamp is black on its upper side."""
    x, y, z = SIZE
    *walls, floor, ceiling = _box(np.zeros(3), np.array(SIZE), ends=True)
    tops: list[FloatArray] = []
    legs: list[FloatArray] = []
    half = np.array([0.5 * TABLE[0], 0.5 * TABLE[1]])
    for at in TABLES:
        low = np.array([*(at - half), TABLE[2] - TOP])
        tops += _box(low, np.array([*(at + half), TABLE[2]]), ends=True)
        legs += _legs(*at, tuple(half - INSET), LEG, TABLE[2] - TOP)
    chairs = [_chair(*place) for place in _chairs()]
    seats = np.concatenate([nets for nets, _ in chairs])
    flat = (
        (walls, WALLS),
        ([floor], FLOOR),
        ([ceiling], CEILING),
        (tops, TOPS),
        (legs, LEGS),
        ([quad for _, legs in chairs for quad in legs], CHAIR_LEGS),
    )
    bodies = [
        Body(Patches(PatchSet.from_bilinear(np.array(quads))), 0.0, rho, two_sided=True)
        for quads, rho in flat
    ]
    bodies.append(Body(Patches(PatchSet.from_bezier(seats)), 0.0, CHAIRS, two_sided=True))
    for u, v in LAMPS:
        corner = (u - 0.5 * LAMP, v - 0.5 * LAMP, z - BELOW)
        down = Rectangle(corner, (0.0, LAMP, 0.0), (LAMP, 0.0, 0.0))
        bodies.append(Body(down, radiance=1.0, two_sided=True))
    return tuple(bodies)


def _points() -> FloatArray:
    """Grids of 40 x 25 points over the furniture, and just above the floor."""
    planes = []
    for height, shift in ((1.1, 0.0), (0.002, 0.013)):
        u = np.linspace(0.2, SIZE[0] - 0.2, 40) + shift
        v = np.linspace(0.2, SIZE[1] - 0.2, 25) + shift
        grid = np.meshgrid(u, v, [height], indexing="ij")
        planes.append(np.stack([g.ravel() for g in grid], axis=1))
    return np.concatenate(planes)


POINTS = _points()
CASE = Case(
    name="F",
    title="conference room of 900 bicubic sheets, at 1.1 m and 2 mm above the floor",
    bodies=_bodies(),
    points=POINTS,
    normals=np.tile([0.0, 0.0, 1.0], (len(POINTS), 1)),
    truth=lambda: np.load(TRUTH),
    how="Mitsuba with 16 384 samples a sensor (noise 4e-3)",
    patchlight=accuracies(0.5, 0.3, 0.2, 0.1, 0.05),
    mitsuba=samples(64, 256, 1024, 4096, depth=12, direct="mis"),
)
