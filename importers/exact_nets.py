"""Nets that need no measuring: planar Coons patches and pieces of splines of degree <= 3.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 13 and 22.
"""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from . import nurbs
from .cells import Cell


def planar_nets(cells: list[Cell]) -> FloatArray:
    """Homogeneous Coons nets (n, 4, 4, 4) of planar cells. [1, sec. 22.1]"""
    sides = np.empty((len(cells), 4, 4, 4))
    for row, cell in zip(sides, cells, strict=True):
        for k, arc in enumerate(cell.sides):
            if arc is None:
                before = cell.sides[k - 1]
                assert before is not None and before.net is not None
                row[k] = before.net[3]
            else:
                assert arc.net is not None
                row[k] = arc.net
    c, right, d, left = sides[:, 0], sides[:, 1], sides[:, 2, ::-1], sides[:, 3, ::-1]
    t = (np.arange(4) / 3.0)[None, None, :, None]
    s = (np.arange(4) / 3.0)[None, :, None, None]
    ruled = (1 - t) * c[:, :, None] + t * d[:, :, None]
    ruled = ruled + (1 - s) * left[:, None] + s * right[:, None]
    corner = (1 - s) * ((1 - t) * c[:, None, :1] + t * d[:, None, :1])
    corner = corner + s * ((1 - t) * c[:, None, 3:] + t * d[:, None, 3:])
    nets = np.asarray(ruled - corner)
    nets[:, :, 0], nets[:, :, 3], nets[:, 0], nets[:, 3] = c, d, left, right
    return nets


def spline_nets(surface_pieces: FloatArray, u_cuts: list, v_cuts: list) -> FloatArray:
    """Exact bicubic nets of Bézier pieces of degree <= 3 restricted to local boxes.

    ``u_cuts`` and ``v_cuts`` list (piece, local start, local end).
    """
    du, dv = surface_pieces.shape[2] - 1, surface_pieces.shape[3] - 1
    i, j = np.array([c[0] for c in u_cuts]), np.array([c[0] for c in v_cuts])
    along_u = nurbs.elevation(du) @ np.array([nurbs.restriction(du, a, b) for _, a, b in u_cuts])
    along_v = nurbs.elevation(dv) @ np.array([nurbs.restriction(dv, a, b) for _, a, b in v_cuts])
    nets = along_v[:, None] @ surface_pieces[i[:, None], j]
    nets = (along_u[:, None] @ nets.reshape(len(i), len(j), du + 1, -1)).reshape(-1, 4, 4, 4)
    return np.asarray(nets / nets[..., 3].max(axis=(1, 2))[:, None, None, None])
