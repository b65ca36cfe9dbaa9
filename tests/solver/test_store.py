"""What runs of a process share: within the memory there is, under hashes of what it is made of."""

import numpy as np
import pytest
from patchlight.solver import store
from patchlight.solver.model import Material


def test_the_store_stays_within_its_memory(monkeypatch):
    monkeypatch.setattr(store, "available_bytes", lambda: 0)
    own = store.Store()
    own.put(b"a", np.zeros(1000))
    assert own.bytes == 0 and own.get(b"a") is None
    monkeypatch.setattr(store, "available_bytes", lambda: int(20_000 / store.SHARE) - own.bytes)
    for key in (b"a", b"b", b"c"):
        own.put(key, np.zeros(1000))  # 8 kB each: two of them fit
        own.get(b"a")
    assert own.bytes == 16_000
    assert own.get(b"b") is None and own.get(b"a") is not None


def test_hashes_tell_values_apart():
    values = [
        (1, 2), ((1, 2),), (1, (2,)), ("1", 2), (1.0, 2), (None,), (True,),
        (np.zeros(2),), (np.zeros((2, 1)),), (np.zeros(2, dtype=np.float32),), (np.zeros(0),),
        (Material(0.5),), (Material(0.6),),
    ]  # fmt: skip
    hashes = [store.digest(*v) for v in values]
    assert len(set(hashes)) == len(hashes)
    assert store.digest(np.zeros((2, 2))[:, 0]) == store.digest(np.zeros(2))
    with pytest.raises(TypeError, match="object"):
        store.digest(object())
