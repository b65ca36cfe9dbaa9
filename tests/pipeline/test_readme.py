"""README says what the software does."""

from __future__ import annotations

import math
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from patchlight.pipeline.cli import app, main
from patchlight.pipeline.scene_file import checked_scene_file

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.M | re.S)


def test_set_up_is_one_line_each():
    commands = blocks("sh")
    assert len(commands) == 2
    for command in commands:
        assert command.count("\n") == 1
        assert shlex.split(command)
    assert ".venv/bin/patchlight demo" in commands[0]
    assert ".venv/bin/pytest" in commands[1]


def test_scene_file_is_valid(tmp_path):
    (tmp_path / "room.step").touch()
    (text,) = blocks("toml")
    checked_scene_file(tomllib.loads(text), tmp_path / "scene.toml")


def test_commands_and_options_exist(capsys):
    rows = re.findall(r"^\| (`patchlight .*?) \| (.*?) \|$", README, flags=re.M)
    named = {name for first, _ in rows for name in re.findall(r"`patchlight ([a-z]+)", first)}
    assert named == {name for name in app if not name.startswith("-")}
    for first, says in rows:
        command = first.split()[1].strip("`,")
        main([command, "--help"])
        text = capsys.readouterr().out
        for option in re.findall(r"`(--?[a-z]+)`", says) + re.findall(r" (--?[a-z]+) ", first):
            assert re.search(rf"(?<!\S){option}\b", text), f"{command} has no {option}"


def test_files_exist():
    paths = re.findall(r"\]\((?!https?:)([^)#]+)\)", README)
    paths += re.findall(r"<img [^>]*src=\"([^\"]+)\"", README)
    assert paths
    for path in paths:
        assert (ROOT / path).exists(), path


@pytest.mark.slow
def test_script_runs(tmp_path):
    script, _ = blocks("python")
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    average, unit, _, error = done.stdout.split()
    assert unit == "lx"
    assert 0.0 < float(error) < 0.05 * float(average)
    assert (tmp_path / "report" / "report.html").stat().st_size > 10_000


@pytest.mark.slow
def test_form_factor_script(capsys):
    """The second script: a bracket about the closed form of a ball before a lamp."""
    _, script = blocks("python")
    names: dict = {}
    exec(script, names)
    found = names["found"]
    square = 4 * 0.5 / math.hypot(1, 0.5) * math.atan(0.5 / math.hypot(1, 0.5)) / math.pi
    assert found.low.sum() <= square - (0.3 / 1.2) ** 2 <= found.high.sum()
    assert found.high.sum() - found.low.sum() < 1e-4 and found.proved
    assert "[[" in capsys.readouterr().out
