"""Memory is looked at before it is asked for."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from patchlight.solver import memory
from patchlight.solver.closure import close_rows
from patchlight.solver.errors import OutOfMemoryError, PatchlightError
from patchlight.solver.exchange import Rows, form_factor_matrix
from patchlight.solver.memory import available_bytes, check_matrix, check_memory, fits, needed_bytes
from patchlight.solver.model import PatchSet
from patchlight.solver.simulation import solve

from .fixtures_light import Body, scene, setup

MB = 10**6


@pytest.fixture
def free(monkeypatch):
    """Let the machine have so many bytes free."""
    return lambda size: monkeypatch.setattr(memory, "available_bytes", lambda: size)


def write(root, files):
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


MACHINE = {"proc/meminfo": "MemTotal: 9000 kB\nMemFree: 1000 kB\nMemAvailable:    4000 kB\n"}


def test_this_machine_has_some_memory():
    found = available_bytes()
    assert found is None or 1 * MB < found < 1e15


def test_without_groups_the_machine_counts(tmp_path):
    assert available_bytes(write(tmp_path, MACHINE)) == 4000 * 1024


@pytest.mark.parametrize(
    ("limit", "expected"),
    [("3000000", 3_000_000 - 2_500_000 + 700_000), ("max", 4000 * 1024), ("2000000", 200_000)],
)
def test_group_of_version_2(tmp_path, limit, expected):
    """Cached files do not count as used."""
    group = "sys/fs/cgroup/user.slice/job"
    files = {
        "proc/self/cgroup": "0::/user.slice/job\n",
        f"{group}/memory.max": f"{limit}\n",
        f"{group}/memory.current": "2500000\n",
        f"{group}/memory.stat": "anon 1800000\nfile 700000\ninactive_file 700000\n",
    }
    assert available_bytes(write(tmp_path, MACHINE | files)) == expected


def test_groups_above_limit_those_below(tmp_path):
    files = {
        "proc/self/cgroup": "0::/a/b\n",
        "sys/fs/cgroup/a/b/memory.max": "max\n",
        "sys/fs/cgroup/a/b/memory.current": "1\n",
        "sys/fs/cgroup/a/memory.max": "5000\n",
        "sys/fs/cgroup/a/memory.current": "2000\n",
    }
    assert available_bytes(write(tmp_path, MACHINE | files)) == 3000


def test_group_of_version_1_inside_a_container(tmp_path):
    """The path of the group is that of the host; only the mount's own folder is there."""
    mount = "sys/fs/cgroup/memory"
    files = {
        "proc/self/cgroup": "5:cpu,cpuacct:/docker/x\n4:memory:/docker/x\n1:name=systemd:/\n",
        f"{mount}/memory.limit_in_bytes": "2000000\n",
        f"{mount}/memory.usage_in_bytes": "1500000\n",
        f"{mount}/memory.stat": "inactive_file 1\ntotal_inactive_file 100000\n",
    }
    assert available_bytes(write(tmp_path, MACHINE | files)) == 600_000


def test_a_group_beyond_its_limit_has_nothing(tmp_path):
    files = {
        "proc/self/cgroup": "0::/\n",
        "sys/fs/cgroup/memory.max": "5000\n",
        "sys/fs/cgroup/memory.current": "6000\n",
    }
    assert available_bytes(write(tmp_path, MACHINE | files)) == 0


def test_what_a_pair_takes_is_what_the_code_takes():
    """Rows are corrected some at a time: the worst moment of a run."""
    n = 2500
    few = Rows(*np.ones((2, 2, 2), dtype=np.float32), {}, np.zeros((2, 5)))
    close_rows(few, 1.0)  # compiled, and its memory not counted
    tracemalloc.start()
    try:
        factors = np.full((n, n), 1.001 / n, dtype=np.float32)
        rows = Rows(factors, np.full((n, n), 1e-8, dtype=np.float32), {}, np.zeros((n, 5)))
        del factors
        kept = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        assert close_rows(rows, 1.0) == n
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert kept / n**2 == pytest.approx(memory.ROW_BYTES, abs=0.5)  # vectors of n are the rest
    # A quarter of the rows may be there twice, found anew.
    assert 0.8 * memory.PAIR_BYTES < peak / n**2 + 0.25 * memory.ROW_BYTES <= memory.PAIR_BYTES


def test_need_counts_elements_sensors_and_what_is_kept():
    assert needed_bytes(1000) == 11 * MB
    assert needed_bytes(1000, 500) == 11 * MB
    assert needed_bytes(1000, 2000) == 22 * MB + 4 * MB


def test_mirrors_and_panes_take_more():
    """Eight bytes a pair each; and what they make is not packed."""
    both = memory.more_bytes(mirrors=True, panes=True)
    assert memory.more_bytes(mirrors=False, panes=False) == 0
    assert needed_bytes(1000, more=both) == (11 + 16) * MB
    assert needed_bytes(1000, 2000, both) == 2 * (11 + 16) * MB + 4 * MB
    many = memory.DENSE_UNKNOWNS + 1
    assert needed_bytes(many, more=8) == 19 * many**2 > needed_bytes(many)


def test_a_mesh_with_mirrors_that_does_not_fit_is_refused(free, disk):
    free(15 * MB)
    disk(10**12)
    check_memory(1000)
    with pytest.raises(OutOfMemoryError, match=r"1000 elements need 0\.0 GB .* but only"):
        check_memory(1000, more=8)


@pytest.fixture
def disk(monkeypatch):
    """Let so many bytes be free for temporary files."""
    return lambda size: monkeypatch.setattr(memory, "free_on_disk", lambda: size)


def test_a_mesh_that_does_not_fit_is_refused_with_advice(free, disk):
    free(4 * 10**9)
    disk(10**9)
    check_memory(15_000)
    check_memory(40_000)  # packed, 3.2 GB
    with pytest.raises(OutOfMemoryError) as error:
        check_memory(60_000, least_elements=5_000, accuracy=0.01)
    message = str(error.value)
    # 7.2 GB packed, and what finding and solving take besides.
    assert "60000 elements need 7.9 GB" in message
    assert "only 4.0 GB are free, and 1.0 GB for temporary files" in message
    assert "a larger number than 0.01" in message and "fewer patches" in message
    assert "sensors" not in message and "\n" not in message
    assert isinstance(error.value, PatchlightError) and isinstance(error.value, MemoryError)
    disk(6 * 10**9)
    check_memory(60_000)


def test_what_is_found_must_fit_in_any_case(free, disk):
    """No disk helps where the rows of a block, before they are packed, have no room."""
    free(200 * MB)
    disk(10**12)
    with pytest.raises(OutOfMemoryError):
        check_memory(20_000)


def test_where_memory_is_short_matrices_are_packed(free):
    free(50 * MB)
    assert not memory.is_packed(2000, 2000)
    assert memory.is_packed(2300, 2300)
    assert not memory.is_packed(900, 900)  # too small to look
    free(10**12)
    assert memory.is_packed(20_000, 20_000)
    assert memory.packed_room(20_000) == 10**12 - memory.BLOCK_BYTES - 200 * MB
    free(None)
    assert memory.packed_room(20_000) is None


def test_advice_fits_the_cause(free, disk):
    disk(0)
    free(400 * MB)
    with pytest.raises(OutOfMemoryError, match="fewer patches") as error:
        check_memory(20_000, least_elements=20_000, accuracy=0.5)
    assert "accuracy" not in str(error.value)  # every patch is one element already
    free(4 * 10**9)
    with pytest.raises(OutOfMemoryError, match="fewer sensors than 200000"):
        check_memory(4_000, 200_000, least_elements=30, accuracy=0.01)


def test_an_unknown_amount_refuses_nothing(free):
    free(None)
    check_memory(10**7)
    check_matrix(10**6, 10**6)
    assert fits(10**7)


def test_a_matrix_that_does_not_fit_is_not_made(free):
    free(50 * MB)
    check_matrix(1000, 4000)
    with pytest.raises(OutOfMemoryError, match="1000 x 5000 form factors need 0.1 GB"):
        check_matrix(1000, 5000)
    free(1)
    check_matrix(100, 100)  # too small to look

    class Many:
        nets = range(10**6)

    with pytest.raises(OutOfMemoryError):
        form_factor_matrix(range(10**6), *[None] * 3, Many(), None)  # before anything is touched


def test_a_run_is_refused_before_it_begins(free, monkeypatch):
    def must_not_begin(*_, **__):
        raise AssertionError("the geometry was looked at before the memory")

    monkeypatch.setattr("patchlight.solver.simulation.kept_blockers", must_not_begin)
    room = scene(setup(Body(PatchSet.box((4, 5, 2.7), inward=True))))
    free(MB // 200)
    with pytest.raises(OutOfMemoryError, match="larger number than 0.0001") as error:
        solve(room, accuracy=1e-4)
    assert "fewer patches" in str(error.value)
