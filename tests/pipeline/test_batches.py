"""Batches: whatever fails, every file ends with a report or a line, and the summary holds all."""

from __future__ import annotations

import csv
import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from patchlight.pipeline import batches, workers
from patchlight.pipeline.batch_items import BatchItem
from patchlight.pipeline.cli import main
from patchlight.solver.errors import OutputError, PatchlightWarning

REAL = subprocess.Popen
NAMES = ("a", "b", "c")
#: What a run that went well prints; no part of the solver is needed for the tests here.
GOOD = json.dumps(
    {
        "faces": 6,
        "patches": 6,
        "metrics": [
            {"sensor_id": "plane", "id": "E_avg_lx", "value": 500.0, "uncertainty": 2.5},
            {"sensor_id": "plane", "id": "P_W", "value": 40.0, "uncertainty": None},
        ],
        "accuracy_reached": 0.005,
        "warnings": ["kernels are slow"],
    }
)


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Three STEP files in the current folder, which their fake workers never open."""
    monkeypatch.chdir(tmp_path)
    for name in NAMES:
        (tmp_path / f"{name}.step").write_text("ISO-10303-21;")
    return [f"{name}.step" for name in NAMES]


@pytest.fixture
def pretend(monkeypatch):
    """Let other Python code stand for the worker of each file, by its name."""

    def install(**codes):
        def popen(command, **options):
            name = next(part for part in command if part.endswith(".step"))[:-5]
            code = codes.get(name, f"print({GOOD!r})")
            if isinstance(code, Exception):
                raise code
            return REAL([sys.executable, "-c", code], **options)

        monkeypatch.setattr(workers.subprocess, "Popen", popen)

    return install


def rows_of(folder):
    with open(folder / "summary.csv", newline="") as stream:
        return list(csv.DictReader(stream))


def test_bad_files_are_all_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    bad = {"empty.step": "", "text.stp": "hello\n"}
    for name, text in bad.items():
        (tmp_path / name).write_text(text)
    code = main(["batch", str(tmp_path), "-o", "out", "--jobs", "2"])
    captured = capsys.readouterr()
    assert code == 4
    for name in bad:
        assert f"{name}: " in captured.out
    assert "0 of 2 files done" in captured.out
    assert [row["status"] for row in rows_of(tmp_path / "out")] == ["failed"] * 2
    assert (tmp_path / "out" / "summary.html").is_file()


def test_errors_and_warnings_of_each_file_are_in_the_summary(files, pretend):
    """Also when it is taken over from an earlier batch."""
    pretend()
    (item, *_) = batches.batch(files, "out", jobs=2)
    assert item.errors == {"plane": {"E_avg_lx": 2.5}}
    for _ in range(2):
        row = rows_of(Path("out"))[0]
        assert (row["plane.E_avg_lx"], row["plane.E_avg_lx_error"]) == ("500.0", "2.5")
        assert (row["plane.P_W"], row["plane.P_W_error"]) == ("40.0", "")
        assert (row["accuracy_reached"], row["warnings"]) == ("0.005", "kernels are slow")
        batches.batch(files, "out", jobs=2)


def test_a_file_that_takes_too_long_is_ended(files, pretend):
    pretend(a="import time; time.sleep(60)", b="import sys; sys.exit(2)")
    items = batches.batch(files, "out", jobs=2, timeout_s=1.0)
    assert [item.status for item in items] == ["timed out", "failed", "ok"]
    assert items[0].seconds < 20.0 and "1 s" in items[0].message


@pytest.mark.parametrize(
    ("number", "name"),
    [(signal.SIGSEGV, "SIGSEGV"), (signal.SIGRTMIN + 3, f"signal {signal.SIGRTMIN + 3}")],
)
def test_how_a_worker_died_is_said(files, pretend, number, name):
    pretend(a=f"import os; os.kill(os.getpid(), {int(number)})")
    items = batches.batch(files, "out")
    assert items[0].exit_code == -number and items[0].message.endswith(name)
    assert [item.status for item in items] == ["failed", "ok", "ok"]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EAGAIN, "Resource temporarily unavailable"), "temporarily unavailable"),
        (PermissionError(errno.EACCES, "Permission denied", "python"), "python: Permission denied"),
        (MemoryError(), "MemoryError"),
    ],
)
def test_a_worker_that_cannot_be_started_fails_its_file_only(files, pretend, error, words):
    pretend(b=error)
    items = batches.batch(files, "out")
    assert [item.status for item in items] == ["ok", "failed", "ok"]
    assert words in items[1].message and "\n" not in items[1].message


def test_a_record_that_cannot_be_kept_costs_no_result(files, pretend, tmp_path):
    pretend()
    out = tmp_path / "out"
    out.mkdir()
    for name in NAMES:  # the records cannot be written over folders of their names
        (out / name / "batch-item.json" / "x").mkdir(parents=True)
    items = batches.batch(files, out)
    assert all(item.ok and item.metrics["plane"]["E_avg_lx"] == 500.0 for item in items)


@pytest.fixture
def full_disk(monkeypatch):
    """Let the summary fail as often as asked."""

    def install(times):
        import patchlight.reports as reports

        real, left = reports.write_batch_summary, [times]

        def write(rows, out):
            if left[0] > 0:
                left[0] -= 1
                raise OutputError("cannot write summary.csv: No space left on device")
            return real(rows, out)

        monkeypatch.setattr(reports, "write_batch_summary", write)

    return install


def test_a_summary_that_cannot_be_written_ends_nothing(files, pretend, full_disk, capsys):
    pretend()
    full_disk(99)
    assert main(["batch", *files, "-o", "out", "--jobs", "1"]) == 4
    captured = capsys.readouterr()
    assert "3 of 3 files done" in captured.out and "summary.html" not in captured.out
    said = captured.err.strip().splitlines()
    assert said[-1].startswith("patchlight: the summary") and "No space left" in said[-1]
    assert captured.err.count("No space left") == 1
    with pytest.warns(PatchlightWarning, match="No space left"):
        assert all(item.ok for item in batches.batch(files, "other"))


def test_a_summary_that_is_whole_in_the_end_is_good(files, pretend, full_disk, capsys):
    pretend()
    full_disk(2)
    assert main(["batch", *files, "-o", "out", "--jobs", "1"]) == 0
    assert "space" not in capsys.readouterr().err


def test_an_interrupt_leaves_a_summary_of_all_files(files, pretend, tmp_path, capsys, monkeypatch):
    """The first file is done when Ctrl-C comes, the second is running, the third waits."""
    started = tmp_path / "started"
    pretend(b=f"open({str(started)!r}, 'w').close(); import time; time.sleep(60)")

    real = batches.as_completed

    def as_completed(futures):
        yield next(real(futures))
        while not started.exists():
            time.sleep(0.01)
        raise KeyboardInterrupt

    monkeypatch.setattr(batches, "as_completed", as_completed)
    assert main(["batch", *files, "-o", "out", "--jobs", "1"]) == 130
    rows = rows_of(tmp_path / "out")
    assert [row["status"] for row in rows] == ["ok", "interrupted", "interrupted"]
    assert rows[0]["plane.E_avg_lx"] == "500.0"
    assert "interrupted" in (tmp_path / "out" / "summary.html").read_text()
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_workers_too(tmp_path, number):
    """Signals of a terminal or a scheduler reach the batch only; it must take its workers along."""
    for name in NAMES:
        (tmp_path / f"{name}.step").write_text("ISO-10303-21;")
    sleep = "import os, time; open('pid', 'w').write(str(os.getpid())); time.sleep(60)"
    code = f"""
import signal, subprocess, sys
from patchlight.pipeline import workers
from patchlight.pipeline.cli import main
# Jobs in the background of a script begin with it ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
real = subprocess.Popen
def slow(command, **options):
    return real([sys.executable, "-c", {sleep!r}], **options)
workers.subprocess.Popen = slow
sys.exit(main(["batch", "a.step", "b.step", "c.step", "-o", "out", "--jobs", "1"]))
"""
    batch = REAL([sys.executable, "-c", code], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    pid = tmp_path / "pid"
    try:
        while not (pid.exists() and pid.read_text()):
            assert batch.poll() is None
            time.sleep(0.01)
        batch.send_signal(number)
        _, err = batch.communicate(timeout=30)
    finally:
        batch.kill()
    assert batch.returncode == 130 and err.strip().endswith("interrupted")
    assert [row["status"] for row in rows_of(tmp_path / "out")] == ["interrupted"] * 3
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


def test_reports_of_earlier_runs_are_not_linked(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "report.html").write_text("of last week")
    item = BatchItem("a", "a.step", str(tmp_path / "a"))
    for status, linked in (("ok", True), ("not converged", True), ("interrupted", False)):
        item.status = status
        assert (item.report == "a/report.html") == linked
