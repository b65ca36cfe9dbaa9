"""Values that runs of a process keep for later ones, by hash, within the memory that is free."""

from __future__ import annotations

import dataclasses
import hashlib
import threading
from collections import OrderedDict
from typing import Any

import numpy as np

from .memory import available_bytes

#: Share of the memory that would be free without it, which the store may take.
SHARE = 0.2
#: The same where the system does not tell. [B]
UNTOLD = 500_000_000
#: Values that may be added before the system is asked again how much memory is free: so many [B],
#: or this share of what the store may take. To ask takes milliseconds.
SMALL, SMALL_SHARE = 2_000_000, 0.05


class Store:
    """Values by hash; what was not asked for longest is given up for new ones."""

    def __init__(self) -> None:
        self._values: OrderedDict[bytes, tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()
        self.bytes = 0
        #: What it may take, and what was added since the system was asked. [B]
        self._allowed, self._unasked = 0, SMALL

    def __len__(self) -> int:
        return len(self._values)

    def get(self, key: bytes) -> Any:
        """The value under ``key``; None where there is none."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def put(self, key: bytes, value: Any) -> None:
        """Keep ``value``, unless it takes more memory than the store may have."""
        size = nbytes(value)
        with self._lock:
            self.bytes -= self._values.pop(key, (None, 0))[1]
            room = self._room(size)
            while self._values and self.bytes + size > room:
                self.bytes -= self._values.popitem(last=False)[1][1]
            if size <= room:
                self._values[key] = value, size
                self.bytes += size

    def _room(self, size: int) -> int:
        """What the store may take now; what is small is let in without asking the system. [B]"""
        self._unasked += size
        enough = max(SMALL, int(SMALL_SHARE * self._allowed))
        if self._unasked > enough or self.bytes + size > self._allowed:
            free = available_bytes()
            self._allowed = UNTOLD if free is None else int(SHARE * (free + self.bytes))
            self._unasked = 0
        return self._allowed

    def clear(self) -> None:
        """Free what is kept."""
        with self._lock:
            self._values.clear()
            self.bytes = 0


#: What runs of this process share.
STORE = Store()


def forget() -> None:
    """Free all that runs of this process have kept."""
    STORE.clear()


def digest(*values: Any) -> bytes:
    """Hash of numbers, names, arrays, and of tuples and dataclasses of them."""
    sha = hashlib.sha256()
    for value in values:
        _feed(sha, value)
    return sha.digest()


def _feed(sha: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        sha.update(f"{value.dtype.str}{value.shape}".encode())
        sha.update(np.ascontiguousarray(value).data.cast("B") if value.size else b"")
    elif isinstance(value, (tuple, list)):
        sha.update(f"({len(value)}".encode())
        for item in value:
            _feed(sha, item)
    elif dataclasses.is_dataclass(value):
        sha.update(type(value).__name__.encode())
        for item in dataclasses.fields(value):
            _feed(sha, getattr(value, item.name))
    elif isinstance(value, bytes):
        sha.update(b"b%d" % len(value) + value)
    elif value is None or isinstance(value, (str, int, float, np.generic)):
        sha.update(f"{value!r};".encode())
    else:
        raise TypeError(f"{type(value).__name__}: has no hash by content")


def nbytes(value: Any) -> int:
    """Memory that the arrays in tuples and dataclasses take. [B]"""
    if isinstance(value, np.ndarray):
        return int(value.nbytes)
    if isinstance(value, (tuple, list)):
        return sum(nbytes(item) for item in value)
    if dataclasses.is_dataclass(value):
        return sum(nbytes(getattr(value, item.name)) for item in dataclasses.fields(value))
    return 0
