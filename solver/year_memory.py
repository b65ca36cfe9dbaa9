"""How much memory a year takes: told, and checked, before it is taken."""

from __future__ import annotations

from dataclasses import dataclass

from . import memory
from .budget import Budget, scene_bytes
from .daylit import block_of, bytes_of_sensor, even_scene
from .errors import OutOfMemoryError
from .model.scene import SceneData

#: Bytes of a value of the result, and values of a sensor in a step: light, and that of the sun.
VALUE_BYTES, VALUES = 4, 2


@dataclass(frozen=True, slots=True)
class YearMemory:
    """Memory of one year, besides that of the program itself. [B]

    Attributes
    ----------
    mesh : int
        Form factors, the sensors' among them, and solving.
    block : int
        Sensors that are done at a time.
    result : int
        Values of all sensors and steps, where they are not written to a file.
    elements, sensors : int
        What these are of.
    """

    mesh: int
    block: int
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
        bands = 1 if even.is_grey else 3
        return cls(
            mesh=_mesh_bytes(unknowns, elements, more)
            + (memory.ROW_BYTES + more) * elements * sensors
            + memory.UNKNOWN_BYTES * unknowns,
            block=min(sensors, block_of(unknowns, bands)) * bytes_of_sensor(unknowns, bands),
            result=VALUES * VALUE_BYTES * states * sensors * steps if in_memory else 0,
            elements=elements,
            sensors=sensors,
        )

    @property
    def total(self) -> int:
        """All of it at once."""
        return self.mesh + self.block + self.result

    @property
    def text(self) -> str:
        """How much it is, in words."""
        return f"up to {self.total / memory.GB:.1f} GB of memory besides the program"

    def check(self) -> None:
        """Raise `OutOfMemoryError` where that is more than there is."""
        free = memory.available_bytes()
        if free is None or self.total <= free:
            return
        advice = []
        if self.result and self.mesh + self.block <= free:
            advice.append("write the year to a file (out = …)")
        else:
            advice += ["ask for less accuracy", "use fewer sensors"]
        raise OutOfMemoryError(
            f"a year of {self.sensors} sensors on {self.elements} elements needs "
            f"{self.total / memory.GB:.1f} GB of memory: {self.mesh / memory.GB:.1f} GB for form "
            f"factors, {self.block / memory.GB:.1f} GB for sensors that are done at a time, "
            f"{self.result / memory.GB:.1f} GB for the values of all steps; but only "
            f"{free / memory.GB:.1f} GB are free; {', or '.join(advice)}"
        )


def _mesh_bytes(unknowns: int, elements: int, more: int) -> int:
    """What form factors take at the worst moment. [B]"""
    if not more and memory.is_packed(unknowns, elements):
        return memory.BLOCK_BYTES + memory.PACKED_BYTES * unknowns**2
    if unknowns > elements:
        pairs = (memory.PAIR_BYTES + more) * unknowns * elements
        return pairs + memory.KEPT_BYTES * unknowns**2
    return memory.needed_bytes(elements, 0, more)
