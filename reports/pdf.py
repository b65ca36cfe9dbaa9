"""PDF of the report by WeasyPrint."""

from __future__ import annotations

import logging
from pathlib import Path

from patchlight.solver.errors import MissingLibraryError

from .files import write_bytes


def write_pdf(html: str, path: Path) -> Path:
    """Write ``html`` as an A4 document; the page holds everything it shows.

    Raises
    ------
    MissingLibraryError, OutputError
        If WeasyPrint or its system libraries are missing, or the file cannot be written.
    """
    # Its notes on CSS for screens are no concern of the user.
    logging.getLogger("weasyprint").setLevel(logging.ERROR)
    try:
        from weasyprint import HTML
    except (ImportError, OSError) as error:
        raise MissingLibraryError(f"report.pdf needs WeasyPrint with Pango: {error}") from error
    return write_bytes(path, HTML(string=html).write_pdf())
