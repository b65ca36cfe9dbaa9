"""Kernels called by kernels: same numbers and errors, and machine code for the outermost only."""

from __future__ import annotations

import importlib.util
import math
import operator
import os
import subprocess
import sys
from pathlib import Path

import numba as nb
import numpy as np
import pytest
from numba import config
from numba.core import codegen, types
from numba.core.typing.context import BaseContext
from patchlight.solver.kernels import compiled, known_calls

KERNELS = """
import math
import numba as nb
import numpy as np
from patchlight.solver.kernels.compiled import kernel, lean, parallel

@lean
def lowest(x):
    return math.sin(x) + 0.1 * x

@lean
def middle(x):
    return lowest(x) * lowest(x + 1.0)

@kernel
def taken(n):
    return np.full(n, 0.5)

@kernel
def highest(values, n):
    total = taken(n)[0]
    for k in range(values.shape[0]):
        total += middle(values[k])
    return total

@parallel
def over_rows(values, n, out):
    for i in nb.prange(out.shape[0]):
        out[i] = highest(values[i], n)
"""
VALUES = np.linspace(-2.0, 3.0, 12).reshape(3, 4)

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


def expected(values: np.ndarray) -> float:
    """The same in Python, in the same order: no rounding apart, but for that of the sine."""
    total = 0.5
    for x in values:
        a, b = (math.sin(t) + 0.1 * t for t in (x, x + 1.0))
        total += a * b
    return total


@pytest.fixture
def load(tmp_path):
    """Functions of `KERNELS` that nothing has been compiled of."""
    path = tmp_path / "some_kernels.py"
    path.write_text(KERNELS)

    def load():
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module  # where Numba looks for what it loads from disk
        spec.loader.exec_module(module)
        return module

    yield load
    sys.modules.pop(path.stem, None)


@pytest.fixture
def optimised(monkeypatch):
    """Names of the libraries that LLVM has optimised as a whole."""
    names: list[str] = []
    inner = codegen.CPUCodeLibrary._optimize_final_module

    def count(library):
        names.append(library.name)
        inner(library)

    monkeypatch.setattr(codegen.CPUCodeLibrary, "_optimize_final_module", count)
    return names


def test_installed_numba_is_one_that_parts_were_tested_with():
    """With another, all the solver's tests pass before its version is added."""
    assert nb.version_info.short in compiled.TESTED_VERSIONS
    assert compiled._PARTS is not None


def test_only_what_python_calls_is_optimised(load, optimised):
    some = load()
    out = np.empty(3)
    some.over_rows(VALUES, 2, out)
    np.testing.assert_allclose(out, [expected(row) for row in VALUES], rtol=1e-14)
    own = ("lowest", "middle", "taken", "highest", "over_rows", "gufunc", "gufuncwrapper")
    assert [name for name in optimised if any(word in name for word in own)] == ["over_rows"]
    # Called from Python they are compiled after all, to the same bits.
    assert some.highest(VALUES[1], 2) == out[1]
    assert some.lowest(1.0) == math.sin(1.0) + 0.1
    assert {"highest", "lowest"} <= set(optimised) and "middle" not in optimised


def test_types_of_operators_are_found_once(load, monkeypatch):
    """Of the products of numbers there are two, in two functions; Numba would ask for each."""
    asked, inner = [], BaseContext.resolve_function_type

    def count(context, func, args, kws):
        asked.append((getattr(func, "typing_key", func), tuple(args)))
        return inner(context, func, args, kws)

    monkeypatch.setattr(BaseContext, "resolve_function_type", count)
    monkeypatch.setattr(known_calls, "_KNOWN", {})
    some = load()
    assert some.highest(VALUES[0], 1) == pytest.approx(expected(VALUES[0]), rel=1e-14)
    products = (operator.mul, (types.float64, types.float64))
    assert asked.count(products) == 1


@pytest.mark.parametrize("library", [object(), None], ids=["other attributes", "other arguments"])
def test_inner_classes_are_looked_at_before_they_are_taken(library, monkeypatch):
    make = library and (lambda self, name: library)
    monkeypatch.setattr(codegen.JITCPUCodegen, "create_library", make)
    assert compiled._built_on_numba("parts") is None


def test_errors_of_parts_reach_python(load):
    some = load()
    with pytest.raises(ValueError, match="negative dimensions"):
        some.highest(VALUES[0], -1)


def test_another_process_takes_them_from_disk(load, tmp_path):
    here = load().highest(VALUES[2], 1)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "import numpy as np, some_kernels\n"
        "values = np.linspace(-2.0, 3.0, 12).reshape(3, 4)[2]\n"
        "hits = some_kernels.highest.stats.cache_hits\n"
        "print(some_kernels.highest(values, 1).hex(), sum(hits.values()))\n"
        "try: some_kernels.highest(values, -1)\n"
        "except ValueError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"{here.hex()} 1", "negative dimensions not allowed"]


OTHER_NUMBA = """
import sys
import numba as nb, numpy as np
from numba.core import codegen, typed_passes
{change}
names, inner = [], codegen.CPUCodeLibrary._optimize_final_module
def count(library):
    names.append(library.name)
    inner(library)
codegen.CPUCodeLibrary._optimize_final_module = count
sys.path.insert(0, {folder!r})
import some_kernels
values = np.linspace(-2.0, 3.0, 12).reshape(3, 4)
some_kernels.over_rows(values, 1, out := np.empty(3))
print(some_kernels.highest(values[2], 1).hex(), out[2].hex())
print([word for word in ("middle", "over_rows") if any(word in name for name in names)])
"""


@pytest.mark.parametrize(
    "change, optimised",
    [
        ("", ["over_rows"]),
        ("nb.version_info = nb.version_info._replace(short=(0, 0))", ["middle", "over_rows"]),
        ("del typed_passes.NativeParforLowering", ["middle", "over_rows"]),
    ],
    ids=["as installed", "of another version", "without a class"],
)
def test_another_numba_compiles_as_it_does(change, optimised, load, tmp_path):
    """The same bits come of it."""
    here = load().highest(VALUES[2], 1).hex()
    assert with_numba(change, tmp_path) == [f"{here} {here}", str(optimised)]


@pytest.mark.parametrize("change", ["", "del codegen.JITCodeLibrary"])
def test_kernels_run_where_nothing_is_compiled(change, tmp_path, load):
    done = with_numba(change, tmp_path, NUMBA_DISABLE_JIT="1")
    found = [float.fromhex(one) for one in done[0].split()]
    assert found == pytest.approx([expected(VALUES[2])] * 2, rel=1e-14)
    assert done[1] == "[]"


def with_numba(change: str, folder: Path, **environment: str) -> list[str]:
    """What another process says that changes its Numba before kernels are loaded."""
    env = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")} | environment
    code = OTHER_NUMBA.format(change=change, folder=str(folder))
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
