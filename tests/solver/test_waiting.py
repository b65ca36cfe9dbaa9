"""Threads that wait for kernels sleep, unless the user says otherwise."""

import importlib
import os

import pytest
from patchlight.solver import kernels


@pytest.mark.parametrize(("given", "found"), [(None, "PASSIVE"), ("ACTIVE", "ACTIVE")])
def test_threads_sleep_while_they_wait_unless_told_otherwise(monkeypatch, given, found):
    monkeypatch.setenv("OMP_WAIT_POLICY", "ACTIVE")
    if given is None:
        monkeypatch.delenv("OMP_WAIT_POLICY")
    importlib.reload(kernels)
    assert os.environ["OMP_WAIT_POLICY"] == found
