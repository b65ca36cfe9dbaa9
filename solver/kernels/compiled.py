"""How kernels are compiled: kept on disk, and with division as IEEE 754 has it."""

import importlib

import numba as nb

from ..numba_cache import TESTED_VERSIONS


def _built_on_numba(name):
    """The module `parts` or `shared_cache`; None, and Numba does as it does, which takes longer."""
    if nb.config.DISABLE_JIT or nb.version_info.short not in TESTED_VERSIONS:
        return None
    try:
        module = importlib.import_module(f".{name}", __package__)
        return module if module.is_possible() else None
    except Exception:  # whatever comes of inner classes that have changed after all
        return None


_PARTS, _SHARED_CACHE = _built_on_numba("parts"), _built_on_numba("shared_cache")
#: There is no C code that could call a kernel.
_ALL = {"error_model": "numpy", "no_cfunc_wrapper": True}


def _compiled(**options):
    """Decorator of kernels."""
    options |= _ALL
    whole_options = {} if _PARTS is None else {"pipeline_class": _PARTS.WholeCompiler}

    def compile_kernel(function):
        whole = nb.njit(cache=True, **whole_options, **options)(function)
        if _SHARED_CACHE is not None:
            _SHARED_CACHE.share(whole)
        if _PARTS is None or options.get("parallel"):
            return whole
        part = nb.njit(pipeline_class=_PARTS.PartCompiler, no_cpython_wrapper=True, **options)
        return _PARTS.callable_from_both(whole, part(function))

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
