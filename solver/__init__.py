"""The solver: form factors, visibility, radiosity, sky and sun on curved patches.

Importing this package loads nothing heavy; each name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .lazy import lazy_attributes

if TYPE_CHECKING:
    from .factors import form_factors, point_form_factors
    from .glossy import specular_radiance
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
    "specular_radiance": ".glossy",
}

__all__ = [
    "Elements",
    "FormFactors",
    "PatchSet",
    "form_factors",
    "point_form_factors",
    "specular_radiance",
]


__getattr__ = lazy_attributes(__name__, _HOME)


def __dir__() -> list[str]:
    return sorted(__all__)
