"""Radiance's programs as processes: their output and their CPU seconds."""

from __future__ import annotations

import os
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from patchlight.solver.errors import PatchlightError
from patchlight.solver.model.arrays import FloatArray
from radiance_scene import SKY_CAL

#: A sensor's value takes no part in the next one's: no cache, no interpolation, no jitter of the
#: shadow rays and none of them left to chance.
BASE = "-aa 0 -as 0 -av 0 0 0 -dt 0 -dc 1 -dj 0 -dr 0 -st 1 -u+".split()


@dataclass(frozen=True, slots=True)
class Traced:
    """Irradiance (repeats, n, 3) of n sensors in three bands [lx], and CPU seconds."""

    irradiance: FloatArray
    cpu_s: float


def direct(ds: float = 0.02, ab: int = 0, ad: int = 0) -> list[str]:
    """Options of light that comes straight from lamps, or with ``ab=1`` from glowing domes."""
    return [*BASE, *f"-ab {ab} -ad {ad} -lw 0 -lr 0 -ds {ds}".split()] if ab == 0 else [
        *BASE, *f"-ab {ab} -ad {ad} -lw 1e-9 -lr 0 -ds {ds}".split()
    ]  # fmt: skip


def indirect(ad: int, ds: float = 0.3, ab: int = 30) -> list[str]:
    """Options of all reflections: paths end by Russian roulette, which has no bias."""
    return [*BASE, *f"-ab {ab} -ad {ad} -lw {0.02 / ad:.3g} -lr -{ab} -ds {ds}".split()]


class Radiance:
    """Scenes in a folder of their own; see `trace`."""

    def __init__(self, folder: Path | None = None) -> None:
        import pyradiance

        self._home = Path(pyradiance.__file__).parent
        self._keep = None
        if folder is None:
            self._keep = tempfile.TemporaryDirectory(prefix="radiance-")
            folder = Path(self._keep.name)
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        (folder / "sky.cal").write_text(SKY_CAL, encoding="ascii")

    @property
    def version(self) -> str:
        """What ``rtrace -version`` says."""
        out, _ = self._run(["rtrace", "-version"], b"")
        return out.decode().strip()

    def octree(self, name: str, *texts: str) -> str:
        """Compile a scene; returns the name of the octree."""
        (self.folder / f"{name}.rad").write_text("\n".join(texts), encoding="ascii")
        out, _ = self._run(["oconv", "-w", f"{name}.rad"], b"")
        (self.folder / f"{name}.oct").write_bytes(out)
        return f"{name}.oct"

    def trace(
        self,
        octree: str,
        points: FloatArray,
        normals: FloatArray,
        options: Sequence[str],
        *,
        repeats: int = 1,
        timeout_s: float = 1800.0,
    ) -> Traced:
        """Irradiance at points (n, 3) [m] with unit normals (n, 3), each ``repeats`` times.

        Repeats are independent: one process draws all its random numbers from one stream.
        ``rtrace -I`` evaluates 1e-4 m in front of the points.
        """
        rows = np.tile(np.concatenate([points, normals], axis=1), (repeats, 1))
        text = "\n".join(" ".join(f"{x:.9g}" for x in row) for row in rows) + "\n"
        command = ["rtrace", "-I+", "-h", "-w", "-fad", *options, octree]
        out, cpu = self._run(command, text.encode(), timeout_s)
        values = np.frombuffer(out, dtype=np.float64)
        if values.size != 3 * len(rows):
            raise PatchlightError(f"rtrace {octree}: {values.size} values for {len(rows)} sensors")
        return Traced(values.reshape(repeats, len(points), 3), cpu)

    def _run(
        self, command: list[str], given: bytes, timeout_s: float = 600.0
    ) -> tuple[bytes, float]:
        """Output and CPU seconds (user and system) of one program."""
        environment = {**os.environ, "RAYPATH": f".{os.pathsep}{self._home / 'lib'}"}
        with tempfile.TemporaryFile() as source, tempfile.TemporaryFile() as errors:
            source.write(given)
            source.seek(0)
            process = subprocess.Popen(
                [str(self._home / "bin" / command[0]), *command[1:]],
                stdin=source,
                stdout=subprocess.PIPE,
                stderr=errors,
                cwd=self.folder,
                env=environment,
            )
            timer = threading.Timer(timeout_s, process.kill)
            timer.start()
            try:
                assert process.stdout is not None
                out = process.stdout.read()
                _, status, usage = os.wait4(process.pid, 0)
            finally:
                timer.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            errors.seek(0)
            said = errors.read().decode(errors="replace").strip()
        if process.returncode != 0:
            raise PatchlightError(
                f"{' '.join(command[:1])} ended with status {process.returncode}: {said[-500:]}"
            )
        return out, usage.ru_utime + usage.ru_stime
