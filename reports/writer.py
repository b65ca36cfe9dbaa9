"""Writes an output folder, or a report alone, from a result."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

from patchlight.solver.errors import PatchlightError, PatchlightWarning
from patchlight.solver.model import Result

from .files import make_folder, write_bytes, write_text
from .images import picture, write_images
from .pdf import write_pdf
from .report import render_report
from .run_files import run_record, write_grids, write_json, write_metrics, write_patches
from .status import pdf_status
from .still import Still, scene_still
from .viewer import viewer_fragment, viewer_page
from .vtp import write_vtp

Progress = Callable[[str, int, int], None]
Log = Callable[[str], None]


def write_run(
    result: Result,
    folder: str | Path,
    *,
    config: str | None = None,
    pdf: bool = False,
    log: Log | None = None,
    progress: Progress | None = None,
) -> dict[str, Path]:
    """Write every file of a run into ``folder``, each renamed into place when it is complete.

    Parameters
    ----------
    result : Result
        What to write.
    folder : path
        Made when missing; files of the same names are replaced.
    config : str, optional
        Resolved scene file (TOML), stored and shown.
    pdf : bool
        Also ``report.pdf``; without WeasyPrint there is a warning instead.
    log : callable, optional
        Called with one line for what could not be done.
    progress : callable, optional
        Called as ``progress(file, done, total)``.

    Returns
    -------
    dict of Path
        Written files by their name within the folder.

    Raises
    ------
    OutputError
        If the folder or a file cannot be written (permissions, full disk).
    """
    out = make_folder(folder)
    written: dict[str, Path] = {}
    problems: list[str] = []
    total = 8

    def step(name: str, done: int) -> None:
        if progress is not None:
            progress(name, done, total)

    step("run.json", 0)
    written["run.json"] = write_json(out / "run.json", run_record(result))
    if config is not None:
        written["config.resolved.toml"] = write_text(out / "config.resolved.toml", config)
    written |= write_metrics(result, out)
    step("grids", 1)
    written |= write_grids(result, out)
    step("patches.npz", 2)
    written["patches.npz"] = write_patches(result, out)
    step("images", 3)
    files, pictures = write_images(result, out)
    written |= files
    step("scene", 4)
    written["scene/scene.vtp"] = write_vtp(result, out / "scene" / "scene.vtp")
    written["scene/scene.html"] = write_text(out / "scene" / "scene.html", viewer_page(result))
    step("3-D still", 5)
    still = _still(result, problems)
    if still is not None:
        target = out / "images" / "scene_falsecolor.png"
        written["images/scene_falsecolor.png"] = write_bytes(target, still.png)
    step("report.html", 6)
    html = render_report(result, pictures=pictures, still=still, config=config, problems=problems)
    written["report.html"] = write_text(out / "report.html", html)
    if pdf:
        step("report.pdf", 7)
        written |= _pdf(html, out / "report.pdf", log)
    for line in problems:
        _say(line, log)
    step("done", total)
    return written


def write_report(
    result: Result,
    out: str | Path,
    *,
    pdf: bool = False,
    scene_3d: bool = False,
    config: str | None = None,
) -> dict[str, Path]:
    """Write ``report.html`` alone: one file with everything in it, no links to other files.

    Parameters
    ----------
    result : Result
        What to report.
    out : path
        A folder, or the name of the HTML file itself when it ends in ``.html``.
    pdf : bool
        Also the same report as PDF beside it.
    scene_3d : bool
        Put an interactive 3-D scene into the page; it grows by a few megabytes.
    config : str, optional
        Resolved scene file (TOML), shown.

    Returns
    -------
    dict of Path
        Written files by name.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    path = Path(out)
    if path.suffix.lower() not in (".html", ".htm"):
        path = make_folder(path) / "report.html"
    problems: list[str] = []
    html = render_report(
        result,
        pictures=[picture(name, image) for name, image in result.images.items()],
        still=_still(result, problems),
        viewer=viewer_fragment(result) if scene_3d else "",
        config=config,
        problems=problems,
    )
    written = {path.name: write_text(path, html)}
    if pdf:
        written |= _pdf(html, path.with_suffix(".pdf"), None)
    return written


def _still(result: Result, problems: list[str]) -> Still | None:
    """The 3-D still; a picture is never worth losing a run, so its failure is only noted."""
    try:
        return scene_still(result)
    except (PatchlightError, ArithmeticError, ValueError, MemoryError) as error:
        problems.append(f"no 3-D still: {error}")
        return None


def _pdf(html: str, path: Path, log: Log | None) -> dict[str, Path]:
    able, reason = pdf_status()
    if not able:
        _say(f"{path.name} was not written: {reason}", log)
        return {}
    return {path.name: write_pdf(html, path)}


def _say(line: str, log: Log | None) -> None:
    if log is not None:
        log(line)
    else:
        warnings.warn(line, PatchlightWarning, stacklevel=3)
