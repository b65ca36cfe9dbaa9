"""Kernels compiled by several processes: each once, and whatever happens to one of them."""

from __future__ import annotations

import inspect
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from patchlight.solver import compile_ahead as ahead
from patchlight.solver.cores import usable_cores
from patchlight.solver.errors import InputError
from patchlight.solver.kernels import compiled

SOLVER = Path(ahead.__file__).parent
#: What the solver's package is cut down to, so that there is little to compile.
KERNELS = """
import os, pathlib, sys, time
from .compiled import kernel
from .shared_cache import SharedCache

@kernel
def root(x):
    return x ** 0.5

@kernel
def double(x):
    return x + x

place = pathlib.Path(os.environ["NUMBA_CACHE_DIR"])
is_helper = sys.argv[0].endswith("__main__.py")
inner = SharedCache.save_overload

def save(self, sig, data):
    with open(place.parent / "saved", "a") as file:
        file.write(f"{self._impl.filename_base.split('-')[0]}\\n")
    if is_helper and "HANG" in os.environ:
        (place.parent / "hangs").touch()
        time.sleep(600)
    inner(self, sig, data)

SharedCache.save_overload = save

if "SLOW" in os.environ:
    from numba.core.caching import IndexDataCacheFile
    save_index = IndexDataCacheFile._save_index

    def save_slowly(self, overloads):
        time.sleep(float(os.environ["SLOW"]))
        save_index(self, overloads)

    IndexDataCacheFile._save_index = save_slowly
"""
LIST = "small.root (float64,)\nsmall.double (float64,)\n"
START = """
import os, signal, subprocess, sys, time
from pathlib import Path
from patchlight.solver import compile_ahead
# Ignored where the tests themselves run in the background of a shell.
signal.signal(signal.SIGINT, signal.default_int_handler)
started, popen = [], subprocess.Popen
compile_ahead.subprocess.Popen = lambda *a, **k: started.append(popen(*a, **k)) or started[-1]
folder, warm = compile_ahead.compile_ahead()
print(len(started), flush=True)

def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)
"""

pytestmark = pytest.mark.skipif(compiled._SHARED_CACHE is None, reason="nothing is shared")


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """Folder with a copy of the solver that has two kernels."""
    base = tmp_path_factory.mktemp("package")
    inner = base / "patchlight" / "solver"
    inner.mkdir(parents=True)
    for path in SOLVER.glob("*.py"):
        shutil.copy(path, inner)
    (inner / "kernels").mkdir()
    for name in (
        "__init__",
        "__main__",
        "ahead",
        "compiled",
        "known_calls",
        "parts",
        "shared_cache",
    ):
        shutil.copy(SOLVER / "kernels" / f"{name}.py", inner / "kernels")
    (inner / "kernels" / "small.py").write_text(KERNELS)
    (inner / "kernels" / "ahead.txt").write_text(LIST)
    return base


@pytest.fixture
def start(package, tmp_path):
    """Starts a script after `START` in a process of its own, with an empty cache."""
    running = []

    def start(script: str, processes: str | None = "1", **environment: str) -> subprocess.Popen:
        path = f"{package}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
        env = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        env.pop(ahead.VARIABLE)
        if processes is not None:
            env[ahead.VARIABLE] = processes
        process = subprocess.Popen(
            [sys.executable, "-c", START + script],
            env=env | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # what is left of it can be found, and ended
        )
        running.append(process)
        return process

    yield start
    for process in running:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def said(process: subprocess.Popen) -> list[str]:
    """Lines that a process prints to its end."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.splitlines()


CALL = """
from patchlight.solver.kernels import small
print(small.root(9.0), small.double(4.0))
from patchlight.solver.kernels import compiled
assert compiled._PARTS is not None, "kernels are not compiled as parts of others"
for kernel in (small.root, small.double):
    print(sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))
"""


def test_another_process_compiles_what_is_listed(start, tmp_path):
    done = "wait_for(compile_ahead.done_mark(folder).exists)\n"
    ended = "wait_for(lambda: not Path(f'/proc/{started[0].pid}').exists())\n"  # nor as a zombie
    lines = said(start(done + ended + CALL))
    assert lines == ["1", "3.0 8.0", "1 0", "1 0"]
    assert said(start("print(warm)")) == ["0", "True"]  # all is there
    assert sorted((tmp_path / "saved").read_text().split()) == ["small.double", "small.root"]
    assert not list(tmp_path.rglob("*.tmp.*"))


KILL = """
import threading

def kill():
    wait_for(lambda: "double" in (folder.parent / "saved").read_text())
    started[0].kill()

threading.Thread(target=kill).start()
"""


def test_nothing_is_said_to_be_done_that_has_failed(start, package, tmp_path):
    """A kernel that is listed and does not fit is tried again by the next version."""
    copy = shutil.copytree(package, tmp_path / "broken")
    (copy / "patchlight" / "solver" / "kernels" / "ahead.txt").write_text(
        LIST + "small.root (unicode_type,)\n"
    )
    done = "started[0].wait()\nprint(compile_ahead.done_mark(folder).exists())\n"
    assert said(start(done + CALL, PYTHONPATH=str(copy))) == ["1", "False", "3.0 8.0", "1 0", "1 0"]


@pytest.mark.parametrize("end", ["killed", "too long"])
def test_process_that_hangs_is_waited_for_in_vain(end, start, tmp_path):
    """The other kernel is compiled meanwhile, and then that which the other process held."""
    script = "wait_for((folder.parent / 'hangs').exists)\n"
    if end == "killed":
        script += KILL
    else:
        script += "from patchlight.solver.kernels import shared_cache as s; s.LONGEST_S = 1.0\n"
    assert said(start(script + CALL, HANG="1")) == ["1", "3.0 8.0", "0 1", "0 1"]
    assert (tmp_path / "saved").read_text().split() == ["small.root", "small.double", "small.root"]


@pytest.mark.parametrize("ending", [None, signal.SIGINT, signal.SIGKILL], ids=str)
def test_no_process_is_left_behind(ending, start):
    script = "wait_for((folder.parent / 'hangs').exists)\nprint(started[0].pid, flush=True)\n"
    process = start(script + ("time.sleep(60)" if ending else ""), HANG="1")
    assert process.stdout.readline() == "1\n"
    other = int(process.stdout.readline())
    if ending:
        os.kill(process.pid, ending)
    process.wait(20)
    end = time.monotonic() + 20.0
    while is_running(other) and time.monotonic() < end:
        time.sleep(0.05)
    assert not is_running(other)


def is_running(number: int) -> bool:
    """Whether there is a process of this number that has not ended."""
    try:
        state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_processes_that_start_at_once_compile_nothing_twice(start, tmp_path):
    runs = [start(CALL) for _ in range(2)]
    assert [said(run)[:2] for run in runs] == [["1", "3.0 8.0"]] * 2
    assert sorted((tmp_path / "saved").read_text().split()) == ["small.double", "small.root"]


def test_no_signature_is_lost_where_two_are_saved_at_once(start):
    """Numba reads what is there, adds to it and writes it; without a lock, both add the first."""
    script = "from patchlight.solver.kernels import small\nprint(small.root({}))\n"
    runs = [start(script.format(x), "0", SLOW="2") for x in ("9.0", "9")]
    assert [said(run)[1] for run in runs] == ["3.0"] * 2
    hits = "print(sum(small.root.stats.cache_hits.values()))"
    again = start(script.format("9.0") + "print(small.root(16))\n" + hits, "0")
    assert said(again) == ["0", "3.0", "4.0", "2"]


def test_process_that_cannot_import_is_done_without(start, package, tmp_path):
    copy = shutil.copytree(package, tmp_path / "broken")
    (copy / "patchlight" / "solver" / "kernels" / "__main__.py").write_text("import nothing_such")
    lines = said(start("started[0].wait()\n" + CALL, PYTHONPATH=str(copy)))
    assert lines == ["1", "3.0 8.0", "0 1", "0 1"]


@pytest.mark.parametrize(
    "why", ["variable", "one core", "memory", "cache", "program", "JIT", "Numba"]
)
def test_no_process_is_started_where_none_helps(why, monkeypatch, tmp_path):
    started = []
    monkeypatch.setattr(ahead, "_LOOKED_AT", {})
    monkeypatch.setattr(ahead, "_start", lambda *arguments: started.append(arguments))
    monkeypatch.setattr(ahead, "usable_cores", lambda: 8)
    monkeypatch.setattr(ahead, "available_bytes", lambda: 8_000_000_000)
    monkeypatch.setattr(ahead, "is_compiling_off", lambda: False)
    folder = tmp_path / "cache"
    monkeypatch.setattr(ahead, "use_cache_folder", lambda: (folder, False))
    monkeypatch.setenv(ahead.VARIABLE, "")
    ahead.compile_ahead()
    ahead.compile_ahead()
    assert started == [(k, folder) for k in range(ahead.MOST_PROCESSES)]

    started.clear()
    ahead._LOOKED_AT.clear()
    if why == "variable":
        monkeypatch.setenv(ahead.VARIABLE, "0")
    elif why == "one core":
        monkeypatch.setattr(ahead, "usable_cores", lambda: 1)
    elif why == "memory":
        monkeypatch.setattr(ahead, "available_bytes", lambda: 1_500_000_000)
    elif why == "cache":
        (tmp_path / "file").touch()
        folder = tmp_path / "file" / "cache"
    elif why == "program":
        monkeypatch.setattr(sys, "executable", None)
    elif why == "Numba":
        monkeypatch.setattr(ahead, "numba_version", lambda: (0, 99, 1))
    else:
        monkeypatch.setattr(ahead, "is_compiling_off", lambda: True)
    assert ahead.compile_ahead() == (folder, False)
    assert not started


@pytest.mark.parametrize("value", ["two", "-1", "1.5", "65", "1000000"])
def test_number_of_processes_must_be_one(value, monkeypatch):
    monkeypatch.setenv(ahead.VARIABLE, value)
    with pytest.raises(InputError, match=rf"{ahead.VARIABLE} = '?{value}'?: .*from 0 to 64"):
        ahead.compile_ahead()


@pytest.mark.parametrize(
    "files, cores",
    [
        ({}, 64),
        ({"proc/self/cgroup": "0::/a/b\n", "sys/fs/cgroup/a/cpu.max": "250000 100000\n"}, 2),
        ({"proc/self/cgroup": "0::/a\n", "sys/fs/cgroup/cpu.max": "max 100000\n"}, 64),
        ({"proc/self/cgroup": "0::/\n", "sys/fs/cgroup/cpu.max": "50000 100000\n"}, 1),
        (
            {
                "proc/self/cgroup": "4:cpu,cpuacct:/docker/x\n",
                "sys/fs/cgroup/cpu/cpu.cfs_quota_us": "300000\n",
                "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000\n",
            },
            3,
        ),
    ],
    ids=["none", "2.5 cores of a group above", "no limit", "half a core", "version 1"],
)
def test_usable_cores_are_those_a_container_may_use(files, cores, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(64), raising=False)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert usable_cores(tmp_path) == cores


def test_listed_kernels_can_be_called_so():
    """Each is there, with as many parameters; the fields of tuples are as many as they have."""
    from numba.core import types
    from patchlight.solver.kernels.ahead import Listed

    lines = [line for line in ahead.LIST.read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == len(set(lines)) > 5
    for line in lines:
        kernel, signature = Listed(*line.split(" ", 1)).resolved()
        assert len(signature) == len(inspect.signature(kernel.py_func).parameters), line
        for kind in signature:
            if isinstance(kind, types.BaseNamedTuple):
                assert len(kind) == len(kind.fields), line
