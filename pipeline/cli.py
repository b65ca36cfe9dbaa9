"""Command line: one thin function a command, no physics.

Results go to stdout, talk to stderr. Exit codes: 0 done; 1 a requirement failed (with --check);
2 usage, input or output error; 3 accuracy not reached; 4 batch with failures; 130 interrupted.
A failed requirement counts before an accuracy that was not reached.
"""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter
from patchlight.solver.errors import PatchlightError

from .cli_sky import sky
from .doctoring import version

OK, REQUIREMENT_FAILED, BAD_INPUT, NOT_CONVERGED, BATCH_FAILED, INTERRUPTED = 0, 1, 2, 3, 4, 130

app = App(
    name="patchlight",
    help="Lighting simulation on exact CAD surfaces: STEP in, photometric report out.",
    version=lambda: version("patchlight"),
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)

Output = Annotated[Path | None, Parameter(name=["--output", "-o"])]
Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative=())]
Flag = Annotated[bool, Parameter(negative=())]
Axis = Literal["z", "y", "x"]


@app.command
def run(
    file: Path,
    /,
    *,
    output: Output = None,
    accuracy: float | None = None,
    threads: int | None = None,
    scale: float | None = None,
    unit: str | None = None,
    up: Axis | None = None,
    tolerance: float | None = None,
    scene: Path | None = None,
    method: Literal["default", "nn93"] | None = None,
    timeout: float | None = None,
    memory: float | None = None,
    pdf: Flag = False,
    force: Flag = False,
    check: Flag = False,
    no_cache: Flag = False,
    json_: Annotated[bool, Parameter(name="--json", negative=())] = False,
    verbose: Verbose = False,
) -> int:
    """Simulate SCENE.toml, or MODEL.step with stated defaults, and write a report.

    Parameters
    ----------
    file
        Scene file, or STEP file.
    output
        Folder to write; NAME-patchlight when not given.
    accuracy
        Relative error of sensor illuminance aimed at.
    threads
        Threads of the solver; all cores when not given.
    scale
        Factor on the lengths of a STEP file.
    unit
        Length unit of a STEP file, instead of the one it states.
    up
        Axis of a STEP file that points up.
    tolerance
        Largest deviation of converted faces, relative to the size of their part.
    scene
        Scene file whose first model the STEP file replaces.
    method
        nn93: as Nishita and Nakamae published it in 1993, for comparison.
    timeout
        Longest time for reading and converting each model, 300 when not given. [s]
    memory
        Most memory that may take; what is free when not given. [GB]
    pdf
        Write report.pdf too.
    force
        Write into a folder that holds something else.
    check
        Exit with 1 when a requirement of the scene fails.
    no_cache
        Convert models anew, and keep nothing of them.
    json_
        Print results as JSON.
    verbose
        Say what is being done.
    """
    from .runs import RunOptions, run_file
    from .talk import Talk

    options = RunOptions(
        output, accuracy, threads, scale, unit, up, tolerance, scene, pdf, force,
        method=method, cache=not no_cache, timeout_s=timeout, memory_gb=memory,
    )  # fmt: skip
    with Talk(verbose=verbose) as talk:
        _check_pdf(pdf)
        done = run_file(file, options, talk)
    return _report(done, as_json=json_, check=check)


@app.command
def year(
    file: Path,
    /,
    *,
    weather: Path,
    output: Output = None,
    accuracy: float | None = None,
    threads: int | None = None,
    sensors: tuple[str, ...] = (),
    schedule: str = "08:00-18:00",
    step_minutes: int | None = None,
    electric: tuple[str, ...] = (),
    sun_day: str = "03-21",
    sun_above: float = 0.0,
    memory: float | None = None,
    force: Flag = False,
    no_cache: Flag = False,
    json_: Annotated[bool, Parameter(name="--json", negative=())] = False,
    verbose: Verbose = False,
) -> int:
    """Simulate the daylight of a year at the sensors of SCENE.toml.

    Parameters
    ----------
    file
        Scene file.
    weather
        Weather file of EnergyPlus (.epw).
    output
        Folder to write; NAME-patchlight-year when not given. A run that was cut goes on in it.
    accuracy
        Relative error aimed at, that of the scene file when not given.
    threads
        Threads of the solver; all cores when not given.
    sensors
        Names of grids; all when not given.
    schedule
        When the building is used, by the clocks of the scene's time zone.
    step_minutes
        Shorter steps than those of the weather file, which they must part evenly.
    electric
        Light groups of lamps that burn, and when: ceiling=08:00-18:00, or ceiling=always.
    sun_day
        Month and day of which hours of sun are told, without clouds.
    sun_above
        Altitude from which on the sun counts on that day. [deg]
    memory
        Most memory that this process may take while it simulates; what is free when not given. How
        much reading a model may take stands in the scene file. [GB]
    force
        Write into a folder that holds something else.
    no_cache
        Convert models anew, and keep nothing of them.
    json_
        Print metrics as JSON.
    verbose
        Say what is being done.
    """
    from .talk import Talk
    from .year_runs import YearOptions, run_year, year_text

    options = YearOptions(
        weather, output, accuracy, threads, sensors, schedule, step_minutes, electric, sun_day,
        sun_above, memory, force, cache=not no_cache,
    )  # fmt: skip
    with Talk(verbose=verbose) as talk:
        done = run_year(file, options, talk)
    print(json.dumps(done.rows, indent=2) if json_ else year_text(done))
    return OK if done.converged else NOT_CONVERGED


@app.command
def inspect(
    file: Path,
    /,
    *,
    scale: float = 1.0,
    unit: str | None = None,
    tolerance: float = 1e-4,
    timeout: float = 300.0,
    memory: float | None = None,
    no_cache: Flag = False,
    json_: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Show what is in a STEP file and how exactly its faces can be represented.

    Parameters
    ----------
    file
        STEP file.
    scale
        Factor on all lengths.
    unit
        Length unit, instead of the one the file states.
    tolerance
        Largest deviation of converted faces, relative to the size of their part.
    timeout
        Longest time for reading and converting. [s]
    memory
        Most memory that may take; what is free when not given. [GB]
    no_cache
        Convert anew, and keep nothing of it.
    json_
        Print everything as JSON.
    """
    from patchlight.importers import read_step

    model = read_step(
        file, scale=scale, unit=unit, tolerance=tolerance, timeout_s=timeout, memory_gb=memory,
        cache=not no_cache,
    )  # fmt: skip
    if json_:
        from patchlight.importers import inspection

        print(json.dumps(inspection(model), indent=2))
        return OK
    from .inspecting import inspection_text

    for warning in model.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    print(inspection_text(model))
    return OK


@app.command
def batch(
    *files: Path,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    jobs: int | None = None,
    scene: Path | None = None,
    timeout: float = 3600.0,
    accuracy: float | None = None,
    force: Flag = False,
    check: Flag = False,
    no_cache: Flag = False,
    verbose: Verbose = False,
) -> int:
    """Simulate many files, each in a process of its own; no failure stops the others.

    Parameters
    ----------
    files
        STEP files, scene files, or folders of STEP files.
    output
        Folder for one subfolder a file, summary.csv and summary.html.
    jobs
        Files at a time; the number of cores when not given.
    scene
        Scene file whose first model every STEP file replaces in turn.
    timeout
        Longest time for one file. [s]
    accuracy
        Relative error of sensor illuminance aimed at.
    force
        Compute files again that were finished before.
    check
        Count a failed requirement as a failure.
    no_cache
        Convert models anew, and keep nothing of them.
    verbose
        Say what is being done.
    """
    from .batches import run_batch

    done = run_batch(
        files,
        output,
        jobs=jobs,
        scene=scene,
        timeout_s=timeout,
        accuracy=accuracy,
        force=force,
        check=check,
        cache=not no_cache,
        say=lambda text: print(text, file=sys.stderr, flush=True),
    )
    items, failed = done.items, [item for item in done.items if not item.ok]
    if not done.summary_problem:
        print(output / "summary.html")
    print(f"{len(items) - len(failed)} of {len(items)} files done")
    for item in failed:
        print(f"{item.status}: {item.path}: {item.message}")
    if done.summary_problem:
        print(f"patchlight: {done.summary_problem}", file=sys.stderr)
    return BATCH_FAILED if failed or done.summary_problem else OK


@app.command
def demo(
    name: str = "office",
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("patchlight-demo"),
    accuracy: float | None = None,
    threads: int | None = None,
    pdf: Flag = False,
    force: Flag = False,
    verbose: Verbose = False,
) -> int:
    """Write a demo model and its scene file, and run them.

    Parameters
    ----------
    name
        office or conference.
    output
        Folder for the model, the scene file and the report.
    accuracy
        Relative error of sensor illuminance aimed at.
    threads
        Threads of the solver; all cores when not given.
    pdf
        Write report.pdf too.
    force
        Write into a folder that holds something else.
    verbose
        Say what is being done.
    """
    from patchlight.solver.compile_ahead import compile_ahead

    from .demo import demo_files, write_demo
    from .output import prepare_output
    from .runs import RunOptions, run_file
    from .talk import Talk

    with Talk(verbose=verbose) as talk:
        _check_pdf(pdf)
        own = demo_files(name)
        models = [output / file for file in own if not file.endswith(".toml")]
        prepare_output(output, models, force=force, own=own)
        compile_ahead()
        talk.progress("building the demo model", 0, 1)
        scene = write_demo(name, output)
        options = RunOptions(output, accuracy, threads, pdf=pdf, force=force, own_files=own)
        done = run_file(scene, options, talk)
    return _report(done)


app.command(sky)


@app.command
def schema() -> int:
    """Print the JSON schema of scene files, for editors."""
    from .scene_schema import SceneFile

    print(json.dumps(SceneFile.model_json_schema(), indent=2))
    return OK


@app.command
def doctor() -> int:
    """Tell what this machine can do: threads, pictures, PDF, versions, compiled kernels."""
    from .doctoring import doctor_lines

    for line in doctor_lines():
        print(line)
    return OK


def _check_pdf(wanted: bool) -> None:
    """Say before the long computation that there will be no PDF."""
    if not wanted:
        return
    from patchlight.reports import pdf_status
    from patchlight.solver.errors import MissingLibraryError

    can, why = pdf_status()
    if not can:
        raise MissingLibraryError(f"--pdf: {why}")


def _report(done, *, as_json: bool = False, check: bool = False) -> int:  # type: ignore[no-untyped-def]
    """Print the results of a run; return the exit code."""
    from .printing import result_json, result_text

    print(result_json(done) if as_json else result_text(done))
    if check:
        from patchlight.reports import evaluate_requirements

        # A requirement fails only when it does so over the whole range of the error, so that a
        # better accuracy would not save it: that says more than the accuracy that was missed.
        if any(r.verdict == "fail" for r in evaluate_requirements(done.result)):
            return REQUIREMENT_FAILED
    return OK if done.result.converged else NOT_CONVERGED


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    tokens = list(sys.argv[1:] if argv is None else argv)
    verbose = "-v" in tokens or "--verbose" in tokens
    level = logging.INFO if verbose else logging.WARNING
    logging.basicConfig(stream=sys.stderr, level=level, format="%(levelname)s %(message)s")
    try:
        code = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except PatchlightError as error:  # one line for the user; any other exception is a bug
        print(f"patchlight: {error}", file=sys.stderr)
        return BAD_INPUT
    except CycloptsError as error:
        print(f"patchlight: {' '.join(str(error).split())}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError as error:  # what was not foreseen: big files, many jobs
        print(f"patchlight: out of memory: {error or 'ended'}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("patchlight: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of stdout left, as `| head` does
        sys.stderr.close()
        return OK
    return int(code or 0)


if __name__ == "__main__":
    sys.exit(main())
