"""Compiling kernels that will be needed, before they are.

The list of them holds what a run of the demo needs, which is what nearly all runs do.
"""

import functools
import importlib
import threading

from ..compile_ahead import LIST, asked_processes


class Listed:
    """A kernel of the list, with the types of its arguments."""

    def __init__(self, name, types):
        self.name, self._types = name, types
        self.is_done = self.has_failed = False

    def resolved(self):
        """The function, and the types as Numba has them."""
        module, name = self.name.split(".")
        return getattr(_Names()[module], name), eval(self._types, {}, _Names())

    def compile_if_free(self):
        """Compile the kernel; False where that is done, or another process is doing it."""
        try:
            kernel, signature = self.resolved()
            cache = kernel._cache
            self.is_done = cache.holds_code(signature, kernel.targetctx)
            if self.is_done or not cache.take(signature):
                return False
            kernel.compile(signature)  # which lets go of what was taken
        except Exception:  # a list that does not fit the kernels, a full disk: not done ahead
            self.has_failed = True
        self.is_done = True
        return True


class _Names(dict):
    """What the list is written with: types of Numba, and modules of kernels."""

    def __missing__(self, name):
        types = importlib.import_module("numba.core.types")
        if hasattr(types, name):
            return getattr(types, name)
        return importlib.import_module(f".{name}", __package__)


@functools.cache
def listed():
    """All kernels of the list, that with most machine code first."""
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return [Listed(*line.split(" ", 1)) for line in lines if line and not line.startswith("#")]


_OF_THREAD = threading.local()


def compile_one():
    """Compile the first kernel of the list that no process has compiled or is compiling.

    Returns
    -------
    bool
        False when there is none; also while one is compiled already, which waits for another one.
    """
    if asked_processes() == 0 or getattr(_OF_THREAD, "compiles", False):
        return False
    _OF_THREAD.compiles = True
    try:
        return any(one.compile_if_free() for one in listed() if not one.is_done)
    finally:
        _OF_THREAD.compiles = False
