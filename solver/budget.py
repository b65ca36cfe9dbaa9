"""From the one accuracy knob to every tolerance of the simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .memory import has_room, more_bytes, varying_bytes
from .mesh import divisions
from .model.arrays import IntArray
from .model.scene import SceneData

#: Elements beyond which the mesh is made coarser instead: time and memory grow with the square.
MAX_ELEMENTS = 4000
#: Elements up to which light varies over each in any scene. Beyond, only where all light passes by
#: form factors alone: with webs, uneven lamps or mirrors it is constant on each element then, which
#: costs as many rows (four nodes an element) and has twice the error.
VARYING_ELEMENTS = 4000
#: Elements against patches where there are more patches than that: large ones are cut all the same.
PER_PATCH = 1.26
#: Rooms along the middle dimension of a scene of many patches, at most.
MANY_ROOMS = 20.0
#: Elements beyond which a mesh is large: rows are what takes time, and are found with less each.
MANY_ELEMENTS = 4000
#: Elements smaller than this share of the aimed size get a single node, and those of large meshes.
SMALL, SMALL_OF_MANY = 0.1, 0.75
#: Form factor against the accuracy above which a pair is traced, and that of large meshes.
EXACT, EXACT_OF_MANY = 4.0, 160.0
#: Form factor against the accuracy above which a pair of sensor and element is traced, and the
#: accuracy above which fewer are: there it grows with the square. What meridians leave wrong of a
#: partly hidden element falls with their number, so that it keeps its share of the error.
EXACT_AT_SENSORS, LOOSE = 0.1, 0.075
#: Accuracy of unoccluded factors at sensors, and where nothing hides anything, against that of
#: other pairs: no average over nodes and meridians hides it there. Above `LOOSE` it grows with the
#: square, too: what it leaves is measured (`rule_error`), and next to nothing of what is asked for.
FINE_SHARE = 0.05
#: Meridians about each sensor, times the accuracy, and the fewest.
SENSOR_LINES, SENSOR_LINES_AT_LEAST = 16.0, 64
#: Rows of the iterated gather that are always found where the accuracy is so much or finer.
PIECES, PIECES_ACCURACY = 4096, 0.05
#: Meridians about each node of large meshes, and points on the bright elements of each solid: with
#: 32 meridians sensors get the same light to 2e-4 as with 250, with 16 to 1.2e-3, with 8 to 2e-3.
LINES_OF_MANY, SIGHTS_OF_MANY = 32, 256
#: Rows of the iterated gather against those of the mesh, down to an accuracy; beyond it more, by
#: the inverse of its third root, as the size of elements goes. Light on elements that are left out
#: is not put right beside edges: with 1.0 at all accuracies errors grew again at 0.001.
GATHERED, GATHERED_MORE_BELOW = 1.0, 0.01
#: In large meshes, what may be left out against what is looked at: in a hall of 81 desks 322 of
#: 7744 elements are looked at then. With 0.2 the light at sensors is the same to 1e-4, for a fourth
#: more time; what is left out counts in the error that is stated.
LEFT_OUT_OF_MANY = 0.5
#: Error against the change by the iterated gather in large meshes, whose elements are coarse for
#: the shadows on them: what they lose to places that see less of the scene, it shows in part.
CHANGE_OF_MANY = 3.0
#: Error far from the elements against its change as they are halved, 1 / (2^p - 1) where it falls
#: with the power p of their size: of elements that are coarse for the shadows on them, the first.
FAR, FAR_OF_MANY = 1.0 / 3.0, 1.0
#: Share and number of elements that may be added where direct light changes.
MORE, MORE_AT_LEAST = 0.5, 60
#: Elements that are added in scenes with lamps: what the estimate of the time takes for usual.
USUALLY_MORE = 0.2
#: Inset Gauss nodes a direction in each element: a single one is blind to shadow edges.
NODES = {"constant": 2, "bilinear": 2, "biquadratic": 3, "corners": 2}

#: What users may ask for.
BASES = ("constant", "bilinear", "biquadratic")


@dataclass(frozen=True, slots=True)
class Budget:
    """Tolerances of one run.

    Attributes
    ----------
    accuracy : float
        What was asked for.
    size : float
        Aimed size of an element. [m]
    divisions : (p, 2) int array
        Elements of each patch along u and v.
    elements, receivers : int
        Number of elements before refinement, and of sensors and nodes together.
    unknowns : int
        What their light is made of, at most.
    most_elements : int
        How many of them cuts where lamps' light changes may lead to.
    elements_at_most : int
        How many of them cuts where the error is may lead to.
    misplaced : float
        Share of the reflected direct light that the mesh may have in the wrong place.
    distance : float
        Distance between surfaces to which places are compared. [m]
    basis : str
        How exitance varies over an element: "constant", "bilinear" or "biquadratic", or bilinearly
        between its "corners".
    nodes : int
        Nodes a direction in each element.
    moments : float
        Error of the share of each node in the form factor of a near element.
    small : float
        Share of ``size`` below which elements have a single node.
    eps : float
        Relative accuracy of unoccluded form factors.
    lines, sensor_lines : int
        Meridians about each node and each sensor.
    sights : int
        Points on the bright elements of each solid.
    exact_above, sensor_exact_above : float
        Unoccluded form factor above which a pair is traced by pyramids: from nodes, and sensors.
    cell_eps, lamp_cell_eps : float
        Form factor below which a partly hidden cell is sampled: between surfaces, and of lamps.
    sensor_dome_cell_eps : float
        The same for cells of the sky seen from sensors.
    sun_cell_eps : float
        The same for parts of the sun's disc, relative to the whole disc.
    """

    accuracy: float
    size: float
    divisions: IntArray
    elements: int
    receivers: int
    unknowns: int
    most_elements: int
    elements_at_most: int
    misplaced: float
    distance: float
    basis: str
    nodes: int
    moments: float
    small: float
    eps: float
    lines: int
    sensor_lines: int
    sights: int
    exact_above: float
    sensor_exact_above: float
    cell_eps: float
    lamp_cell_eps: float
    sensor_dome_cell_eps: float
    sun_cell_eps: float

    @classmethod
    def of(cls, scene: SceneData, accuracy: float, basis: str = "bilinear") -> Budget:
        """Tolerances for a scene.

        Elements of constant exitance leave an error that falls with the square of their size; a
        eleventh of the scene's middle dimension gives about 1 % in plain rooms.
        """
        low, high = scene.patches.bounds()
        extent = np.sort(high - low)
        middle = float(extent[1]) if extent[1] > 0.0 else float(extent[2])
        if len(scene.patches) > MAX_ELEMENTS:
            # What is large holds many rooms, or a low one: as fine as the number of elements lets.
            middle = max(float(extent[0]), middle / MANY_ROOMS)
        if any(glazing.glass.diffuse > 0.0 for glazing in scene.glazings):
            basis = "constant"  # what panes scatter is known by elements
        # The error of constant exitance falls with the square of the size, of varying one faster.
        size = 0.25 * middle * (accuracy / 0.02) ** (1.0 / 3.0)
        if basis == "constant":
            size = 0.09 * middle * math.sqrt(accuracy / 0.01)
        elif basis == "corners":
            size = 0.18 * middle * math.sqrt(accuracy / 0.01)
        size = min(max(size, middle / 24.0), 0.6 * middle)
        return cls._with_size(scene, accuracy, size, accuracy, middle, basis)

    @classmethod
    def _with_size(
        cls,
        scene: SceneData,
        accuracy: float,
        size: float,
        misplaced: float,
        distance: float,
        basis: str,
    ) -> Budget:
        patches = scene.patches
        sides = 1 + np.asarray(scene.two_sided, dtype=np.int64)
        most = max(MAX_ELEMENTS, int(PER_PATCH * sides.sum()))
        for _ in range(60):
            counts = divisions(patches, size)
            total = int((counts.prod(axis=1) * sides).sum())
            if total <= most or counts.max() == 1:
                break
            size *= 1.15
        if total > most:
            counts = np.ones_like(counts)
            total = int(sides.sum())
        sensors = sum(len(grid) for grid in scene.sensors)
        large = total > MANY_ELEMENTS
        more = scene_bytes(scene)

        def holds(varying: str) -> bool:
            return has_room(varying_bytes(varying, more) * int((1.0 + MORE) * total) ** 2)

        if basis == "biquadratic" and (total > most_varying(basis) or not holds(basis)):
            basis = "bilinear"
        if basis == "bilinear":
            # Systems of many elements are packed, where factors alone make them.
            many = total > most_varying(basis)
            if not (by_factors_alone(scene) if many else holds(basis)):
                basis = "constant"
        held = most_varying(basis) if basis == "biquadratic" else MAX_ELEMENTS
        nodes = NODES[basis]
        cut = int((counts.prod(axis=1) * sides)[counts.max(axis=1) > 1].sum())
        return cls(
            accuracy=accuracy,
            size=size,
            divisions=counts,
            elements=total,
            receivers=total + (nodes**2 - 1) * (cut if large else total) + sensors,
            unknowns=total if basis == "constant" else total + (nodes**2 - 1) * cut,
            most_elements=max(total, min(held, total + max(MORE_AT_LEAST, int(MORE * total)))),
            elements_at_most=max(total, held),
            misplaced=misplaced,
            distance=distance,
            basis=basis,
            nodes=nodes,
            moments=min(max(0.1 * accuracy, 1e-6), 1e-2),
            small=SMALL_OF_MANY if large else SMALL,
            eps=max(_eps(accuracy), _fine_eps(accuracy)),
            lines=_lines(accuracy, large),
            sensor_lines=int(min(max(SENSOR_LINES / accuracy, SENSOR_LINES_AT_LEAST), 4096)),
            sights=min(
                int(min(max((3.0 / accuracy) ** (4.0 / 3.0), 64), 4096)),
                SIGHTS_OF_MANY if large else 4096,
            ),
            exact_above=(EXACT_OF_MANY if large else EXACT) * accuracy,
            sensor_exact_above=EXACT_AT_SENSORS * accuracy * max(1.0, accuracy / LOOSE),
            cell_eps=0.1 * accuracy,
            lamp_cell_eps=1e-2 * accuracy,
            sensor_dome_cell_eps=2e-3 * accuracy,
            sun_cell_eps=5e-2 * accuracy,
        )

    @property
    def fine_eps(self) -> float:
        """Relative accuracy of unoccluded form factors at sensors, and where nothing is hidden."""
        return _fine_eps(self.accuracy)

    @property
    def is_large(self) -> bool:
        """Whether rows are found with less each, and fewer are found more finely at the end."""
        return self.elements > MANY_ELEMENTS

    def gathered(self, unknowns: int) -> int:
        """Rows of the iterated gather, for so many ``unknowns`` of the mesh.

        A quarter as accurate a run finds a quarter as many: they are to find what nodes missed.
        """
        share = GATHERED
        if not self.is_large:
            share *= max(GATHERED_MORE_BELOW / self.accuracy, 1.0) ** (1.0 / 3.0)
        loose = max(1.0, self.accuracy / PIECES_ACCURACY)
        return int(max(PIECES, share * unknowns) / loose)

    @property
    def left_out(self) -> float:
        """What the iterated gather may leave out though it has rows left, against what it sees."""
        return LEFT_OUT_OF_MANY if self.is_large else 0.0

    @property
    def far(self) -> float:
        """Error of light far from the elements against what the iterated gather changed."""
        return FAR_OF_MANY if self.is_large else FAR

    def unseen(self, left: float) -> float:
        """By how much more light is wrong than the iterated gather changed.

        ``left`` is the worth of what it left out against that of what it looked at.
        """
        return (1.0 + left) * (CHANGE_OF_MANY if self.is_large else 1.0) - 1.0

    @property
    def settings(self) -> dict[str, float | str]:
        """What `Result.settings` records."""
        return {
            "accuracy": self.accuracy,
            "element_size_m": self.size,
            "misplaced_flux": self.misplaced,
            "nodes_per_element": self.nodes**2,
            "basis": self.basis,
            "form_factor_accuracy": self.eps,
            "meridians": self.lines,
            "sensor_meridians": self.sensor_lines,
            "sensor_traced_form_factor": self.sensor_exact_above,
            "lines_of_sight": self.sights,
            "traced_form_factor": self.exact_above,
            "cell_form_factor": self.cell_eps,
            "lamp_cell_form_factor": self.lamp_cell_eps,
            "sensor_sky_cell_form_factor": self.sensor_dome_cell_eps,
            "sun_cell_fraction": self.sun_cell_eps,
        }


def most_varying(basis: str) -> int:
    """Elements up to which light varies over each: those with more nodes, fewer."""
    return VARYING_ELEMENTS * NODES["bilinear"] ** 2 // NODES[basis] ** 2


def scene_bytes(scene: SceneData) -> int:
    """What mirrors and panes of a scene take besides, a pair of receiver and element. [B]"""
    mirrors = any(float(m.mirror_bands.max()) > 0.0 for m in scene.materials)
    return more_bytes(mirrors=mirrors, panes=bool(scene.see_through.any()))


def _eps(accuracy: float) -> float:
    """Relative accuracy of unoccluded form factors between surfaces, but for the loosest runs."""
    return min(max(3e-2 * accuracy, 1e-8), 2e-3)


def _fine_eps(accuracy: float) -> float:
    return FINE_SHARE * _eps(accuracy) * max(1.0, accuracy / LOOSE) ** 2


def _lines(accuracy: float, large: bool) -> int:
    """Meridians about each node.

    Errors of rows are independent, and what reaches a sensor comes from many of them: where there
    are many rows, each needs few.
    """
    return int(min(max(5.0 / accuracy, 48.0), LINES_OF_MANY if large else 1024.0))


def by_factors_alone(scene: SceneData) -> bool:
    """Whether all light between surfaces goes straight, and leaves each of them evenly."""
    straight = not any(np.any(material.mirror) for material in scene.materials)
    even = all(lamp.web is None and lamp.profile is None for lamp in scene.luminaires)
    return straight and even and not scene.glazings
