"""The solver: form factors, visibility, radiosity, sky and sun on curved patches.

Importing this package loads nothing heavy; each name is looked up when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .factors import form_factors, point_form_factors
    from .model.elements import Elements
    from .model.form_factors import FormFactors
    from .model.patches import PatchSet

#: Module of every public name. None may be called like a name in it: importing a module makes it an
#: attribute of its package, in place of the function.
_HOME = {
    "Elements": ".model.elements",
    "FormFactors": ".model.form_factors",
    "PatchSet": ".model.patches",
    "form_factors": ".factors",
    "point_form_factors": ".factors",
}

__all__ = ["Elements", "FormFactors", "PatchSet", "form_factors", "point_form_factors"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
