"""How much memory a year takes: told, and checked, before it is taken."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass

from . import memory
from .budget import Budget, scene_bytes
from .daylit import SENSORS, block_of, bytes_of_sensor, even_scene
from .errors import OutOfMemoryError
from .model.bands import SPECTRAL
from .model.scene import SceneData
from .store import STORE

#: Bytes of a value of the result, and values of a sensor in a step: light, and that of the sun;
#: where the spectrum is asked for one more.
VALUE_BYTES, VALUES = 4, 2


@dataclass(frozen=True, slots=True)
class YearMemory:
    """Memory of one year, besides that of the program itself. [B]

    Attributes
    ----------
    mesh : int
        Form factors, the sensors' among them, and solving, where there is room for all of it.
    least_mesh, packed : int
        The same where memory is scarce: what must be memory, and form factors that are packed, of
        which what memory does not hold goes to a temporary file.
    block, least_block : int
        Sensors that are done at a time, as many as usual, and as few as can be.
    result : int
        Values of all sensors and steps, where they are not written to a file.
    elements, sensors : int
        What these are of.
    """

    mesh: int
    least_mesh: int
    packed: int
    block: int
    least_block: int
    result: int
    elements: int
    sensors: int

    @classmethod
    def of(
        cls, scene: SceneData, *, accuracy: float, steps: int, states: int, in_memory: bool
    ) -> YearMemory:
        """That of a scene on the mesh that it begins with; one that is cut further takes more.

        Parameters
        ----------
        scene : SceneData
            In one of its states.
        accuracy : float
            As of `DaylitScene.of`.
        steps, states : int
            Number of both.
        in_memory : bool
            Whether all values are kept in memory, else in a file.
        """
        even = even_scene(scene)
        budget, more = Budget.of(even, accuracy), scene_bytes(even)
        unknowns, elements = budget.unknowns, budget.elements
        sensors = sum(len(grid) for grid in even.sensors)
        bands = even.bands
        rest = (memory.ROW_BYTES + more) * elements * sensors + memory.UNKNOWN_BYTES * unknowns
        whole = least = _whole_bytes(unknowns, elements, more)
        packed, own = 0, memory.PACKED_BYTES * unknowns**2
        always = _is_always_packed(unknowns, elements)
        # What has panes is never packed.
        if not more and (always or whole > memory.BLOCK_BYTES + own):
            least, packed = memory.BLOCK_BYTES, own
            if always:
                whole = least + packed
        each, values = bytes_of_sensor(unknowns, bands), VALUES + (bands == SPECTRAL)
        return cls(
            mesh=whole + rest,
            least_mesh=least + rest,
            packed=packed,
            block=min(sensors, block_of(unknowns, bands)) * each,
            least_block=min(sensors, SENSORS) * each,
            result=values * VALUE_BYTES * states * sensors * steps if in_memory else 0,
            elements=elements,
            sensors=sensors,
        )

    @property
    def total(self) -> int:
        """All of it at once."""
        return self.mesh + self.block + self.result

    @property
    def least(self) -> int:
        """What it cannot do with less than, what may be in a temporary file apart."""
        return self.least_mesh + self.least_block + self.result

    @property
    def most(self) -> int:
        """What it takes of the memory that is free now."""
        free = memory.available_bytes()
        return self.total if free is None else max(self.least, min(self.total, free))

    def check(self) -> None:
        """Raise `OutOfMemoryError` where that is more than there is.

        What is kept for later runs gives way.
        """
        free = memory.available_bytes()
        if not self._fits(free) and len(STORE):
            STORE.clear()
            free = memory.available_bytes()
        if free is None or self._fits(free):
            return
        advice = []
        if self.result and self._fits(free + self.result):
            advice.append("write the year to a file (out = …)")
        else:
            advice += ["ask for less accuracy", "use fewer sensors"]
        raise OutOfMemoryError(
            f"a year of {self.sensors} sensors on {self.elements} elements needs "
            f"{self.least / memory.GB:.1f} GB of memory: {self.least_mesh / memory.GB:.1f} GB for "
            f"form factors, {self.least_block / memory.GB:.1f} GB for sensors that are done at a "
            f"time, {self.result / memory.GB:.1f} GB for the values of all steps; and "
            f"{self.packed / memory.GB:.1f} GB of memory or temporary files for packed form "
            f"factors; but only {free / memory.GB:.1f} GB are free, and "
            f"{memory.free_on_disk() / memory.GB:.1f} GB for temporary files in "
            f"{tempfile.gettempdir()}; {', or '.join(advice)}"
        )

    def _fits(self, free: int | None) -> bool:
        """Whether so much memory does, with what there is for temporary files. [B]"""
        if free is None:
            return True
        rest = free - self.least
        return rest >= 0 and (self.packed <= rest or self.packed <= rest + memory.free_on_disk())


def _whole_bytes(unknowns: int, elements: int, more: int) -> int:
    """What form factors take at the worst moment, where none are packed. [B]"""
    if unknowns > elements:
        pairs = (memory.PAIR_BYTES + more) * unknowns * elements
        return pairs + memory.KEPT_BYTES * unknowns**2
    return (memory.PAIR_BYTES + more) * elements**2


def _is_always_packed(unknowns: int, elements: int) -> bool:
    """Whether they are packed however much memory there is."""
    most = memory.VARYING_UNKNOWNS if unknowns > elements else memory.DENSE_UNKNOWNS
    return unknowns > most
