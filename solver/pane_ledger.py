"""The flux ledger of a scene with glass.

Light on a pane is reflected, scattered, absorbed, or passes. What passes p meets other surfaces
later, where it is counted: it is neither absorbed here, nor has it entered the scene here, and of
what surfaces send to a pane it has not been stopped there. So what passes is taken from what the
ledger without it calls absorbed, and from what entered or added to what escaped; the residual stays
what it is, a check of the form factors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .glass import GlassLaw
from .kernels.panes import Panes
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.result import Balance, luminous
from .model.scene import SceneData
from .model.sky import direction
from .panes import shares_through
from .raycast import RayCaster
from .skies import luminance

#: Directions over the hemisphere, by height and azimuth, for what passes of the light of the sky.
HEIGHTS, AZIMUTHS = 12, 24


def with_passing(
    balance: Balance,
    names: list[str],
    materials: IntArray,
    absorbed_less: FloatArray,
    entered_less: float,
    escaped_more: float,
) -> Balance:
    """The ledger with flux that passes panes taken out of what they absorb.

    Parameters
    ----------
    names : list of str
        Names of the materials.
    materials, absorbed_less : (n,) array
        Material of each element, and flux that it does not absorb. [lm]
    entered_less, escaped_more : float
        Flux that has not entered here, and that is not stopped here. [lm]
    """
    by_material = dict(balance.absorbed_by_material)
    for row in np.unique(materials[absorbed_less != 0.0]):
        name = names[row] if row >= 0 else "black"
        by_material[name] -= float(absorbed_less[materials == row].sum())
    return replace(
        balance,
        absorbed_lm=balance.absorbed_lm - float(absorbed_less.sum()),
        entered_lm=balance.entered_lm - entered_less,
        escaped_lm=balance.escaped_lm + escaped_more,
        absorbed_by_material=by_material,
    )


class Passing:
    """What passes the panes of one scene straight, as exitance of their far sides.

    Parameters
    ----------
    scene : SceneData
        With see-through patches.
    panes : Panes
        These.
    elements : Elements
        All elements, those of panes last.
    """

    def __init__(self, scene: SceneData, panes: Panes, elements: Elements) -> None:
        self.scene, self.panes = scene, panes
        self._all, clear = elements, elements.patch_index >= scene.opaque_count
        self.rows = np.flatnonzero(clear)
        self._own = elements.take(self.rows)
        kinds = scene.glass_index[self._own.patch_index]
        self._laws = [GlassLaw.of(scene.glazings[k]) for k in kinds]
        low, high = scene.patches.bounds()
        self._lift = 1e-9 * float(np.linalg.norm(high - low))

    def of_surfaces(self, factors: FloatArray, exitance: FloatArray) -> FloatArray:
        """Of what all elements send (n, b): (k, b). [lm/m²]

        ``factors`` (k, n) are what the panes see.
        """
        points, normals, areas = self._all.nodes, self._all.normals, self._all.weights
        out = np.zeros((len(self.rows), exitance.shape[1]))
        for k, law in enumerate(self._laws):
            light, view = np.zeros((2, len(points)))
            for node, normal, weight in zip(
                self._own.nodes[k], self._own.normals[k], self._own.weights[k], strict=True
            ):
                way = points - node
                square = np.maximum(np.einsum("nqk,nqk->nq", way, way), 1e-100)
                here = np.maximum(way @ normal, 0.0)
                there = np.maximum(-np.einsum("nqk,nqk->nq", way, normals), 0.0)
                seen = weight * areas * here * there / square**2
                light += (seen * law.transmittance(here / np.sqrt(square))).sum(axis=1)
                view += seen.sum(axis=1)
            straight = np.where(view > 0.0, light / np.where(view > 0.0, view, 1.0), 0.0)
            out[k] = (factors[k] * straight * (1.0 - law.diffuse)) @ exitance
        return out

    def of_daylight(self, direct: Mapping[str, FloatArray]) -> FloatArray:
        """Of the direct light of sky, sun and ground, by group (n, b): (k, b). [lm/m²]"""
        out = np.zeros((len(self.rows), next(iter(direct.values())).shape[1]))
        if "sun" in direct and self.scene.sun is not None:
            sun = np.array(direction(self.scene.sun.altitude_deg, self.scene.sun.azimuth_deg))
            for k, law in enumerate(self._laws):
                cosine = np.maximum(self._own.normals[k] @ sun, 0.0).mean()
                share = law.transmittance(cosine) * (1.0 - law.diffuse)
                out[k] += share * direct["sun"][self.rows[k]]
        groups = [name for name in ("sky", "ground") if name in direct]
        lit = np.array([any(direct[g][row].any() for g in groups) for row in self.rows])
        if lit.any():
            shares = self._dome_shares(np.flatnonzero(lit))
            for group in groups:
                out[lit] += shares[group][:, None] * direct[group][self.rows[lit]]
        return out

    def of_lamps(self, light: FloatArray) -> FloatArray:
        """Of other light (k, b) of lamps, taken to come from all directions alike."""
        shares = [law.diffuse_transmittance * (1.0 - law.diffuse) for law in self._laws]
        return np.asarray(np.array(shares)[:, None] * light)

    def _dome_shares(self, some: IntArray) -> dict[str, FloatArray]:
        """Mean share of the light of sky and ground that passes panes ``some``."""
        caster = RayCaster(self.scene.without_panes.patches)
        sine = np.sqrt((np.arange(HEIGHTS) + 0.5) / HEIGHTS)
        azimuth = 2.0 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
        s, a = (g.ravel() for g in np.meshgrid(sine, azimuth, indexing="ij"))
        local = np.stack([s * np.cos(a), s * np.sin(a), np.sqrt(1.0 - s**2)], axis=1)
        out = {"sky": np.zeros(len(some)), "ground": np.zeros(len(some))}
        for place, k in enumerate(some):
            normal, law = self._own.normals[k, 0], self._laws[k]
            help_axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
            e1 = np.cross(normal, help_axis)
            e1 /= np.linalg.norm(e1)
            d = local @ np.stack([e1, np.cross(normal, e1), normal])
            start = np.broadcast_to(self._own.nodes[k, 0], d.shape)
            seen = ~caster.any_hit(start, d, t_min=self._lift)
            light = seen * shares_through(self.panes, start, d, t_min=self._lift)[0]
            straight = law.transmittance(local[:, 2]) * (1.0 - law.diffuse)
            up = d[:, 2] > 0.0
            sky = self.scene.sky
            level = np.ones(len(d)) if sky is None else luminance(sky, d)
            for name, there, bright in (("sky", up, level), ("ground", ~up, np.ones(len(d)))):
                weight = light * there * bright
                total = weight.sum()
                mean = (weight @ straight) / total if total > 0.0 else None
                out[name][place] = (
                    law.diffuse_transmittance * (1.0 - law.diffuse) if mean is None else mean
                )
        return out


def passing_flux(areas: FloatArray, exitance: FloatArray) -> FloatArray:
    """Luminous flux (k,) of exitance (k, b) of areas (k,). [lm]"""
    return np.asarray(luminous(exitance) * areas)
