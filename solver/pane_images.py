"""Panes as they are seen in one flat mirror: those before its plane, and their images behind it."""

from __future__ import annotations

import numpy as np

from .images import TOUCH, Window, pieces_before
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.patches import PatchSet
from .model.scene import SceneData
from .pane_rows import TOLERANCE, keep_back
from .panes import make_panes, make_tree, shares_through
from .row_finder import Ask
from .surfaces import Receivers


class PaneImages:
    """What panes leave of light on paths over a mirror, straight from the image of a receiver.

    Parameters
    ----------
    scene : SceneData
        With see-through patches.
    window : Window
        The mirror.
    size : float
        Of the scene. [m]
    """

    def __init__(self, scene: SceneData, window: Window, size: float) -> None:
        own = make_panes(scene)
        before = pieces_before(own.nets, window.plane, TOUCH * size)
        #: Whether there are any.
        self.any = len(before.patch) > 0
        self._rounding = 1e-9 * size
        if not self.any:
            return
        nets = np.concatenate([before.nets, window.plane.image_net(before.nets)])
        rows = np.tile(before.patch, 2)
        more = (own.solid[rows], own.law[rows], own.laws, own.angles, own.values)
        self._panes = type(own)(*make_tree(PatchSet(nets)), *more)
        self._tree = make_tree(PatchSet(window.near.nets))

    def left_of(
        self,
        factors: FloatArray,
        variances: FloatArray,
        images: Receivers,
        parts: Elements,
        asked: Ask,
    ) -> tuple[FloatArray, FloatArray]:
        """Form factors (m, k) of what is seen through the mirror, and their variances, dimmed."""
        if not self.any:
            return factors, variances
        before, none = np.array(factors, dtype=np.float32), np.zeros(factors.shape, np.float32)
        after = before.copy()
        wanted = TOLERANCE * float(np.median(asked.sources.cell_eps))
        keep_back(after, none, images, parts, self._panes, self._tree, self._rounding, wanted)
        share = after / np.where(before > 0.0, before, 1.0)
        return factors * share, variances * share**2

    def left_of_beam(self, images: Receivers, toward: FloatArray) -> FloatArray:
        """Share (m,) left of light from one direction (3,), in the mean over the nodes."""
        m, q = images.weights.shape
        if not self.any:
            return np.ones(m)
        nodes = images.nodes.reshape(-1, 3)
        way = np.broadcast_to(toward, nodes.shape)
        share, _ = shares_through(self._panes, nodes, way, t_min=self._rounding)
        total = images.weights.sum(axis=1)
        mean = (share.reshape(m, q) * images.weights).sum(axis=1)
        return np.asarray(mean / np.where(total > 0.0, total, 1.0))
