"""Light that falls on receivers: what is kept of it, and the direct part of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .budget import Budget
from .dome import DomeLight
from .exchange import Rows
from .kernels.pyramid import Blockers
from .light_colors import ELEMENT_PARTS, SENSOR_PARTS, LightColors
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import Sky, Sun
from .open_sky import OpenSky
from .outside_light import Horizon, OutsideLight
from .pane_dome import Daylight
from .pane_field import PaneField
from .reuse import Kept, tolerances
from .row_finder import Ask
from .skies import ground_luminance
from .stages import Stages
from .sun_disc import DiscLight, SeenDisc, is_up
from .sun_means import put_sun_means
from .surfaces import Receivers, Surfaces
from .uneven import UnevenField
from .unknowns import Unknowns
from .web_field import WebField


@dataclass(eq=False)
class Light:
    """Direct irradiance by group (m, b) and the variance (m,) of what was sampled."""

    direct: dict[str, FloatArray]
    variance: FloatArray
    outside: FloatArray  # (m,) form factor of sky and ground together, and its variance
    outside_variance: FloatArray
    sun: FloatArray | None = None  # (m, b) of the sun without what mirrors throw, on elements


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """Light on some receivers; row i of every array is the same receiver.

    Attributes
    ----------
    components : dict of (m, b) arrays
        ``"<group>.direct"`` and ``"<group>.indirect"``. [lx]
    deviation : (m,) array
        Standard deviation of what was sampled. [lx]
    sun : (m, b) array or None
        What of ``"sun.direct"`` comes straight, not by way of mirrors; None without a sun, and at
        sensors. [lx]
    """

    components: dict[str, FloatArray]
    deviation: FloatArray
    sun: FloatArray | None = None

    @classmethod
    def of(cls, light: Light, indirect: dict[str, FloatArray], variance: FloatArray) -> Gathered:
        """Direct ``light``, and ``indirect`` (m, b) by group with the ``variance`` (m,) of both."""
        components = {}
        for group, direct in light.direct.items():
            components[f"{group}.direct"] = direct
            components[f"{group}.indirect"] = indirect[group]
        return cls(components, np.sqrt(variance + light.variance), light.sun)

    @classmethod
    def joined(cls, parts: Sequence[Gathered]) -> Gathered:
        """Light on the receivers of several, one after the other."""
        names = parts[0].components
        components = {name: np.concatenate([p.components[name] for p in parts]) for name in names}
        deviation = np.concatenate([p.deviation for p in parts])
        suns = [p.sun for p in parts if p.sun is not None]
        return cls(components, deviation, np.concatenate(suns) if suns else None)

    def without(self, rows: NDArray[np.bool_]) -> Gathered:
        """The same with no light on some receivers (m,)."""
        return replace(
            self,
            components={k: np.where(rows[:, None], 0.0, v) for k, v in self.components.items()},
            deviation=np.where(rows, 0.0, self.deviation),
        )

    def luminous(self, kind: str = "") -> FloatArray:
        """Illuminance (m,), of one kind (``"direct"``, ``"indirect"``) or in all. [lx]"""
        parts = [
            luminous(v)
            for name, v in self.components.items()
            if name.endswith(f".{kind}" if kind else "")
        ]
        return np.asarray(sum(parts, np.zeros(len(self.deviation))))


class Incidence:
    """Finds the direct light of one scene.

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
        Receives times, counters and reasons.
    kept : Kept
        What runs before this one have found.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        panes: PaneField,
        *,
        trace: bool,
        stages: Stages,
        kept: Kept,
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self.panes, self.kept = panes, kept
        self.bands = scene.bands
        self.colors = LightColors(scene, self.bands)
        self.lamp_groups = list(dict.fromkeys(lamp.group for lamp in scene.luminaires))
        self.webs = WebField(scene, blockers, panes, trace=trace, stages=stages, kept=kept)
        self.uneven = UnevenField(scene, blockers, panes, trace=trace, stages=stages)
        self.horizon = Horizon(blockers, trace=trace)
        self.disc = DiscLight(blockers, trace=trace)

    @cached_property
    def open_sky(self) -> OpenSky:
        """What is open of the sky from anywhere, by rays."""
        return OpenSky(self.scene, self.blockers, trace=self.trace)

    def on(
        self,
        asked: Ask,
        rows: Rows,
        surfaces: Surfaces,
        unknowns: Unknowns,
        *,
        sees_out: bool,
    ) -> Light:
        """Direct light on unknowns, by light group, lamps first.

        Of sky and ground it is what the meridians of ``rows`` saw of them.
        """
        scanned = rows.outside if self.trace else None
        if scanned is not None and not self.panes.any:
            scanned = self._known_outside(asked, scanned, sees_out)
        light = self.from_outside(
            asked.receivers, asked.budget, sees_out, scanned, on_elements=scanned is not None
        )
        # What comes by way of mirrors is added to a copy.
        light.sun = light.direct.get("sun")
        self._put_sun_means(light, surfaces.elements, unknowns, sees_out)
        self.add_lamps(light, asked, rows, surfaces, areas=unknowns.areas)
        return light

    def alone_on(
        self, elements: Elements, unknowns: Unknowns, budget: Budget, sees_out: bool
    ) -> tuple[Light, NDArray[np.bool_]]:
        """Direct light of sky, sun and ground on unknowns (N,) whose rows nobody asks for.

        Also at which of them it is the mean of the sun's, see `put_sun_means`.
        """
        light = self.from_outside(unknowns.receivers, budget, sees_out, on_elements=True)
        return light, self._put_sun_means(light, elements, unknowns, sees_out)

    def _put_sun_means(
        self, light: Light, elements: Elements, unknowns: Unknowns, sees_out: bool
    ) -> NDArray[np.bool_]:
        """Means of the sun's light over parts of elements: nodes may miss its disc."""
        sun, found = self.scene.sun, light.direct.get("sun")
        if sun is None or found is None or not (self.trace and sees_out and is_up(sun)):
            return np.zeros(len(unknowns), dtype=bool)
        with self.stages.run("sun"):
            color, sky = self.colors.sun, self.open_sky
            told = put_sun_means(found, light.variance, sun, color, elements, unknowns, sky)
            self.stages.count({"sun_means": int(told.sum())})
        return told

    def _known_outside(self, asked: Ask, scanned: FloatArray, sees_out: bool) -> FloatArray:
        """``scanned`` (m, 5) by the meridians, put right where few flat surfaces hide the sky."""
        scene, stages = self.scene, self.stages
        lit = scene.sky is not None or ground_luminance(scene.ground, scene.sky, scene.sun) > 0.0
        if not (lit and sees_out and self.horizon.is_plain):
            return scanned
        with stages.run("sky" if scene.sky is not None else "ground") as tell:
            found = self._outside(asked.receivers, asked.budget.eps, None, tell)
        sky, ground = found.sky, found.ground
        exact = np.stack(
            [
                sky.illuminance / np.pi,
                sky.factor,
                ground.factor,
                (sky.deviation / np.pi) ** 2,
                ground.factor_variance,
            ],
            axis=1,
        )
        return np.where(found.left[:, None], scanned, exact)

    def add_lamps(
        self,
        light: Light,
        asked: Ask,
        rows: Rows,
        surfaces: Surfaces,
        areas: FloatArray | None = None,
    ) -> None:
        """Put the direct light of the luminaires before that of sky, sun and ground.

        Receivers on elements stand for ``areas`` (m,), sensors for none. [m²]
        """
        lamps = {
            group: rows.gather(surfaces.emitted_by(self.scene, group)) for group in self.lamp_groups
        }
        light.direct = {**lamps, **light.direct}
        light.variance += self.webs.add(light.direct, rows, surfaces, asked, areas=areas)
        light.variance += self.uneven.add(
            light.direct, rows, surfaces, asked, closely=areas is None
        )

    def from_outside(
        self,
        receivers: Receivers,
        budget: Budget,
        sees_out: bool,
        scanned: FloatArray | None = None,
        *,
        on_elements: bool = False,
    ) -> Light:
        """Direct light of sky, sun and ground.

        Sky and ground are told by `Horizon` unless ``scanned`` (m, 5) tells what the meridians of
        `form_factor_matrix` saw of them; ``on_elements`` less precisely than at sensors.
        """
        light = Light({}, *np.zeros((3, len(receivers.nodes))))
        if self.panes.any and sees_out:
            self._add_through_panes(light, receivers, budget, on_elements)
            return light
        scene, stages = self.scene, self.stages
        jobs: list[tuple[str, Sky | float]] = []  # of the sun the luminance does not count
        if scene.sky is not None:
            jobs.append(("sky", scene.sky))
        if scene.sun is not None:
            jobs.append(("sun", 0.0))
        level = ground_luminance(scene.ground, scene.sky, scene.sun)
        if level > 0.0:
            jobs.append(("ground", level))
        outside: OutsideLight | None = None
        for name, luminance in jobs:
            if not sees_out and self.stages.skipped.get("visibility") != "switched off":
                stages.skipped[name] = "nothing sees out of the scene"
                light.direct[name] = np.zeros((len(receivers.nodes), self.bands))
                continue
            if scanned is not None and name != "sun":
                column, spread = (0, 3) if name == "sky" else (2, 4)
                brightness = np.pi * (1.0 if isinstance(luminance, Sky) else luminance)
                lux = brightness * scanned[:, column]
                light.direct[name] = lux[:, None] * self._color(name, receivers, lux, True)
                light.variance += brightness**2 * scanned[:, spread]
                continue
            found: DomeLight | SeenDisc
            with stages.run(name) as tell:
                if name == "sun" and scene.sun is not None:
                    found = self._sun(scene.sun, receivers, budget, tell)
                else:
                    if outside is None:
                        cell_eps = budget.cell_eps if on_elements else budget.sensor_dome_cell_eps
                        outside = self._outside(receivers, budget.eps, cell_eps, tell, level > 0.0)
                    found = outside.sky if name == "sky" else outside.ground.times(level)
            lux = found.illuminance
            light.direct[name] = lux[:, None] * self._color(name, receivers, lux, on_elements)
            light.variance += found.deviation**2
            if isinstance(found, DomeLight):
                light.outside += found.factor
                light.outside_variance += found.factor_variance
        return light

    def _color(
        self, name: str, receivers: Receivers, lux: FloatArray, on_elements: bool
    ) -> FloatArray:
        """Colour (b,) of the light (m,) of sky, sun or ground, or (m, b) where it differs."""
        if name != "sky" or not self.colors.sky_varies:
            return np.asarray(getattr(self.colors, name))

        def find() -> FloatArray:
            out = np.broadcast_to(self.colors.sky, (len(lit), self.bands)).copy()
            rows, parts = np.flatnonzero(lit), ELEMENT_PARTS if on_elements else SENSOR_PARTS
            # Of receivers with several nodes the one that stands for most.
            node = receivers.weights[rows].argmax(axis=1)
            at = receivers.nodes[rows, node], receivers.normals[rows, node]
            with self.stages.run("colour of the sky"):
                out[rows] = self.colors.sky_at(self.open_sky, *at, parts)
            return out

        lit = lux > 0.0
        scene = self.scene
        of = (receivers, lit, scene.sky, self.bands, on_elements)
        glass = (scene.glazings, scene.glass_index)
        return self.kept.find("colour of the sky", (*of, *glass), find)

    def _sun(
        self, sun: Sun, receivers: Receivers, budget: Budget, tell: Callable[[int, int], None]
    ) -> SeenDisc:
        """Light of the sun's disc."""

        def find() -> SeenDisc:
            found = self.disc.on(receivers, sun, budget.sun_cell_eps)
            self.stages.count(found.counters)
            tell(len(receivers.nodes), len(receivers.nodes))
            return found

        places = (receivers.nodes, receivers.normals, receivers.weights)
        return self.kept.find("sun", (places, sun, budget.sun_cell_eps), find)

    def _outside(
        self,
        receivers: Receivers,
        eps: float,
        cell_eps: float | None,
        tell: Callable[[int, int], None],
        ground: bool = True,
    ) -> OutsideLight:
        """Light of sky and ground; see `Horizon.light`."""
        sky = self.scene.sky

        def find() -> OutsideLight:
            found = self.horizon.light(
                receivers, sky, ground=ground, eps=eps, cell_eps=cell_eps, progress=tell
            )
            self.stages.count(found.sky.counters)
            self.stages.count(found.ground.counters)
            return found

        return self.kept.find("sky", (receivers, sky, eps, cell_eps, ground), find)

    def _add_through_panes(
        self, light: Light, receivers: Receivers, budget: Budget, on_elements: bool
    ) -> None:
        """The same in a scene with panes."""
        with self.stages.run("light through panes") as tell:
            found = self._daylight(receivers, budget, tell, on_elements=on_elements)
        for name, lux in found.illuminance.items():
            color = self._color(name, receivers, lux, on_elements)
            light.direct[name] = lux[:, None] * color
        light.variance += found.variance
        light.outside += found.outside
        light.outside_variance += found.outside_variance

    def _daylight(
        self,
        receivers: Receivers,
        budget: Budget,
        tell: Callable[[int, int], None],
        *,
        on_elements: bool,
    ) -> Daylight:
        """See `PaneField.daylight`."""
        scene = self.scene
        of = (receivers, tolerances(budget), on_elements, scene.sky, scene.sun, scene.ground)
        return self.kept.find(
            "light through panes",
            (*of, scene.glazings, scene.glass_index),
            lambda: self.panes.daylight(receivers, budget, tell, on_elements=on_elements),
        )
