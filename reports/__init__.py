"""Patchlight reports: every file of an output folder, from a `Result`.

Importing this package loads no plotting, rendering or template library; the functions below load
what they need when called.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from patchlight.solver.lazy import lazy_attributes

if TYPE_CHECKING:
    from .batch import write_batch_summary
    from .metrics import RequirementResult, evaluate_requirements
    from .status import pdf_status, rendering_status
    from .writer import write_report, write_run
    from .year_caveats import year_remarks
    from .year_files import write_year
    from .year_metrics import year_rows

__all__ = [
    "RequirementResult",
    "evaluate_requirements",
    "pdf_status",
    "rendering_status",
    "write_batch_summary",
    "write_report",
    "write_run",
    "write_year",
    "year_remarks",
    "year_rows",
]

_HOME = {
    "RequirementResult": ".metrics",
    "evaluate_requirements": ".metrics",
    "pdf_status": ".status",
    "rendering_status": ".status",
    "write_batch_summary": ".batch",
    "write_report": ".writer",
    "write_run": ".writer",
    "write_year": ".year_files",
    "year_remarks": ".year_caveats",
    "year_rows": ".year_metrics",
}


__getattr__ = lazy_attributes(__name__, _HOME)


def __dir__() -> list[str]:
    return sorted(__all__)
