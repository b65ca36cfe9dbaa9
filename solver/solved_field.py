"""What a scene solved on one mesh is, and what the sensors of a grid see of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .exchange import Rows
from .fineness import Fineness
from .incident import Gathered, Light
from .kernels.rows import Sources
from .mirrors import Reflections
from .model.arrays import FloatArray, MatrixArray
from .model.result import luminous
from .radiosity import RadiositySystem
from .row_finder import Ask
from .shut_in import Hidden
from .surfaces import Surfaces
from .unknowns import Unknowns


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A scene solved on one mesh.

    Attributes
    ----------
    surfaces : Surfaces
        The elements and their optical state.
    sources : Sources
        The elements as the kernels see them, those of panes apart.
    every : Sources
        All of them, to divide their form factors among the unknowns.
    lifts : (n,) array
        How far facets may lie before them. [m]
    unknowns : Unknowns
        What their reflected light is made of.
    system : RadiositySystem
        Reflection between the unknowns.
    row_sums : (n,) array
        Raw sums of those of the elements, before any correction.
    kept : (N,) array
        Sums of those of the unknowns.
    sees_out, lamps_see_out : bool
        Whether light can leave the scene, and whether that of lamps can on its first way.
    hidden : (n,) bool array or None
        Elements that no light reaches, if there are any.
    arriving : Gathered
        Light on the unknowns.
    sent : dict of (N, b) arrays
        Reflected exitance of the unknowns by light group. [lm/m²]
    fineness : Fineness
        Of the sources.
    averaged : tuple of str
        Groups of lamps whose direct light on elements is the mean over them, told by rays. What
        comes by way of mirrors is told by the nodes.
    deviation : (n,) array, optional
        Standard deviation of that of all these groups together [lx]; NaN where the nodes tell it.
    """

    surfaces: Surfaces
    sources: Sources
    every: Sources
    lifts: FloatArray
    unknowns: Unknowns
    system: RadiositySystem
    row_sums: FloatArray
    kept: FloatArray
    sees_out: bool
    lamps_see_out: bool
    hidden: Hidden
    arriving: Gathered
    sent: dict[str, FloatArray]
    fineness: Fineness
    averaged: tuple[str, ...] = ()
    deviation: FloatArray | None = None

    @property
    def all_sent(self) -> FloatArray:
        """Reflected exitance (N, b) of the unknowns, of all groups. [lm/m²]"""
        nothing = np.zeros((len(self.unknowns), self.surfaces.emitted.shape[1]))
        return np.asarray(sum(self.sent.values(), nothing))

    @property
    def exitance_told(self) -> FloatArray:
        """Exitance (n, b) of the elements that form factors carry: webs are none of it. [lm/m²]"""
        return np.asarray(self.surfaces.diffuse + self.unknowns.mean(self.all_sent))

    @property
    def brightest(self) -> FloatArray:
        """Largest exitance (n,) at the unknowns of each element, and its mean at least. [lm/m²]"""
        out = luminous(self.exitance_told)
        at = luminous(self.surfaces.diffuse_at(self.unknowns) + self.all_sent)
        np.maximum.at(out, self.unknowns.element, at)
        return out

    @property
    def sampled(self) -> FloatArray:
        """Standard deviation (n,) of the direct light of lamps where rays tell it. [lx]"""
        none = np.zeros(len(self.surfaces.areas))
        return none if self.deviation is None else np.nan_to_num(self.deviation)


@dataclass(frozen=True, slots=True, eq=False)
class SensorRows:
    """What the sensors of one grid see: rows to the elements, direct light, and mirrors."""

    asked: Ask
    rows: Rows
    light: Light
    mirrored: Reflections | None

    @property
    def factors(self) -> list[MatrixArray]:
        """Form factors (m, n) of the elements, and those by way of mirrors, if there are any."""
        return [self.rows.factors, *([] if self.mirrored is None else [self.mirrored.rows])]
