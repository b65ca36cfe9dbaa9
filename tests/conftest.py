"""Session set-up; runs before anything imports Numba."""

import hashlib
import os
import tempfile
from pathlib import Path

# Numba drops a cached kernel only when that kernel's own file changes: an edited helper in another
# file would be tested with old machine code. So the cache is keyed by all kernel sources together.
_SOURCES = sorted((Path(__file__).parents[1] / "solver" / "kernels").rglob("*.py"))
_KEY = hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).hexdigest()[:16]
_BASE = Path(
    os.environ.get("NUMBA_CACHE_DIR", Path(tempfile.gettempdir(), f"patchlight-{os.getuid()}"))
)
# Workers of pytest-xdist inherit the folder that the first process chose.
os.environ["NUMBA_CACHE_DIR"] = str(_BASE if _BASE.name == _KEY else _BASE / _KEY)

# No test may open a window.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")
