"""Blocks of steps of a year on disk, so that memory stays bounded and a cut costs one block."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.errors import OutputError
from patchlight.solver.model.arrays import FloatArray

if TYPE_CHECKING:
    import xarray

Block = dict[str, FloatArray]


class YearStore:
    """Blocks of variables (…, sensor, step), in memory or in a folder beside the file to write.

    Parameters
    ----------
    out : Path or None
        NetCDF file to write; without, blocks are kept in memory.
    key : str
        Hash of all that the values depend on: blocks of another key are not taken.
    """

    def __init__(self, out: Path | None, key: str) -> None:
        self.out, self.key = out, key
        self._blocks: dict[int, Block] = {}
        self._folder = None if out is None else out.with_name(f".{out.name}.blocks")

    def _path(self, number: int) -> Path:
        assert self._folder is not None
        return self._folder / f"{self.key[:16]}-{number:05d}.npz"

    def has(self, number: int) -> bool:
        """Whether a block is there."""
        return number in self._blocks or (self._folder is not None and self._path(number).is_file())

    def put(self, number: int, block: Block) -> None:
        """Keep a block; on disk it is there as a whole or not at all."""
        if self._folder is None:
            self._blocks[number] = block
            return
        path = self._path(number)
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with open(draft, "wb") as stream:
                np.savez(stream, **block)  # type: ignore[arg-type]
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(draft, path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None
        finally:
            with contextlib.suppress(OSError):
                draft.unlink()

    def get(self, number: int) -> Block:
        """A block."""
        if self._folder is None:
            return self._blocks[number]
        with np.load(self._path(number)) as file:
            return {name: file[name] for name in file.files}

    def put_record(self, record: dict[str, Any]) -> None:
        """Keep what is to be known of all blocks besides, for a run that finds them all here."""
        if self._folder is None:
            return
        path = self._folder / f"{self.key[:16]}.json"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            draft = path.with_name(f".{path.name}.{os.getpid()}")
            draft.write_text(json.dumps(record), encoding="utf-8")
            os.replace(draft, path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None

    def record(self) -> dict[str, Any] | None:
        """What `put_record` kept; None where it did not."""
        if self._folder is None:
            return None
        try:
            text = (self._folder / f"{self.key[:16]}.json").read_text(encoding="utf-8")
            found: dict[str, Any] = json.loads(text)
        except (OSError, ValueError):
            return None
        return found

    def clear(self) -> None:
        """Take the folder away."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def dataset(
        self,
        small: xarray.Dataset,
        attributes: Mapping[str, Mapping[str, Any]],
        dims: tuple[str, ...],
        ends: list[int],
    ) -> xarray.Dataset:
        """All blocks as one dataset; on disk its variables are read when they are used.

        Parameters
        ----------
        small : Dataset
            Coordinates and whatever else is small.
        attributes : mapping
            Of each variable of the blocks.
        dims : tuple of str
            Of these variables, the last one being the time.
        ends : list of int
            End of each block among the steps.
        """
        if self.out is None:
            for name, own in attributes.items():
                parts = [self.get(k)[name] for k in range(len(ends))]
                small[name] = dims, np.concatenate(parts, axis=-1), dict(own)
            return small
        import h5netcdf
        import xarray as xr

        draft = self.out.with_name(f".{self.out.stem}.{os.getpid()}.tmp{self.out.suffix}")
        shape = tuple(int(small.sizes[d]) for d in dims)
        try:
            small.to_netcdf(draft, engine="h5netcdf")
            with h5netcdf.File(draft, "a") as file:
                chunks = (*shape[:-2], min(shape[-2], 64), min(shape[-1], 1024))
                for name, own in attributes.items():
                    made = file.create_variable(
                        name, dims, "f4", chunks=chunks, compression="gzip", compression_opts=1
                    )
                    for key, value in own.items():
                        made.attrs[key] = value
                start = 0
                for k, end in enumerate(ends):
                    block = self.get(k)
                    for name in attributes:
                        file.variables[name][..., start:end] = block[name]
                    start = end
            os.replace(draft, self.out)
        except OSError as error:
            raise OutputError(f"{self.out}: cannot be written ({error})") from None
        finally:
            with contextlib.suppress(OSError):
                draft.unlink()
        self.clear()
        return xr.open_dataset(self.out, engine="h5netcdf")


def key_of(*values: Any) -> str:
    """Hash of numbers, names, arrays, and of tuples, mappings and dataclasses of them."""
    from patchlight.solver.store import digest

    return hashlib.sha256(digest(*values)).hexdigest()
