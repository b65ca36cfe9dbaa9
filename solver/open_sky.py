"""Which parts of the dome receivers see, as weights of its cells.

The directions in which a receiver sees the sky are found once, as nodes of a rule with weights that
add up to its illuminance under a sky of luminance 1; the light of any sky is a sum over them, and
as skies are linear between the middles of cells, over cells.

Past flat surfaces the edges of what is seen are exact (`kernels.open_sky`). In sectors of azimuth
in which a curved surface may hide something, or there are too many edges, nodes stand on an even
grid, and a ray each tells whether it is open. What panes leave is told by a ray for each node.
`outside_light` and `pane_dome` tell to the accuracy of a simulation how much of an even sky is
seen, by curved edges and at the frames of panes too: the weights of each receiver are scaled to add
up to that, and by how much tells how good they were.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .dome_grid import DomeGrid
from .kernels.nets import PLANAR
from .kernels.panes import Panes
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .outside_light import SECTORS, curved_sides
from .panes import make_panes, shares_through
from .raycast import Hits, RayCaster
from .topology import writable

#: Nodes that a receiver has room for at first and at most, and that a block has: 40 MB.
ROOM, MOST, OF_BLOCK = 20_000, 1_280_000, 1_280_000
#: Azimuth and altitude that two nodes stand for, against the height of a band of cells.
STEP = 1.0
#: Rays a direction of each cell where curved surfaces may hide something, against a band.
FINER = 4
#: Share of the sky below which nothing is scaled: it is the rounding of exact factors.
NOTHING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class SeenSky:
    """What receivers see of the sky; row i of every array is the same of m receivers.

    Attributes
    ----------
    weights : (m, B) array
        Of the cells of the dome. [sr]
    scale : (m,) array
        What they were scaled by.
    by_rays : (m,) int array
        Sectors of azimuth that were told by rays.
    lost : (m,) bool array
        Receivers that see sky which no direction was found for.
    """

    weights: FloatArray
    scale: FloatArray
    by_rays: IntArray
    lost: NDArray[np.bool_]

    @property
    def scaled(self) -> float:
        """By how much weights were scaled, root mean square over receivers that see any sky.

        Weights that were lost are off by all there is.
        """
        seen = self.weights.any(axis=1) | self.lost
        off = np.where(self.lost, 1.0, self.scale - 1.0)[seen]
        return float(np.sqrt(np.mean(off**2))) if seen.any() else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Nodes of a rule over what m receivers see of the sky, k in all.

    Attributes
    ----------
    receiver : (k,) int array
        Whose each is.
    directions : (k, 3) array
        Unit vectors.
    weights : (k,) array
        Solid angle times cosine at the receiver. [sr]
    by_rays : (m,) int array
        Sectors of azimuth that were told by rays.
    short : (m,) bool array
        Receivers that need more room; none of their nodes are here.
    """

    receiver: IntArray
    directions: FloatArray
    weights: FloatArray
    by_rays: IntArray
    short: NDArray[np.bool_]


class OpenSky:
    """What receivers of one scene see of the sky.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its opaque patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    """

    def __init__(self, scene: SceneData, blockers: Blockers, *, trace: bool) -> None:
        self.blockers, self.trace = blockers, trace
        self._planar = np.ascontiguousarray(blockers.flags & PLANAR != 0)
        self._curvy = curved_sides(blockers.nets)
        opaque = scene.without_panes
        self._caster = RayCaster(opaque.patches) if trace else None
        self._panes: Panes | None = None
        if scene.opaque_count < len(scene.patches):
            self._panes = make_panes(scene)
        low, high = scene.patches.bounds()
        #: Diagonal of the scene. [m]
        self.size = float(np.linalg.norm(high - low))
        self._lift = 1e-9 * self.size

    def seen(
        self,
        points: FloatArray,
        normals: FloatArray,
        grid: DomeGrid,
        exact: FloatArray,
        finer: int = FINER,
    ) -> SeenSky:
        """Weights of the cells of ``grid`` for receivers at points (m, 3).

        Parameters
        ----------
        points, normals : (m, 3) array
            Receivers [m] and unit normals.
        grid : DomeGrid
            B cells.
        exact : (m,) array
            Illuminance of the receivers under a sky of luminance 1 cd/m². [lx]
        finer : int
            Rays a direction of each cell where curved surfaces may hide something.
        """
        m, room = len(points), ROOM
        out, by_rays = np.zeros((m, len(grid))), np.zeros(m, dtype=np.int64)
        waiting = np.arange(m)
        while len(waiting):
            short = []
            for start in range(0, len(waiting), OF_BLOCK // room):
                rows = waiting[start : start + OF_BLOCK // room]
                nodes = self._nodes(points[rows], normals[rows], grid.height, room, finer)
                weights = nodes.weights * self.share(points[rows][nodes.receiver], nodes.directions)
                cells, shares = grid.between(nodes.directions)
                found = np.bincount(
                    (nodes.receiver[:, None] * len(grid) + cells).ravel(),
                    (shares * weights[:, None]).ravel(),
                    minlength=len(rows) * len(grid),
                )
                out[rows], by_rays[rows] = found.reshape(len(rows), len(grid)), nodes.by_rays
                short.append(rows[nodes.short])
            waiting, room = np.concatenate(short), 2 * room
        total = out.sum(axis=1)
        some = (total > NOTHING) & (exact > NOTHING)
        scale = np.where(some, exact / np.where(some, total, 1.0), np.where(exact > NOTHING, 1, 0))
        lost = (total <= NOTHING) & (exact > NOTHING)
        return SeenSky(out * scale[:, None], np.asarray(scale), by_rays, lost)

    def share(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """Share (k,) of light that panes leave from ``directions`` (k, 3) at points (k, 3)."""
        return self.share_and_met(points, directions)[0]

    @property
    def has_obstacles(self) -> bool:
        """Whether anything can hide anything."""
        return self._caster is not None

    @property
    def has_panes(self) -> bool:
        """Whether anything is seen through."""
        return self._panes is not None

    def share_and_met(
        self, points: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The same, and whether there is a pane (k,) at all."""
        if self._panes is None or not len(points):
            return np.ones(len(points)), np.zeros(len(points), dtype=bool)
        share, first = shares_through(self._panes, points, directions, t_min=self._lift)
        return share, np.asarray(first >= 0)

    def is_open(self, points: FloatArray, directions: FloatArray) -> NDArray[np.bool_]:
        """Whether rays (k, 3), (k, 3) meet nothing opaque."""
        if self._caster is None or not len(points):
            return np.ones(len(points), dtype=bool)
        return ~np.asarray(self._caster.any_hit(points, directions, t_min=self._lift), dtype=bool)

    def first_hit(self, points: FloatArray, directions: FloatArray) -> Hits:
        """What opaque rays (k, 3), (k, 3) meet first."""
        if self._caster is None:
            raise ValueError("nothing hides anything here: there is no caster of rays")
        return self._caster.first_hit(points, directions, t_min=self._lift)

    def _nodes(
        self, points: FloatArray, normals: FloatArray, height: float, room: int, finer: int
    ) -> Nodes:
        """All nodes of a block, each receiver having ``room`` for so many past flat surfaces."""
        from .kernels.open_sky import NO_ROOM, TOLD, open_directions

        m = len(points)
        out, counts = np.empty((m, room, 4)), np.zeros(m, dtype=np.int64)
        left = np.zeros((m, SECTORS), dtype=np.int64)
        open_directions(
            writable(points),
            writable(normals),
            self.blockers,
            self._planar,
            self._curvy,
            self.trace,
            STEP * height,
            STEP * height,
            out,
            counts,
            left,
        )
        short = (left == NO_ROOM).any(axis=1) & (room < MOST)
        counts[short], left[short] = 0, TOLD  # they come again
        told = np.arange(room) < counts[:, None]
        nodes, receiver = out[told], np.repeat(np.arange(m), counts)
        parts = [(receiver, nodes[:, :3], nodes[:, 3])]
        for sector in np.flatnonzero((left != TOLD).any(axis=0)):
            rows = np.flatnonzero(left[:, sector] != TOLD)
            parts.append(self._by_rays(points, normals, rows, int(sector), height / finer))
        receiver, directions, weights = (np.concatenate(a) for a in zip(*parts, strict=True))
        return Nodes(receiver, directions, weights, (left != TOLD).sum(axis=1), short)

    def _by_rays(
        self, points: FloatArray, normals: FloatArray, rows: np.ndarray, sector: int, step: float
    ) -> tuple[np.ndarray, FloatArray, FloatArray]:
        """The same of one sector that is left, from an even grid of directions."""
        wide, high = (int(math.ceil(a / step)) for a in (2.0 * math.pi / SECTORS, 0.5 * math.pi))
        azimuth = 2.0 * math.pi / SECTORS * (sector + (np.arange(wide) + 0.5) / wide)
        edge = np.linspace(0.0, 0.5 * math.pi, high + 1)
        altitude = 0.5 * (edge[1:] + edge[:-1])
        turn, up = (a.ravel() for a in np.meshgrid(azimuth, altitude, indexing="ij"))
        d = np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)], axis=1)
        solid = np.tile(np.diff(np.sin(edge)), wide) * (2.0 * math.pi / SECTORS / wide)
        cosine = normals[rows] @ d.T
        which, k = np.nonzero(cosine > 0.0)
        lit = self.is_open(points[rows[which]], d[k])
        which, k = which[lit], k[lit]
        return rows[which], d[k], solid[k] * cosine[which, k]
