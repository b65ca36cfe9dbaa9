"""Write the list of kernels that are compiled ahead of a first run, `solver/kernels/ahead.txt`.

    python tests/pipeline/first_kernels.py > new.txt && mv new.txt solver/kernels/ahead.txt

The list is what ``patchlight demo office`` calls from Python.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from pathlib import Path

HEAD = """\
# Kernels that a run of the demo calls from Python, with the types of their arguments, as
# tests/pipeline/first_kernels.py finds them. That with most machine code comes first.
"""


def text_of(kind) -> str:
    """A type of Numba as Python that makes it from names of `numba.core.types` and of kernels."""
    from numba.core import types

    if isinstance(kind, types.Array):
        read_only = "" if kind.mutable else ", True"
        return f"Array({text_of(kind.dtype)}, {kind.ndim}, {kind.layout!r}{read_only})"
    if isinstance(kind, types.BaseNamedTuple):
        home = kind.instance_class.__module__.rsplit(".", 1)[1]
        name = f"{home}.{kind.instance_class.__name__}"
        if isinstance(kind, types.NamedUniTuple):
            return f"NamedUniTuple({text_of(kind.dtype)}, {kind.count}, {name})"
        return f"NamedTuple({texts_of(kind.types)}, {name})"
    if isinstance(kind, types.UniTuple):
        return f"UniTuple({text_of(kind.dtype)}, {kind.count})"
    if isinstance(kind, types.Tuple):
        return f"Tuple({texts_of(kind.types)})"
    if isinstance(kind, types.Omitted):
        return f"Omitted({kind.value!r})"
    text = "boolean" if kind == types.boolean else str(kind)
    if getattr(types, text, None) != kind:
        raise TypeError(f"{kind!r}: how to write this type is not known here")
    return text


def texts_of(kinds) -> str:
    """A tuple of types."""
    return f"({' '.join(text_of(kind) + ',' for kind in kinds)})"


def called_kernels() -> list[str]:
    """Lines of the list for all kernels that this process has called; the largest code first."""
    from numba.core.dispatcher import Dispatcher

    sizes = {}
    for name, module in list(sys.modules.items()):
        if not name.startswith("patchlight.solver.kernels."):
            continue
        for kernel in vars(module).values():
            if isinstance(kernel, Dispatcher):
                place = f"{kernel.__module__.rsplit('.', 1)[1]}.{kernel.__name__}"
                for arguments in kernel.overloads:
                    sizes[f"{place} {texts_of(arguments)}"] = code_size(kernel, arguments)
    return sorted(sizes, key=lambda line: (-sizes[line], line))


def code_size(kernel, arguments) -> int:
    """Bytes of a kernel's machine code in the disk cache."""
    cache = kernel._cache
    key = cache._index_key(arguments, kernel.targetctx.codegen())
    name = cache._cache_file._load_index()[key]
    return Path(cache.cache_path, name).stat().st_size


def main() -> None:
    """Run the demo in this process, and print the list."""
    from patchlight.pipeline.cli import main as run

    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stdout(sys.stderr):
        run(["demo", "office", "-o", out])
    print(HEAD + "\n".join(called_kernels()))


if __name__ == "__main__":
    main()
