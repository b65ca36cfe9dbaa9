"""The light of a year, state by state and some sensors at a time, into a store."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.model import Result, SceneData, SensorResult
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bands import SPECTRAL
from patchlight.solver.model.reached import (
    accuracies_reached,
    accuracy_message,
    relative_errors,
)

from .year_store import CHUNK, Block, Piece, YearStore, range_name

if TYPE_CHECKING:
    from patchlight.solver.coefficients import Coefficients
    from patchlight.solver.daylit import DaylitScene
    from patchlight.solver.sky_series import SkySeries
    from patchlight.solver.sun_day import SunDay

Progress = Callable[[str, int, int], None]
#: Steps of a piece.
BLOCK = CHUNK[1]
#: Arrays of the light of lamps.
LUX, EDI = "lux", "melanopic_edi"


@dataclass(frozen=True, slots=True, eq=False)
class Filled:
    """What is known of a year besides its steps; rows are states.

    Attributes
    ----------
    pieces : list of Piece
        All that the store has.
    points : dict of (k, m) arrays
        Values of each sensor.
    electric : dict of (k, g, m) arrays
        Light of the groups of lamps that were asked for, and with spectra its melanopic EDI. [lx]
    warnings : list of str
        Of all states.
    sun_indirect_error : float
        Root mean square of the error of the sun's indirect light against its own, in the worst
        state.
    converged : bool
        Whether all states reached the accuracy; light below 1 % of what a grid has in the brightest
        of them is taken for that much, as a shut blind leaves none that could be told better.
    """

    pieces: list[Piece]
    points: dict[str, FloatArray]
    electric: Block
    warnings: list[str]
    sun_indirect_error: float
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class Filler:
    """Finds the light of a year.

    Attributes
    ----------
    store : YearStore
        Receives it, and may have some of it.
    skies : SkySeries
        Sky and sun of all steps.
    day : SunDay
        The day of which hours of sun are told.
    lamps : tuple of str
        Groups of lamps whose light is told, too.
    accuracy : float
        As of `DaylitScene.of`.
    progress : callable or None
        As of `simulate_year`.
    reserve : int
        Memory that values of all steps are to have. [B]
    """

    store: YearStore
    skies: SkySeries
    day: SunDay
    lamps: tuple[str, ...]
    accuracy: float
    progress: Progress | None
    reserve: int

    def fill(self, scenes: Mapping[str, SceneData]) -> Filled:
        """All states, each solved once, and not at all where the store has all of it."""
        found: list[Filled] = []
        brightest: dict[str, float] = {}
        for k, (name, data) in enumerate(scenes.items()):
            found.append(self._state(k, name, data, brightest))
            for grid, sensors in _even(data, found[-1].points).items():
                mean = sensors.mean(sensors.illuminance_lx)
                brightest[grid] = max(mean, brightest.get(grid, 0.0))
        warnings = [list(one.warnings) for one in found]
        for k, (name, data) in enumerate(scenes.items()):
            points = found[k].points
            even = _even(data, points)
            reached = accuracies_reached(even, brightest)
            if any(error > self.accuracy for error in reached.values()):
                text = accuracy_message(even, self.accuracy, brightest=brightest)
                warnings[k].insert(0, _of_state(name, text))
                found[k] = replace(found[k], converged=False)
            parts = [relative_errors(sensors) for sensors in even.values()]
            counts = [len(sensors.points) for sensors in even.values()]
            # Of grids that are dark nothing is wrong.
            own = [e if len(e) else np.zeros(n) for e, n in zip(parts, counts, strict=True)]
            points["relative_error"] = np.concatenate(own)[None]
            del points["even_lx"], points["even_error_lx"]
        keys = found[0].points
        return Filled(
            pieces=[piece for one in found for piece in one.pieces],
            points={key: np.concatenate([one.points[key] for one in found]) for key in keys},
            electric={
                key: np.concatenate([one.electric[key] for one in found])
                for key in found[0].electric
            },
            warnings=[text for own in warnings for text in own],
            sun_indirect_error=max(one.sun_indirect_error for one in found),
            converged=all(one.converged for one in found),
        )

    def _state(self, k: int, name: str, data: SceneData, brightest: Mapping[str, float]) -> Filled:
        """One state; ``brightest`` are means of the grids in those before it. [lx]"""
        known = self.store.record(f"{k:03d}")
        if known is None or not self._has_all(k, known):
            known = self._solve(k, data, brightest)
        pieces = self._pieces(k, known["edges"])
        tables = [self.store.get(_points_of(k, piece.sensors)) for piece in _first_of(pieces)]
        squares = np.sum([table.pop("sun_squares") for table in tables], axis=0)
        points = {key: np.concatenate([table[key] for table in tables])[None] for key in tables[0]}
        return Filled(
            pieces=pieces,
            points=points,
            electric={
                key: values[None] for key, values in self.store.get(f"{k:03d}-electric").items()
            },
            warnings=[_of_state(name, text) for text in known["warnings"]],
            sun_indirect_error=float(np.sqrt(squares[0] / squares[1])) if squares[1] else 0.0,
            converged=known["converged"],
        )

    def _has_all(self, k: int, known: Mapping[str, Any]) -> bool:
        pieces = self._pieces(k, known["edges"])
        names = [piece.name for piece in pieces]
        names += [_points_of(k, piece.sensors) for piece in _first_of(pieces)]
        return all(self.store.has(name) for name in [*names, f"{k:03d}-electric"])

    def _pieces(self, k: int, edges: list[int]) -> list[Piece]:
        """Those of one state, whose sensors are parted at ``edges``."""
        n = len(self.skies)
        return [
            Piece(k, slice(first, last), slice(start, min(start + BLOCK, n)))
            for first, last in zip(edges[:-1], edges[1:], strict=True)
            for start in range(0, n, BLOCK)
        ]

    def _solve(self, k: int, data: SceneData, brightest: Mapping[str, float]) -> dict[str, Any]:
        """Find what the store does not have of one state; returns what it is to know of that."""
        from patchlight.solver.daylit import DaylitScene
        from patchlight.solver.stages import Stages

        stages = Stages(self.progress)
        lamps, also, reached = self._electric(data)
        self.store.put(f"{k:03d}-electric", lamps)
        daylit = DaylitScene.of(
            data, accuracy=self.accuracy, stages=stages, brightest=dict(brightest)
        )
        edges = [*range(0, len(daylit), daylit.block(self.reserve)), len(daylit)]
        pieces = self._pieces(k, edges)
        open_ = [piece for piece in pieces if not self.store.has(piece.name)]
        done = 0
        for one in _first_of(pieces):
            own = [piece for piece in open_ if piece.sensors == one.sensors]
            if own or not self.store.has(_points_of(k, one.sensors)):
                self._some(daylit, k, one.sensors, own, (done, len(open_)))
            done += len(own)
        record = {
            "edges": edges,
            "warnings": list(dict.fromkeys([*stages.warnings, *also])),
            "converged": reached,
        }
        self.store.put_record(f"{k:03d}", record)
        return record

    def _some(
        self, daylit: DaylitScene, k: int, some: slice, pieces: list[Piece], at: tuple[int, int]
    ) -> None:
        """Some sensors in all steps of ``pieces``."""
        from patchlight.solver.year_light import light_in_steps

        suns = self.skies.suns[self.skies.sun_normal_lx > 0.0]
        found = daylit.coefficients(some, suns=suns)
        own = self._points(found, suns)
        own["even_lx"], own["even_error_lx"] = (values[some] for values in daylit.even_light())
        self.store.put(_points_of(k, some), own)
        for done, piece in enumerate(pieces):
            if self.progress is not None:
                self.progress("year", at[0] + done, at[1])
            steps = np.arange(piece.steps.start, piece.steps.stop)
            light = light_in_steps(found, self.skies, steps)
            parts = {"illuminance": light.total, "sun_illuminance": light.sun_direct}
            if light.melanopic_edi is not None:
                parts["melanopic_edi"] = light.melanopic_edi
            self.store.put(
                piece.name, {key: part.astype(np.float32) for key, part in parts.items()}
            )

    def _points(self, found: Coefficients, suns: FloatArray) -> Block:
        """What is told of each sensor besides its steps."""
        return {
            "daylight_factor": found.daylight_factor(),
            "sunlight_hours": self.day.hours(found.sun),
            "sun_squares": np.array(found.sun_error(suns)),
        }

    def _electric(self, data: SceneData) -> tuple[Block, list[str], bool]:
        """Light (g, m) of the groups of lamps [lx], warnings, and whether it is accurate."""
        spectral = data.bands == SPECTRAL
        shape = len(self.lamps), sum(len(grid) for grid in data.sensors)
        out = {key: np.zeros(shape) for key in (LUX, EDI)[: 1 + spectral]}
        burn = [lamp.group for lamp in data.luminaires if lamp.flux_lm > 0.0]
        groups = [group for group in self.lamps if group in burn]
        if not groups:
            return out, [], True
        # Of the spectrum a result tells that of all light together: one group after the other.
        warnings: list[str] = []
        reached = True
        for some in [[group] for group in groups] if spectral else [groups]:
            result = self._burning(data, some)
            grids = result.sensors.values()
            for group in some:
                g = self.lamps.index(group)
                out[LUX][g] = np.concatenate([_light_of(grid, group) for grid in grids])
                if spectral:
                    out[EDI][g] = np.concatenate([_melanopic_of(grid) for grid in grids])
            warnings += [f"electric light: {text}" for text in result.warnings]
            reached &= result.converged
        return out, warnings, reached

    def _burning(self, data: SceneData, groups: list[str]) -> Result:
        """The scene by night, some groups of lamps burning."""
        from patchlight.solver.simulation import solve

        lamps = tuple(
            lamp if lamp.group in groups else replace(lamp, flux_lm=0.0) for lamp in data.luminaires
        )
        sensors = data.sensors
        if data.bands == SPECTRAL:
            sensors = tuple(replace(grid, spectral=True) for grid in sensors)
        scene = replace(
            data, luminaires=lamps, sky=None, sun=None, ground=None, cameras=(),
            daylight_factors=None, sensors=sensors,
        )  # fmt: skip
        return solve(
            scene,
            accuracy=self.accuracy,
            progress=self.progress,
            cache=True,
            beside="electric",
        )


def _even(data: SceneData, points: Mapping[str, FloatArray]) -> dict[str, SensorResult]:
    """Light of the even sky in one state, by grid, of what is known of its ``points``."""
    out, first = {}, 0
    for grid in data.sensors:
        own = slice(first, first + len(grid))
        light, error = (points[key][0, own] for key in ("even_lx", "even_error_lx"))
        out[grid.name] = SensorResult(
            grid.name, grid.points, grid.normals, grid.area_m2, light, error, {}
        )
        first = own.stop
    return out


def _of_state(name: str, text: str) -> str:
    return f"{name}: {text}" if name else text


def _light_of(grid: SensorResult, group: str) -> FloatArray:
    """Light (m,) of one group at the sensors of a grid. [lx]"""
    names = (f"{group}.direct", f"{group}.indirect")
    parts = [grid.components[name] for name in names if name in grid.components]
    return np.asarray(sum(parts, np.zeros(len(grid.points))))


def _melanopic_of(grid: SensorResult) -> FloatArray:
    """Melanopic EDI (m,) at the sensors of a grid. [lx]"""
    assert grid.spectral is not None
    return grid.spectral.melanopic_edi_lx


def _first_of(pieces: list[Piece]) -> list[Piece]:
    """One piece of each part of the sensors."""
    return [piece for piece in pieces if piece.steps.start == 0]


def _points_of(k: int, sensors: slice) -> str:
    """Name of what is told of some sensors besides their steps."""
    return f"{k:03d}-{range_name(sensors)}-points"
