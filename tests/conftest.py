"""Session set-up; runs before anything imports Numba."""

import os
import tempfile
from pathlib import Path

from patchlight.solver.numba_cache import source_key

# Always keyed by the kernel sources, also below a folder given by the user: otherwise an edited
# kernel would be tested with the old machine code of those that call it.
_KEY = source_key()
_BASE = Path(
    os.environ.get("NUMBA_CACHE_DIR") or Path(tempfile.gettempdir(), f"patchlight-{os.getuid()}")
)
# Workers of pytest-xdist and child processes inherit the folder that the first process chose.
os.environ["NUMBA_CACHE_DIR"] = str(_BASE if _BASE.name == _KEY else _BASE / _KEY)

# No test may open a window.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")
