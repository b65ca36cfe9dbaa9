"""Direct light of lamps whose exitance varies over them, beyond that of even ones."""

from __future__ import annotations

import numpy as np

from .emission import Emission
from .exchange import Rows, form_factor_matrix, make_sources
from .hidden_parts import HiddenParts, partly_hidden
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray
from .model.scene import SceneData
from .pane_field import PaneField
from .row_finder import Ask
from .stages import Stages
from .surfaces import Surfaces

#: Error of the shares of nodes in a form factor, against that of light that has been reflected.
FINE = 0.1
#: Error of the mean over an element against what polynomials miss of its exitance.
OF_MEANS = 0.1


class UnevenField:
    """Uneven lamps of one scene.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its patches as obstacles.
    panes : PaneField
        What is seen through.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives times and counters.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        panes: PaneField,
        *,
        trace: bool,
        stages: Stages,
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self.panes = panes

    def add(
        self,
        direct: dict[str, FloatArray],
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        *,
        closely: bool = False,
    ) -> FloatArray:
        """Add what the light of uneven lamps differs from that of even ones by; see `emission`.

        Parameters
        ----------
        direct : dict of (m, b) arrays
            Light of every group, with the means of all elements; changed in place. [lx]
        rows : Rows
            Form factors from m receivers to the elements of ``surfaces``.
        asked : Ask
            What the rows were asked for.
        closely : bool
            Whether lamps that are hidden in part are cut until what is seen of them is known: at
            sensors. Receivers on elements, over which the error is averaged, state it.

        Returns
        -------
        (m,) array
            Variance by what the polynomials miss, and by what is hidden in part. [lx²]
        """
        emission = surfaces.emission
        if emission is None:
            return np.zeros(len(rows.factors))
        with self.stages.run("uneven lamps"):
            factors = np.asarray(rows.factors[:, emission.element], dtype=np.float64)
            eps = FINE * asked.budget.moments
            off = emission.light(factors, asked.receivers, asked.sources, eps)
            variance = _missed(factors, emission, asked)
            if self.trace:
                variance += self._hidden(off, factors, emission, surfaces, asked, closely=closely)
            light = factors * off
            groups = np.array([self.scene.luminaires[row].group for row in emission.lamp])
            for group in dict.fromkeys(groups):
                own = groups == group
                direct[group] = direct[group] + light[:, own] @ emission.color[own]
            self.stages.count({"uneven_pairs": factors.size})
        return variance

    def _hidden(
        self,
        off: FloatArray,
        factors: FloatArray,
        emission: Emission,
        surfaces: Surfaces,
        asked: Ask,
        *,
        closely: bool,
    ) -> FloatArray:
        """Put ``off`` (m, c) right where lamps are hidden in part; variance (m,) that stays. [lx²]

        Half of the most that may be wrong is taken for a standard deviation.
        """
        receivers, scene = asked.receivers, self.scene
        elements = surfaces.elements.take(emission.element)
        eps = asked.budget.fine_eps
        plain = form_factor_matrix(
            receivers.nodes,
            receivers.normals,
            receivers.weights,
            receivers.patches,
            make_sources(elements, scene.patches.control_points, np.ones(len(elements))),
            self.blockers,
            eps=eps,
            trace=False,
        ).factors
        # Panes dim what is seen as a whole: that hides no part of it.
        plain = self.panes.left_of(plain, asked, elements)
        wrong = partly_hidden(factors, plain) * emission.span
        if not closely:
            return np.asarray(0.25 * (wrong**2).sum(axis=1))
        light = factors @ emission.mean + (factors * off).sum(axis=1)
        parts = HiddenParts(scene, self.blockers, emission, elements, asked, eps)
        left = parts.put_right(off, wrong, light)
        self.stages.count({"hidden_lamp_pairs_traced": parts.traced})
        return 0.25 * left**2


def _missed(factors: FloatArray, emission: Emission, asked: Ask) -> FloatArray:
    """Variance (m,) by what the polynomials miss of the exitance. [lx²]

    It is light in the wrong place, and counts as far as the element is large against its distance;
    the means, too, are found from a few nodes.
    """
    spheres = asked.sources.spheres[emission.element]
    at = asked.receivers.nodes.mean(axis=1)
    away = np.linalg.norm(at[:, None] - spheres[None, :, :3], axis=2)
    moved = np.minimum(1.0, spheres[:, 3] / np.maximum(away, 1e-300))
    return np.asarray(((factors * emission.missed * (OF_MEANS + moved)) ** 2).sum(axis=1))
