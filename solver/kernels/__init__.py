"""Numba kernels: arrays and scalars only.

Importing any of them first points Numba's disk cache to the folder of this version of all kernels,
and lets threads sleep that have nothing to do.
"""

from ..cores import let_threads_sleep
from ..numba_cache import use_cache_folder

use_cache_folder()
let_threads_sleep()
