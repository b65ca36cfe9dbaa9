"""How kernels are compiled: kept on disk, and with division as IEEE 754 has it."""

import numba as nb

from . import parts

_PARTS = not nb.config.DISABLE_JIT and parts.is_possible()
#: There is no C code that could call a kernel.
_ALL = {"error_model": "numpy", "no_cfunc_wrapper": True}


def _compiled(**options):
    """Decorator of kernels."""
    options |= _ALL
    if not _PARTS:
        return nb.njit(cache=True, **options)

    def compile_kernel(function):
        whole = nb.njit(cache=True, pipeline_class=parts.WholeCompiler, **options)(function)
        if options.get("parallel"):
            return whole
        part = nb.njit(pipeline_class=parts.PartCompiler, no_cpython_wrapper=True, **options)
        return parts.callable_from_both(whole, part(function))

    return compile_kernel


#: A function that takes memory, or returns arrays.
kernel = _compiled(_nrt=True)
#: One that does neither, nor calls what returns arrays: references to arrays are not counted, which
#: takes half of the time of small functions given tuples of many arrays. Of what calls for memory
#: all the same, as assigning an array to a slice, compiling fails.
lean = _compiled(_nrt=False)
#: The same, made part of its callers.
inlined = _compiled(_nrt=False, forceinline=True)
#: One whose loops over `numba.prange` run on several threads.
parallel = _compiled(_nrt=True, parallel=True)
#: The same, free to add in another order, so that several terms are added at a time.
reordered = _compiled(_nrt=True, parallel=True, fastmath={"reassoc", "contract"})
