"""How many threads the parallel kernels use."""

import contextlib

import numba as nb

#: Unoccluded pairs that a thread is worth its start for: some 20 ms.
PAIRS_OF_THREAD = 16384


def set_threads(count: int) -> int:
    """Use ``count`` threads, at most as many as there are; returns the number used before."""
    previous = nb.get_num_threads()
    nb.set_num_threads(max(1, min(count, nb.config.NUMBA_NUM_THREADS)))
    return int(previous)


def count_threads() -> int:
    """How many threads the parallel kernels use."""
    return int(nb.get_num_threads())


@contextlib.contextmanager
def threads_for(pairs: int):
    """Use no more threads than so many unoccluded ``pairs`` are worth; gives their number.

    Those that have nothing left to do wait for the others with the processor in their hands.
    """
    previous = count_threads()
    count = min(previous, 1 + pairs // PAIRS_OF_THREAD)
    if count == previous:
        yield count
        return
    nb.set_num_threads(count)
    try:
        yield count
    finally:
        nb.set_num_threads(previous)
