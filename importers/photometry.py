"""Photometric files: IES LM-63 and EULUMDAT."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

from patchlight.solver.errors import InputError
from patchlight.solver.model import Photometry

from .eulumdat import photometry_of_ldt
from .ies import photometry_of_ies
from .numbers_in_text import read_text


def read_photometry(path: str | os.PathLike[str]) -> Photometry:
    """Photometric web of an IES LM-63 (1986 to 2019) or EULUMDAT file.

    The format is told by what is in the file, not by its name. All factors of the file are applied:
    IES multiplier, ballast factors and the tilt factor at rest; EULUMDAT conversion factor and the
    flux of its first set of lamps. The flux integral is compared with what the file says of itself.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    Photometry
        Intensities in cd, symmetry written out; `Photometry.remarks` says what to know of the file.

    Raises
    ------
    MissingFileError
        If the file is not there or cannot be read.
    InputError
        Naming file, line or key, the value and its bound: for IES type A and B, tilt in a file of
        its own, truncated files, angles that do not ascend, negative intensities, and EULUMDAT
        files whose intensities do not add up to the light output ratio they state.
    """
    path = Path(path)
    text, raw = read_text(path)
    sha256 = hashlib.sha256(raw).hexdigest()
    if re.search(r"^\s*TILT\s*=", text, re.I | re.M):
        return photometry_of_ies(path, text, sha256)
    if text[:5].upper() in ("IESNA", "IES:L") or path.suffix.lower() == ".ies":
        raise InputError(f"{path}: no line TILT=…: this is no whole IES LM-63 file")
    return photometry_of_ldt(path, text, sha256)
