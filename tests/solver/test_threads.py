"""Threads: as many as a job is worth, asleep while they wait."""

from __future__ import annotations

import os
import subprocess
import sys

import numba
import pytest
from patchlight.solver.kernels.threads import (
    PAIRS_OF_THREAD,
    count_threads,
    set_threads,
    threads_for,
)


def test_a_job_takes_as_many_threads_as_it_is_worth():
    before = count_threads()
    with threads_for(0) as few:
        assert few == count_threads() == 1
    with threads_for(10**6 * PAIRS_OF_THREAD) as all_of_them:
        assert all_of_them == count_threads() == before
    assert count_threads() == before


def test_a_job_takes_no_more_threads_than_the_user_allows():
    before = set_threads(1)
    try:
        with threads_for(10**9) as count:
            assert count == 1
        assert count_threads() == 1
    finally:
        set_threads(before)


def test_threads_are_given_back_after_an_error():
    before = count_threads()
    with pytest.raises(KeyError), threads_for(0):
        raise KeyError
    assert count_threads() == before


WAIT = """
import time
from patchlight.solver.kernels import threads
import numba
@numba.njit(parallel=True)
def uneven(x):
    for k in numba.prange(2):
        if k == 0:
            for i in range(x.shape[0]):
                x[i] = x[i] * 1.0000001 + 1e-9
import numpy as np
x = np.ones(150_000_000)
numba.set_num_threads(2)
uneven(x[:10])
start = time.thread_time(), time.process_time()
uneven(x)
print(time.thread_time() - start[0], time.process_time() - start[1])
print(numba.threading_layer())
"""


@pytest.mark.slow
@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one core: no other thread waits")
def test_who_waits_sleeps():
    """A thread with nothing to do takes no time of a core; turning round it took as much."""
    env = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"}
    done = subprocess.run(
        [sys.executable, "-c", WAIT], capture_output=True, text=True, env=env, check=True
    )
    own, whole, layer = done.stdout.split()
    if layer != "omp":
        pytest.skip(f"threads of {layer}")
    assert float(whole) < 1.5 * float(own)
    user = {**env, "OMP_WAIT_POLICY": "ACTIVE"}
    script = "import patchlight.solver.kernels, os; print(os.environ['OMP_WAIT_POLICY'])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=user)
    assert done.stdout.split() == ["ACTIVE"]
