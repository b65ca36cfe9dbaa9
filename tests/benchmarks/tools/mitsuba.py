"""Mitsuba in this process: irradiance by emitter sampling, and paths where light is reflected.

At a sensor E = ∫ L cos dω. Direct light comes from samples of the emitters, or with ``mis`` from
these and cosine-weighted directions, weighted by the balance heuristic (E. Veach and L. J. Guibas,
"Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995); reflected light
is what the path integrator finds in cosine-weighted directions less the emission that is met first.
"""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
from case import Body, Case, Disc, MitsubaSetting
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.sky import direction
from tools import Missing, Run

VARIANT = "llvm_ad_mono"
#: Samples in one call: more take too much memory.
LANES = 1 << 24
#: Cut of shapes that Mitsuba does not know.
CUT = (8, 8)

#: Rows of a map of the sky.
SKY_ROWS = 2048
#: Distance of the sun's disc. It turns by 4e-7 rad over the room, 1e-4 of its radius, and single
#: precision moves what is sampled on it by 1e-7 rad. [m]
FAR = 1e7

#: Dr.Jit ends the process when it finds an LLVM it does not get on with: tried in another one.
TRIAL = f"""
import mitsuba as mi
mi.set_variant({VARIANT!r})
scene = mi.load_dict({{"type": "scene", "s": {{"type": "sphere"}}}})
ray = mi.Ray3f(mi.Point3f(mi.Float([0, 3]), 0, -5), mi.Vector3f(0, 0, 1))
assert list(scene.ray_intersect(ray).is_valid()) == [True, False]
"""


class MitsubaTool:
    """One wavefront of all samples of as many sensors as fit."""

    name = "mitsuba"

    def __init__(self) -> None:
        self._scenes: dict = {}

    def version(self) -> str:
        tried = subprocess.run(
            [sys.executable, "-c", TRIAL], capture_output=True, text=True, timeout=300, check=False
        )
        if tried.returncode != 0:
            said = (tried.stderr.strip().splitlines() or [f"status {tried.returncode}"])[-1]
            raise Missing(
                f"{said}; it comes with patchlight[peers] and needs LLVM 16 or newer: "
                "set DRJIT_LIBLLVM_PATH to its library"
            )
        import mitsuba

        mitsuba.set_variant(VARIANT)
        return f"Mitsuba {mitsuba.__version__} {VARIANT}"

    def settings(self, case: Case) -> tuple[MitsubaSetting, ...]:
        return case.mitsuba

    def prepare(self, case: Case, setting: MitsubaSetting) -> float:
        """Load the scene and compile the kernels of this setting; CPU seconds."""
        import mitsuba as mi

        start = time.process_time()
        if case.name not in self._scenes:
            self._scenes[case.name] = mi.load_dict(scene_dict(case))
        self._sensors(case, setting, slice(0, 2))
        return time.process_time() - start

    def run(self, case: Case, setting: MitsubaSetting) -> Run:
        block = max(1, LANES // setting.samples)
        start = time.process_time()
        values = [
            self._sensors(case, setting, slice(first, first + block))
            for first in range(0, len(case.points), block)
        ]
        return Run(np.concatenate(values), time.process_time() - start)

    def _sensors(self, case: Case, setting: MitsubaSetting, rows: slice) -> FloatArray:
        import drjit as dr
        import mitsuba as mi

        scene = self._scenes[case.name]
        points, normals = (np.ascontiguousarray(a[rows].T) for a in (case.points, case.normals))
        n = points.shape[1]
        sampler = mi.load_dict({"type": "multijitter", "sample_count": setting.samples})
        sampler.set_samples_per_wavefront(setting.samples)
        sampler.seed(setting.seed * len(case.points) + rows.start, n * setting.samples)
        row = dr.arange(mi.UInt32, n * setting.samples) // setting.samples
        at = dr.zeros(mi.SurfaceInteraction3f, n * setting.samples)
        if case.disc is not None:
            # Rays begin that far in front of a point, a hundredth of a penumbra; light from so far
            # away is the same there.
            points = points - normals * mi.math.RayEpsilon * (1.0 + np.abs(points).max(axis=0))
        at.p = dr.gather(mi.Point3f, mi.Point3f(points), row)
        at.n = dr.gather(mi.Normal3f, mi.Normal3f(normals), row)
        frame = mi.Frame3f(at.n)

        found, weight = scene.sample_emitter_direction(at, sampler.next_2d(), True)
        cosine = dr.maximum(dr.dot(found.d, at.n), 0.0)
        total = weight.x * cosine
        if setting.direct == "mis" or setting.depth > 1:
            local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
            ray = mi.RayDifferential3f(at.p, frame.to_world(local))
            hit = scene.ray_intersect(ray)
            emitter = hit.emitter(scene)
            seen = hit.is_valid() | case.has_sky
            met = dr.select(seen, emitter.eval(hit).x, 0.0)
        if setting.direct == "mis":
            ours = cosine * dr.inv_pi
            # Neither way finds directions below the horizon: 0 / 0.
            total = total * found.pdf / dr.maximum(found.pdf + ours, 1e-30)
            towards = mi.DirectionSample3f(scene, hit, at)
            theirs = scene.pdf_emitter_direction(at, towards, met > 0.0)
            ours = local.z * dr.inv_pi
            total += dr.select(
                met > 0.0, dr.pi * met * ours / dr.maximum(ours + theirs, 1e-30), 0.0
            )
        if setting.depth > 1:
            path = mi.load_dict({"type": "path", "max_depth": setting.depth, "rr_depth": 1000})
            light, _, _ = path.sample(scene, sampler, ray)
            total += dr.pi * (light.x - met)
        mean = dr.block_sum(mi.Float(total), setting.samples) / setting.samples
        return np.array(mean, dtype=np.float64)


def scene_dict(case: Case) -> dict:
    """The case as Mitsuba's dictionary."""
    bodies = {f"b{k}": _shape(body) for k, body in enumerate(case.bodies) if not body.sky}
    if case.disc is not None:
        return {"type": "scene", **bodies, "sun": _far_disc(case.disc)}
    skies = {f"sky{k}": _overcast(b.radiance) for k, b in enumerate(case.bodies) if b.sky}
    return {"type": "scene", **bodies, **skies}


def _overcast(zenith: float) -> dict:
    """The traditional overcast sky, dark below the horizon, as a map of directions."""
    import mitsuba as mi

    altitude = 0.5 * np.pi - np.pi * (np.arange(SKY_ROWS) + 0.5) / SKY_ROWS
    row = np.where(altitude > 0.0, zenith * (1.0 + 2.0 * np.sin(altitude)) / 3.0, 0.0)
    picture = np.broadcast_to(row[:, None, None], (SKY_ROWS, 8, 3)).astype(np.float32)
    upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture.copy()), "to_world": upright}


def _far_disc(disc: Disc) -> dict:
    """The sun as a luminous disk, so far that it stands in one direction from all sensors."""
    import mitsuba as mi

    toward = np.array(direction(disc.altitude, disc.azimuth))
    radius = FAR * np.tan(np.radians(disc.radius))
    at = mi.ScalarTransform4f().look_at(origin=FAR * toward, target=[0, 0, 0], up=[0, 0, 1])
    level = 1.0 / (np.pi * np.sin(np.radians(disc.radius)) ** 2)
    return {
        "type": "disk",
        "to_world": at @ mi.ScalarTransform4f().scale([radius, radius, 1.0]),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": float(level)}},
    }


def _shape(body: Body) -> dict:
    import mitsuba as mi

    bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": body.reflectance}}
    look: dict = {"bsdf": {"type": "twosided", "bsdf": bsdf} if body.two_sided else bsdf}
    if body.radiance > 0.0:
        look["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": body.radiance}}
    shape = body.shape.mitsuba()
    if shape is None:
        return _mesh(body, look)
    if "to_world" in shape:
        shape = shape | {"to_world": mi.ScalarTransform4f(shape["to_world"])}
    return shape | look


def _mesh(body: Body, look: dict):
    import mitsuba as mi

    rings, _ = body.shape.cut(*CUT)
    triangles = np.array(
        [[ring[0], ring[k], ring[k + 1]] for ring in rings for k in range(1, len(ring) - 1)]
    )
    properties = mi.Properties()
    for name, value in look.items():
        properties[name] = mi.load_dict(value)
    mesh = mi.Mesh("polygons", 3 * len(triangles), len(triangles), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(triangles.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(np.arange(3 * len(triangles), dtype=np.uint32))
    parameters.update()
    return mesh
