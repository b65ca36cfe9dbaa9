"""Numba kernels: arrays and scalars only.

Importing any of them first points Numba's disk cache to the folder of this version of all kernels.
Threads that wait for work sleep, unless the environment says otherwise: kernels are short, and
threads that spin between them, as they do by default, take a third of all CPU time on two busy
cores.
"""

import os

from ..numba_cache import use_cache_folder

use_cache_folder()
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
