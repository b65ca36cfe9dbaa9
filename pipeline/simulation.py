"""One call from a scene to a result."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from patchlight.solver.compile_ahead import compile_ahead
from patchlight.solver.effort import check_effort
from patchlight.solver.model import Result, SceneData

from .scene import Scene

Progress = Callable[[str, int, int], None]
#: What is said where kernels are not compiled yet.
COMPILING = "the kernels are compiled on the way, once"
#: Folders of compiled kernels that were full, or that this process was told are not.
_SAID: set[Path] = set()


def simulate(
    scene: Scene | SceneData,
    *,
    accuracy: float | None = None,
    visibility: str = "auto",
    method: str | None = None,
    basis: str | None = None,
    balanced_mesh: bool | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
    cache: bool = True,
) -> Result:
    """Light in ``scene``: illuminance at its sensors and surfaces, pictures of its cameras.

    Parameters
    ----------
    scene : Scene or SceneData
        A `Scene` is frozen first.
    accuracy : float, optional
        Relative error of sensor illuminance aimed at, each value taken as at least 1 % of its
        grid's mean; every tolerance follows from it. 0.01, or what the scene file says.
    visibility : str
        How hiding is computed; see `patchlight.solver.simulation.solve`.
    method : {"default", "nn93"}, optional
        ``"nn93"`` is the method of Nishita and Nakamae 1993 as published, for comparison. What the
        scene file says, else the default.
    basis : {"bilinear", "biquadratic", "constant"}, optional
        How reflected light varies over elements. ``"biquadratic"`` takes two to three times as long
        on the same mesh, and is worth it where sensors lie close to edges or an error below 2e-4
        is wanted. What the scene file says, else bilinearly.
    balanced_mesh : bool, optional
        Whether elements are cut until no edge of one has more than two neighbours, for those who
        use the mesh on; no value gets better by it. What the scene file says, else not.
    progress : callable, optional
        Called as ``progress(stage, done, total)``.
    threads : int, optional
        Threads of the solver; all cores when not given.
    cache : bool
        Whether to take what earlier runs of this process found and is still true: with the same
        surfaces, form factors are. `patchlight.pipeline.forget` frees it. Balanced and large
        meshes and the method of 1993 keep nothing.

    Returns
    -------
    Result
        Sensors, surfaces, images, flux ledger and error estimates.

    Raises
    ------
    InputError
        For options out of range, and for all that `Scene.freeze` finds.
    """
    if accuracy is None:
        accuracy = scene.accuracy if isinstance(scene, Scene) else 0.01
    if method is None:
        method = scene.method if isinstance(scene, Scene) else "default"
    if basis is None and isinstance(scene, Scene) and method == "default":
        basis = scene.basis
    if balanced_mesh is None:
        balanced_mesh = scene.balanced_mesh if isinstance(scene, Scene) else False
    check_effort(accuracy, threads)
    announce_kernels(progress)
    data = scene.freeze() if isinstance(scene, Scene) else scene
    from patchlight.solver.simulation import solve

    started = _now()
    result = solve(
        data,
        accuracy=accuracy,
        visibility=visibility,
        method=method,
        basis=basis,
        balanced_mesh=balanced_mesh,
        progress=progress,
        threads=threads,
        cache=cache,
    )
    times = {"started": started, "ended": _now()}
    result = dataclasses.replace(
        result,
        settings={**result.settings, **times},
        warnings=(*data.warnings, *result.warnings),
    )
    return with_requirements(result, scene) if isinstance(scene, Scene) else result


def forget() -> None:
    """Free all that earlier runs of this process have kept for later ones."""
    from patchlight.solver.store import forget as forget_runs

    forget_runs()


def with_requirements(result: Result, scene: Scene) -> Result:
    """The result with the requirements of ``scene`` among its settings, for the report."""
    if not scene.requirements:
        return result
    asked = [
        {key: value for key, value in dataclasses.asdict(r).items() if value is not None}
        for r in scene.requirements
    ]
    return dataclasses.replace(result, settings={**result.settings, "requirements": asked})


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def announce_kernels(progress: Progress | None) -> None:
    """Choose the folder of compiled kernels; see that they are compiled, and say so, once.

    To ``progress``, else on stderr: a script would seem to hang.
    """
    if not compiling_is_news():
        return
    if progress is not None:
        progress("compiling kernels (once)", 0, 1)
    else:
        print(f"patchlight: {COMPILING}", file=sys.stderr)


def compiling_is_news() -> bool:
    """Whether kernels are compiled from here on; True only the first time, for who will tell it."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given and Path(given) in _SAID:
        return False  # to look into it takes longer than small scenes should
    folder, warm = compile_ahead()
    news = not warm and folder not in _SAID
    _SAID.add(folder)
    return news
