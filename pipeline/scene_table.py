"""What tables of scene.toml have in common."""

from __future__ import annotations

import math
from typing import Annotated, Any

from patchlight.solver.errors import PatchlightError
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{value}: must be a finite number")
    return value


Number = Annotated[float, Field(strict=True), AfterValidator(_finite)]
Text = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """Base of all tables."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    @model_validator(mode="after")
    def _build_once(self) -> Table:
        """Make what the table describes, so that its own checks run with all others."""
        try:
            self.build()
        except PatchlightError as error:
            raise ValueError(str(error)) from None
        return self

    def build(self) -> Any:
        """What the table describes."""
        return None

    def given(self) -> dict[str, Any]:
        """Values that are not None, by key."""
        return {k: v for k in type(self).model_fields if (v := getattr(self, k)) is not None}
