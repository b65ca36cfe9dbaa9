"""A process that compiles kernels for another one: ``python -m patchlight.solver.kernels NUMBER``.

It ends when the other one does, or closes the pipe to it.
"""

import os
import signal
import sys
import threading
import time

from ..cache_locks import locks_of
from ..compile_ahead import done_mark
from ..numba_cache import use_cache_folder

#: Between two looks at kernels that others are compiling. [s]
_PAUSE_S = 0.1


def main(number):
    """Compile what no other process does, wait for the rest, and leave a mark that all is done."""
    folder, _ = use_cache_folder()
    locks = locks_of(folder)
    if locks is None or not locks.take(f"process {number}"):
        return  # there is such a process already
    threading.Thread(target=_end_with_starter, daemon=True).start()
    from .ahead import compile_one, listed

    while not all(one.is_done for one in listed()):
        if not compile_one():
            time.sleep(_PAUSE_S)
    if not any(one.has_failed for one in listed()):
        done_mark(folder).touch()


def _end_with_starter():
    sys.stdin.buffer.read()
    from .shared_cache import SAVING

    with SAVING:  # no half a file is left behind
        os._exit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who has started this decides
    main(sys.argv[1])
