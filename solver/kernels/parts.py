"""How kernels are compiled that other kernels call: as parts, without machine code of their own.

Numba links all that a function calls into it, optimises the whole and makes machine code of it,
for every function, also for those that nothing but compiled code calls: a function at the bottom
of a tree of calls is compiled again at each level above it, and three times more for each loop over
`numba.prange`. Half of the time of a first run would go there. Here a function that is called from
compiled code is optimised by itself only, until the function called from Python is complete; this
one is optimised once with all its parts. The same operations are done in the same order.

`callable_from_both` gives a function two compilers, chosen by who calls. All this builds on inner
classes of Numba, which any version may change: `compiled` imports it with tested versions only, and
asks `is_possible`.
"""

import contextlib
import types

from numba.core import codegen, compiler, dispatcher, typed_passes
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment

from .known_calls import InferTypes

#: What is taken of a library and of a dispatcher.
_LIBRARY = (
    "_codegen",
    "_ensure_finalized",
    "_final_module",
    "_finalize_dynamic_globals",
    "_finalized",
    "_get_module_for_linking",
    "_linking_libraries",
    "_raise_if_finalized",
    "_shared_module",
    "enable_object_caching",
)
_DISPATCHER = ("get_call_template", "get_overload")


def is_possible():
    """Whether the installed Numba still has what parts are made with."""
    generator = codegen.JITCPUCodegen("probe")
    _passes, _builder = generator._module_pass_manager()
    made = generator.create_library("probe")
    return all(hasattr(made, name) for name in _LIBRARY) and all(
        hasattr(dispatcher.Dispatcher, name) for name in _DISPATCHER
    )


class _Codegen:
    """The code generator as a part sees it: there is no address yet to write environments to."""

    def __init__(self, whole):
        self._whole = whole

    def __getattr__(self, name):
        return getattr(self._whole, name)

    def set_env(self, name, env):
        """Nothing: the library that the part becomes one of does it."""


class Part(codegen.JITCodeLibrary):
    """Code that has neither been linked with what it calls, nor made into machine code."""

    @property
    def codegen(self):
        return _Codegen(self._codegen)

    def finalize(self):
        """Optimise the code without what it calls; several parts of a library may define it.

        Left out, that makes the whole a few per cent slower.
        """
        self._raise_if_finalized()
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage.name == "external":
                function.linkage = "linkonce_odr"
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name):
        """Null: nothing here has an address."""
        self._ensure_finalized()
        return 0

    def _get_module_for_linking(self):
        """The code with all that it calls; callers come first, or the linker drops the called."""
        self._ensure_finalized()
        if self._shared_module is None:
            module = self._final_module.clone()
            for library in self._called():
                own = library._final_module if isinstance(library, Part) else None
                module.link_in(own or library._get_module_for_linking(), preserve=True)
            self._shared_module = module
        return self._shared_module

    def _called(self):
        """All libraries that are called, at any depth."""
        found = dict.fromkeys(self._linking_libraries)
        waiting = list(found)
        while waiting:
            library = waiting.pop()
            if isinstance(library, Part):  # others are complete by themselves
                new = [one for one in library._linking_libraries if one not in found]
                found.update(dict.fromkeys(new))
                waiting.extend(new)
        return found


def _make_part(state):
    state.library = Part(state.targetctx.codegen(), state.func_id.func_qualname)
    state.library.enable_object_caching()


@register_pass(mutates_CFG=True, analysis_only=False)
class LowerPart(typed_passes.NativeLowering):
    """Lowering into a part."""

    _name = "lower_part"

    def run_pass(self, state):
        _make_part(state)
        return super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)
class LowerWhole(typed_passes.NativeLowering):
    """Lowering into code with an address."""

    _name = "lower_whole"

    def run_pass(self, state):
        done = super().run_pass(state)
        _set_environments(state)
        return done


@register_pass(mutates_CFG=True, analysis_only=False)
class LowerLoops(typed_passes.NativeParforLowering):
    """The same of a function with parallel loops, whose bodies and their wrappers are parts."""

    _name = "lower_loops"

    def run_pass(self, state):
        context = state.targetctx.codegen()
        state.library = context.create_library(state.func_id.func_qualname)
        state.library.enable_object_caching()
        with _making_parts(context):
            done = super().run_pass(state)
        _set_environments(state)
        return done


@contextlib.contextmanager
def _making_parts(context):
    context.create_library = types.MethodType(Part, context)
    try:
        yield
    finally:
        del context.create_library


def _set_environments(state):
    """Write the environments of the parts, as Numba does for a library from its disk cache."""
    for variable in state.library._final_module.global_variables:
        env = lookup_environment(variable.name)
        if env is not None:
            state.library.codegen.set_env(variable.name, env)


class _Compiler(compiler.Compiler):
    """Numba's compiler with other passes in the place of some."""

    passes = {}

    def define_pipelines(self):
        """As Numba's, but for these passes."""
        managers = super().define_pipelines()
        for manager in managers:
            manager.passes = [(self.passes.get(p, p), name) for p, name in manager.passes]
            manager.finalize()
        return managers


class WholeCompiler(_Compiler):
    """Of functions that Python calls."""

    passes = {
        typed_passes.NopythonTypeInference: InferTypes,
        typed_passes.NativeLowering: LowerWhole,
        typed_passes.NativeParforLowering: LowerLoops,
    }


class PartCompiler(_Compiler):
    """Of functions that compiled code calls."""

    passes = {
        typed_passes.NopythonTypeInference: InferTypes,
        typed_passes.NativeLowering: LowerPart,
    }


def callable_from_both(whole, part):
    """Let compiled code that calls ``whole`` call ``part`` instead, of the same source."""
    whole.get_call_template, whole.get_overload = part.get_call_template, part.get_overload
    return whole
