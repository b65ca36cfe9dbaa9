"""Panes of a scene as the kernels want them, and light along single lines through them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .errors import GeometryError
from .glass import GlassLaw
from .kernels.panes import Panes, shares_along
from .kernels.paths import Tree
from .model.arrays import FloatArray, IntArray
from .model.bezier import tangents
from .model.patches import PatchSet
from .model.scene import SceneData
from .raycast import RayCaster
from .topology import writable


def make_panes(scene: SceneData) -> Panes:
    """The patches of a scene that something is seen through; row p is patch ``opaque_count`` + p.

    Parameters
    ----------
    scene : SceneData
        With or without panes.
    """
    rows = np.flatnonzero(scene.see_through)
    if not len(rows):
        return no_panes()
    angles: list[FloatArray] = [np.empty(0)]
    values: list[FloatArray] = [np.empty(0)]
    laws, end = np.zeros((len(scene.glazings), 5)), 0
    for k, glazing in enumerate(scene.glazings):
        law = GlassLaw.of(glazing)
        start, end = end, end + len(law.angles)
        # A slab that lets nothing through is done without infinities.
        laws[k] = law.n, min(law.depth, 1e3), 1.0 - law.diffuse, start, end
        angles.append(law.angles)
        values.append(law.values)
    index = scene.glass_index[rows]
    solid = np.array([glazing.solid for glazing in scene.glazings], dtype=bool)
    return Panes(
        *make_tree(scene.patches.take(rows)),
        writable(solid[index], np.bool_),
        writable(index, np.int64),
        laws,
        np.concatenate(angles),
        np.concatenate(values),
    )


def no_panes() -> Panes:
    """What nothing is seen through."""
    none = np.empty(0, dtype=np.int64)
    tree = (np.empty((0, 6)), none.reshape(0, 2), none, np.empty((0, 4)))
    nets = np.empty((0, 4, 4, 4)), none
    laws = np.empty((0, 5)), np.empty(0), np.empty(0)
    return Panes(*tree, *nets, np.empty(0, dtype=np.bool_), none, *laws)


def make_tree(patches: PatchSet) -> Tree:
    """What hides light, for rays."""
    # Parallel kernels see all their arrays as writable.
    return Tree(*(np.array(a, order="C") for a in RayCaster(patches).arrays))


def shares_through(
    panes: Panes,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    t_min: float,
    t_max: ArrayLike = 1e300,
) -> tuple[FloatArray, IntArray]:
    """Share (m,) of light that panes leave on lines, and the first pane (m,) met, −1 for none.

    Parameters
    ----------
    origins, directions : (m, 3) array
        Lines. [m]
    t_min, t_max : float, or (m,) array of the latter
        Part of them that counts, in units of the directions' length.
    """
    d = writable(np.asarray(directions))
    out, first = np.ones(len(d)), np.full(len(d), -1, dtype=np.int64)
    origins = writable(np.broadcast_to(np.asarray(origins), d.shape))
    shares_along(
        panes,
        origins,
        d,
        t_min,
        np.array(np.broadcast_to(np.minimum(t_max, 1e300), len(d))),
        out,
        first,
    )
    return out, first


def slab_thickness(patches: PatchSet) -> float:
    """Thickness of a solid pane: how far its faces are apart, those of half its area at least. [m]

    Each patch is crossed from its middle, at normal incidence. The small faces at the edges of a
    pane do not count.

    Raises
    ------
    GeometryError
        If the patches bound nothing.
    """
    middles, normals = [], []
    for net in patches.control_points:
        point, su, sv = tangents(net, 0.5, 0.5)
        normal = np.cross(su, sv)
        middles.append(point)
        normals.append(normal / max(float(np.linalg.norm(normal)), 1e-300))
    inward = -np.array(normals)
    low, high = patches.bounds()
    lift = 1e-9 * float(np.linalg.norm(high - low))
    hits = RayCaster(patches).first_hit(np.array(middles), inward, t_min=lift, facing=-1)
    order = np.argsort(hits.t, kind="stable")
    area = np.cumsum(patches.areas()[order])
    found = float(hits.t[order][np.searchsorted(area, 0.5 * area[-1])])
    if not np.isfinite(found):
        raise GeometryError("glass: the faces of a pane do not bound a solid")
    return found
