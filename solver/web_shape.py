"""The emitting shape of a lamp with a photometric web: its projected area in every direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.bezier import area_points, areas, gauss_rule
from .model.patches import PatchSet
from .model.photometry import Web

#: Gauss nodes a direction on each curved patch.
_NODES = 20
#: Cells of the quadrature over directions: flat shapes, and those with curved faces. [deg]
_STEP_DEG, _CURVED_STEP_DEG = 2.5, 5.0
#: Directions at a time.
_BLOCK = 2048
#: Projected area, relative to the area, that counts as none.
_TINY = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class WebShape:
    """Emitting faces of one lamp.

    Attributes
    ----------
    flat : (a, 4) array
        Unit normals and areas of flat faces, one a direction. [m²]
    facets : (f, 4) array
        Unit normals and areas of small pieces of curved faces. [m²]
    """

    flat: FloatArray
    facets: FloatArray

    @classmethod
    def of(cls, patches: PatchSet, turned: IntArray) -> WebShape:
        """The shape of patches that shine from their + side, or from the other where ``turned``."""
        nets = patches.control_points.copy()
        turned = np.asarray(turned, dtype=bool)
        nets[turned] = nets[turned][:, ::-1]
        _, vectors = area_points(nets, _NODES)
        size = np.linalg.norm(vectors, axis=2)
        total = vectors.sum(axis=1)
        length = np.linalg.norm(total, axis=1)
        # As long as the sum of their lengths only where all point the same way.
        is_flat = length >= size.sum(axis=1) * (1.0 - 1e-12)
        flat = np.concatenate(
            [total[is_flat] / length[is_flat, None], areas(nets[is_flat])[:, None]], axis=1
        )
        rest, size = vectors[~is_flat].reshape(-1, 3), size[~is_flat].ravel()
        rest, size = rest[size > 0.0], size[size > 0.0]
        return cls(_merged(flat), np.concatenate([rest / size[:, None], size[:, None]], axis=1))

    @property
    def area(self) -> float:
        """Emitting area. [m²]"""
        return float(self.flat[:, 3].sum() + self.facets[:, 3].sum())

    def projected(self, directions: FloatArray) -> FloatArray:
        """Area (m,) projected on unit directions (m, 3), hiding left aside. [m²]"""
        out = np.empty(len(directions))
        pieces = np.concatenate([self.flat, self.facets])
        for start in range(0, len(out), _BLOCK):
            rows = slice(start, start + _BLOCK)
            out[rows] = np.maximum(directions[rows] @ pieces[:, :3].T, 0.0) @ pieces[:, 3]
        return out

    def curved_table(self, web: Web) -> FloatArray:
        """Projected area of the facets over C and γ of ``web``, without rows if there are none."""
        from .kernels.webs import TABLE_C, TABLE_GAMMA

        if not len(self.facets):
            return np.zeros((0, TABLE_GAMMA))
        c, gamma = np.meshgrid(
            np.linspace(0.0, 360.0, TABLE_C), np.linspace(0.0, 180.0, TABLE_GAMMA), indexing="ij"
        )
        only = WebShape(np.zeros((0, 4)), self.facets)
        return only.projected(directions(web, c.ravel(), gamma.ravel())).reshape(c.shape)

    def seen_share(self, web: Web) -> float:
        """Share of the web's flux in directions to which the shape shows any emitting face."""
        towards, solid, intensity = web_directions(web, self)
        seen = self.projected(towards) > _TINY * self.area
        flux = solid * intensity
        return 1.0 if seen.all() else float(flux[seen].sum() / flux.sum())


def _merged(flat: FloatArray) -> FloatArray:
    """Faces that look the same way as one."""
    out: list[FloatArray] = []
    for row in flat:
        for k, other in enumerate(out):
            if other[:3] @ row[:3] > 1.0 - 1e-14:
                out[k] = np.append(other[:3], other[3] + row[3])
                break
        else:
            out.append(row)
    return np.array(out).reshape(-1, 4)


def directions(web: Web, c_deg: FloatArray, gamma_deg: FloatArray) -> FloatArray:
    """Unit directions (m, 3) of C and γ (m,)."""
    c, gamma = np.radians(c_deg), np.radians(gamma_deg)
    own = np.stack([np.sin(gamma) * np.cos(c), np.sin(gamma) * np.sin(c), np.cos(gamma)], axis=1)
    return np.asarray(own @ web.axes)


def web_directions(web: Web, shape: WebShape) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Quadrature over a web: unit directions (m, 3), their solid angles and intensities (m,).

    Cells end at the angles of the web, where it bends, and at γ = 90°, where flat lamps end.
    """
    step = _CURVED_STEP_DEG if len(shape.facets) else _STEP_DEG
    photometry = web.photometry
    gamma_ends = np.unique(np.append(photometry.gamma_deg, 90.0))
    gamma_ends = gamma_ends[
        (gamma_ends >= photometry.gamma_deg[0]) & (gamma_ends <= photometry.gamma_deg[-1])
    ]
    c, wc = _points(photometry.c_deg, 2.0 * step)
    gamma, wg = _points(gamma_ends, step)
    c_all, gamma_all = (g.ravel() for g in np.meshgrid(c, gamma, indexing="ij"))
    solid = np.outer(np.radians(wc), np.radians(wg) * np.sin(np.radians(gamma))).ravel()
    return directions(web, c_all, gamma_all), solid, photometry.intensity(c_all, gamma_all)


def _points(ends: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Gauss points and weights in all intervals, each cut into pieces of at most ``step``."""
    t, w = gauss_rule(3)
    cuts = [
        np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)) + 1)[:-1]
        for a, b in zip(ends[:-1], ends[1:], strict=True)
    ]
    edges = np.append(np.concatenate(cuts), ends[-1])
    wide = np.diff(edges)
    return (edges[:-1, None] + wide[:, None] * t).ravel(), (wide[:, None] * w).ravel()
