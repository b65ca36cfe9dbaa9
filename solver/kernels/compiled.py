"""How kernels are compiled: kept on disk, and with division as IEEE 754 has it."""

import numba as nb

#: A function that takes memory, or returns arrays.
kernel = nb.njit(cache=True, error_model="numpy", _nrt=True)
#: One that does neither, nor calls what returns arrays: references to arrays are not counted, which
#: takes half of the time of small functions given tuples of many arrays. Of what calls for memory
#: all the same, as assigning an array to a slice, compiling fails.
lean = nb.njit(cache=True, error_model="numpy", _nrt=False)
#: The same, made part of its callers.
inlined = nb.njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
#: One whose loops over `numba.prange` run on several threads.
parallel = nb.njit(cache=True, error_model="numpy", _nrt=True, parallel=True)
#: The same, free to add in another order, so that several terms are added at a time.
reordered = nb.njit(
    cache=True, error_model="numpy", _nrt=True, parallel=True, fastmath={"reassoc", "contract"}
)
