"""How many threads the parallel kernels use."""

import numba as nb


def set_threads(count: int) -> int:
    """Use ``count`` threads, at most as many as there are; returns the number used before."""
    previous = nb.get_num_threads()
    nb.set_num_threads(max(1, min(count, nb.config.NUMBA_NUM_THREADS)))
    return int(previous)


def count_threads() -> int:
    """How many threads the parallel kernels use."""
    return int(nb.get_num_threads())
