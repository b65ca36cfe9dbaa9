"""Parts of a year on disk, so that memory stays bounded and a cut costs one of them."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.errors import OutputError
from patchlight.solver.model.arrays import FloatArray

if TYPE_CHECKING:
    import xarray

Block = dict[str, FloatArray]
#: Sensors and steps of a chunk of the file; where parts end with chunks, none is packed twice.
CHUNK = 64, 1024


def range_name(rows: slice) -> str:
    """Some sensors in the name of a file: first, and the one after the last."""
    return f"{rows.start:07d}-{rows.stop:07d}"


@dataclass(frozen=True, slots=True)
class Piece:
    """Some sensors in some steps in one state.

    Attributes
    ----------
    state : int
        Row of the state.
    sensors, steps : slice
        Of all sensors and steps.
    """

    state: int
    sensors: slice
    steps: slice

    @property
    def name(self) -> str:
        """Of its file; with both ends of the sensors, which may be parted otherwise next time."""
        return f"{self.state:03d}-{range_name(self.sensors)}-{self.steps.start:07d}"


class YearStore:
    """Variables (sensor, step) piece by piece, in memory or in a folder beside the file to write.

    Parameters
    ----------
    out : Path or None
        NetCDF file to write; without, all is kept in memory.
    key : str
        Hash of all that the values depend on: parts of another key are not taken.
    """

    def __init__(self, out: Path | None, key: str) -> None:
        self.out, self.key = out, key
        self._blocks: dict[str, Block] = {}
        self._folder = None if out is None else out.with_name(f".{out.name}.blocks")

    def _path(self, name: str, ending: str = "npz") -> Path:
        assert self._folder is not None
        return self._folder / f"{self.key[:16]}-{name}.{ending}"

    def has(self, name: str) -> bool:
        """Whether a block is there."""
        return name in self._blocks or (self._folder is not None and self._path(name).is_file())

    def put(self, name: str, block: Block) -> None:
        """Keep a block; on disk it is there as a whole or not at all."""
        if self._folder is None:
            self._blocks[name] = block
            return
        self._write(self._path(name), lambda stream: np.savez(stream, **block))  # type: ignore[arg-type]

    def _write(self, path: Path, write: Any) -> None:
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with open(draft, "wb") as stream:
                write(stream)
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(draft, path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None
        finally:
            with contextlib.suppress(OSError):
                draft.unlink()

    def get(self, name: str) -> Block:
        """A block."""
        if self._folder is None:
            return self._blocks[name]
        with np.load(self._path(name)) as file:
            return {key: file[key] for key in file.files}

    def _taken(self, name: str) -> Block:
        """A block that is not asked for again: in memory it goes."""
        return self.get(name) if self._folder is not None else self._blocks.pop(name)

    def put_record(self, name: str, record: dict[str, Any]) -> None:
        """Keep what is to be known of blocks besides, for a run that finds them all here."""
        if self._folder is not None:
            text = json.dumps(record).encode("utf-8")
            self._write(self._path(name, "json"), lambda stream: stream.write(text))

    def record(self, name: str) -> dict[str, Any] | None:
        """What `put_record` kept; None where it did not."""
        if self._folder is None:
            return None
        try:
            text = self._path(name, "json").read_text(encoding="utf-8")
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
        pieces: Iterable[Piece],
    ) -> xarray.Dataset:
        """All pieces as one dataset; on disk its variables are read when they are used.

        Parameters
        ----------
        small : Dataset
            Coordinates and whatever else is small.
        attributes : mapping
            Of each variable of the blocks.
        dims : tuple of str
            Of these variables: sensor and time, with the state before them where there are some.
        pieces : iterable of Piece
            All of them.
        """
        shape = tuple(int(small.sizes[d]) for d in dims)
        if self.out is None:
            values = {name: np.zeros(shape, dtype=np.float32) for name in attributes}
            self._fill(values, pieces, stacked=len(shape) > 2)
            for name, own in attributes.items():
                small[name] = dims, values[name], dict(own)
            return small
        import h5netcdf
        import xarray as xr

        draft = self.out.with_name(f".{self.out.stem}.{os.getpid()}.tmp{self.out.suffix}")
        chunks = (*(1 for _ in shape[:-2]), min(shape[-2], CHUNK[0]), min(shape[-1], CHUNK[1]))
        try:
            small.to_netcdf(draft, engine="h5netcdf")
            with h5netcdf.File(draft, "a") as file:
                made = {}
                for name, own in attributes.items():
                    made[name] = file.create_variable(
                        name, dims, "f4", chunks=chunks, compression="gzip", compression_opts=1
                    )
                    for key, value in own.items():
                        made[name].attrs[key] = value
                self._fill(made, pieces, stacked=len(shape) > 2)
            os.replace(draft, self.out)
        except OSError as error:
            raise OutputError(f"{self.out}: cannot be written ({error})") from None
        finally:
            with contextlib.suppress(OSError):
                draft.unlink()
        self.clear()
        return xr.open_dataset(self.out, engine="h5netcdf")

    def _fill(
        self, variables: Mapping[str, Any], pieces: Iterable[Piece], *, stacked: bool
    ) -> None:
        """Put all pieces into ``variables``."""
        for piece in pieces:
            block = self._taken(piece.name)
            place = (piece.sensors, piece.steps)
            for name, variable in variables.items():
                variable[(piece.state, *place) if stacked else place] = block[name]


def key_of(*values: Any) -> str:
    """Hash of numbers, names, arrays, and of tuples, mappings and dataclasses of them."""
    from patchlight.solver.store import digest

    return hashlib.sha256(digest(*values)).hexdigest()
