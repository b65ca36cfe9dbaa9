"""Numba's disk cache of a kernel, shared by processes: none compiles what another one is compiling.

Whoever compiles a signature of a function holds a lock meanwhile; others wait for it, then load the
result. Another lock is held while it is saved: without, two processes that add two signatures of a
function at the same time may give both the same file. Like `parts` this builds on inner classes of
Numba.
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
#: The same for one that only saves. [s]
_LONGEST_SAVE_S = 10.0
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
    """Cache of one function.

    Attributes
    ----------
    held : set of str
        Names of the locks that this process holds.
    """

    def take(self, signature):
        """Hold the lock of a signature; False while another process does."""
        return self._take(f"{self._impl.filename_base} {signature}")

    def free(self, signature):
        """Let other processes compile a signature, if this one holds its lock."""
        self._free(f"{self._impl.filename_base} {signature}")

    def _take(self, name):
        locks = locks_of(Path(self.cache_path))
        if locks is None:  # where nothing is kept, no other process can do it for this one
            return True
        if not locks.take(name):
            return False
        self.held.add(name)
        return True

    def _free(self, name):
        if name in self.held:
            self.held.remove(name)
            locks_of(Path(self.cache_path)).free(name)

    def holds_code(self, signature, context):
        """Whether the machine code of a signature is on the disk."""
        return self._index_key(signature, context.codegen()) in self._cache_file._load_index()

    def load_overload(self, sig, target_context):
        """Machine code from the disk; None, and the signature's lock is held, where there is none.

        Waits for another process that is compiling it, and compiles other kernels meanwhile that
        will be needed.
        """
        found = super().load_overload(sig, target_context)
        if found is None:
            from .ahead import compile_one

            _wait(lambda: self.take(sig), LONGEST_S, compile_one)
            found = super().load_overload(sig, target_context)
        return found

    def save_overload(self, sig, data):
        """Write the machine code of a signature to the disk."""
        name = self._impl.filename_base
        with SAVING:
            _wait(lambda: self._take(name), _LONGEST_SAVE_S)
            try:
                super().save_overload(sig, data)
            finally:
                self._free(name)


def _wait(is_over, longest_s, meanwhile=lambda: False):
    """Wait until something is so; meanwhile do what there is to do."""
    end = time.monotonic() + longest_s
    while not is_over() and time.monotonic() < end:
        if not meanwhile():
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
    cache.held = set()

    def compile(sig):
        with global_compiler_lock, _no_collector():
            try:
                return inner(sig)
            finally:
                cache.free(sig)

    dispatcher.compile = compile
    return dispatcher
