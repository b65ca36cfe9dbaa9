"""Numba's disk cache of a kernel, shared by processes: none compiles what another one is compiling.

Numba's own writes whole files, but two processes that add two signatures of a function at the same
time may give both the same file. Here whoever compiles a function holds its lock meanwhile; others
wait, then load the result. Like `parts` this builds on inner classes of Numba.
"""

import contextlib
import gc
import threading
import time
from pathlib import Path

from numba.core import caching
from numba.core.compiler_lock import global_compiler_lock

from ..cache_locks import locks_of

#: After this a process that holds a lock is taken to hang: the largest kernel takes 45 s of one
#: core, six times that on a slow and busy machine. [s]
LONGEST_S = 300.0
#: Between two looks at a lock. [s]
_PAUSE_S = 0.02
#: Held while a file is written.
SAVING = threading.Lock()


def is_possible():
    """Whether the installed Numba still has what this is made with."""
    names = ("_cache_file", "_impl", "_index_key", "cache_path", "load_overload", "save_overload")
    made = caching.FunctionCache(is_possible)
    return all(hasattr(made, name) for name in names) and all(
        hasattr(made._cache_file, name) for name in ("_load_index", "_save_index")
    )


class SharedCache(caching.FunctionCache):
    """Cache of one function."""

    #: Whether this process holds the lock.
    _holds = False

    def take(self):
        """Hold the function's lock; False while another process does."""
        locks = locks_of(Path(self.cache_path))
        if locks is None:
            return True  # where nothing is kept, no other process can do it for this one
        self._holds = locks.take(self._impl.filename_base)
        return self._holds

    def free(self):
        """Let other processes compile the function."""
        if self._holds:
            locks_of(Path(self.cache_path)).free(self._impl.filename_base)
            self._holds = False

    def holds_code(self, signature, context):
        """Whether the machine code of a signature is on the disk."""
        return self._index_key(signature, context.codegen()) in self._cache_file._load_index()

    def load_overload(self, sig, target_context):
        """Machine code from the disk; None, and the function's lock is held, where there is none.

        Waits for another process that is compiling the function.
        """
        found = super().load_overload(sig, target_context)
        if found is None:
            self._wait()
            found = super().load_overload(sig, target_context)
        return found

    def save_overload(self, sig, data):
        """Write the machine code of a signature to the disk."""
        with SAVING:
            super().save_overload(sig, data)

    def _wait(self):
        """Wait for the lock; meanwhile compile other kernels that will be needed."""
        end = time.monotonic() + LONGEST_S
        while not self.take() and time.monotonic() < end:
            from .ahead import compile_one

            if not compile_one():
                time.sleep(_PAUSE_S)


@contextlib.contextmanager
def _no_collector():
    """Let garbage lie: to look for it takes a tenth of the time of compiling, and finds little."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def share(dispatcher):
    """Share the disk cache of a function."""
    cache, inner = dispatcher._cache, dispatcher.compile
    cache.__class__ = SharedCache  # a second one would look at the folder again, which takes time

    def compile(sig):
        with global_compiler_lock, _no_collector():
            try:
                return inner(sig)
            finally:
                cache.free()

    dispatcher.compile = compile
    return dispatcher
