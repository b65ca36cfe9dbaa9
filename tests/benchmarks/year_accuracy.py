"""Error against CPU seconds of the year of a room with one window.

    python tests/benchmarks/year_accuracy.py [--accuracy 0.05 0.02 0.01] [--steps 60] [--wea FILE]

The room is that of case D2, 96 sensors in 8760 hours. The error is that of some hours with light,
drawn by chance, against the same sky model converged: finer cells, more points on each element, and
beams from the sun's own place in each hour. Without a weather file, as gendaymtx reads it, the year
is made up. Kernels are loaded before the clock starts.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from pathlib import Path

import numpy as np
from cases.d2_window import CASE
from patchlight.solver import daylit
from patchlight.solver.daylit import DaylitScene
from patchlight.solver.model import Ground, SceneData, Site, Weather
from patchlight.solver.model.arrays import FloatArray, IntArray, frozen
from patchlight.solver.sky_series import SkySeries
from patchlight.solver.store import forget
from patchlight.solver.year_light import light_in_steps
from tools.ours import scene_data
from year_hall import weather

#: Points in the part of an element of each unknown, and cells, of the converged year.
POINTS, SKY_PARTS, BEAM_PARTS = 100, 8, 4


def weather_of(path: Path) -> Weather:
    """Hours of a .wea file: six lines of a head, then month, day, hour, direct, diffuse [W/m²]."""
    lines = path.read_text(encoding="ascii").splitlines()
    head = dict(line.split(maxsplit=1) for line in lines[:6])
    rows = np.array([line.split() for line in lines[6:] if line.strip()], dtype=float)
    starts = np.datetime64("2001-01-01T00:00", "m") + 60 * np.arange(len(rows))
    return dataclasses.replace(
        weather(),
        # Its longitudes and zones run west.
        site=Site(float(head["latitude"]), -float(head["longitude"])),
        utc_offset_h=-float(head["time_zone"]) / 15.0,
        starts=frozen(starts, "datetime64[m]"),
        direct_normal_w_m2=frozen(rows[:, 3]),
        diffuse_horizontal_w_m2=frozen(rows[:, 4]),
        dew_point_c=frozen(np.full(len(rows), np.nan)),
        albedo=frozen(np.full(len(rows), 0.2)),
    )


def room() -> SceneData:
    """The room of the case, under nothing, before a black ground."""
    return dataclasses.replace(scene_data(CASE), sky=None, sun=None, ground=Ground(0.0))


def year(scene: SceneData, skies: SkySeries, accuracy: float) -> tuple[FloatArray, float]:
    """Illuminance (m, n) [lx], and CPU seconds."""
    forget()
    began = time.process_time()
    suns = skies.suns[skies.sun_normal_lx > 0.0]
    found = DaylitScene.of(scene, accuracy=accuracy).coefficients(suns=suns)
    light = light_in_steps(found, skies, np.arange(len(skies))).total
    return light, time.process_time() - began


def converged(scene: SceneData, skies: SkySeries, steps: IntArray) -> FloatArray:
    """Illuminance (m, k) in some steps, to the error of the mesh of accuracy 0.01. [lx]"""
    points = daylit.POINTS
    try:
        daylit.POINTS = (POINTS, POINTS)
        # No sun is told between others: each by itself.
        found = DaylitScene.of(scene, accuracy=0.01).coefficients(
            suns=np.array([[0.0, 0.0, 1.0]]), sky_parts=SKY_PARTS, beam_parts=BEAM_PARTS
        )
    finally:
        daylit.POINTS = points
    light = light_in_steps(found, skies, steps)
    sunny = np.flatnonzero(skies.sun_normal_lx[steps] > 0.0)
    own = found.exact_beams.coefficients(skies.suns[steps[sunny]])
    level = skies.sun_normal_lx[steps[sunny]]
    light.sun_indirect[:] = 0.0
    light.sun_indirect[:, sunny] = own * found.beam_scale[:, None] * level
    return light.total


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--accuracy", type=float, nargs="+", default=[0.05, 0.02, 0.01])
    parser.add_argument("--steps", type=int, default=60, help="compared, default %(default)s")
    parser.add_argument("--wea", type=Path, help="weather file, as gendaymtx reads it")
    options = parser.parse_args()
    skies = SkySeries.of(weather() if options.wea is None else weather_of(options.wea))
    scene = room()
    day = np.flatnonzero(skies.is_day)
    some = np.sort(np.random.default_rng(0).choice(day, options.steps, replace=False))
    truth = converged(scene, skies, some)
    print(f"{'accuracy':>8s} {'CPU s':>8s} {'RMS':>8s} {'99 %':>8s} {'most':>8s}")
    for accuracy in options.accuracy:
        light, seconds = year(scene, skies, accuracy)
        off = np.abs(light[:, some] / truth - 1.0)
        rms = float(np.sqrt(np.mean(off**2)))
        figures = f"{rms:8.2%} {np.quantile(off, 0.99):8.2%} {off.max():8.2%}"
        print(f"{accuracy:8g} {seconds:8.1f} {figures}", flush=True)


if __name__ == "__main__":
    main()
