"""Numba kernels: arrays and scalars only.

Importing any of them first points Numba's disk cache to the folder of this version of all kernels.
"""

from ..numba_cache import use_cache_folder

use_cache_folder()
