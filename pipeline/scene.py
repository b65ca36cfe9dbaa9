"""The mutable scene that a script or a scene file builds up."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from patchlight.solver.errors import InputError
from patchlight.solver.model import (
    Air,
    Camera,
    CIESky,
    DaylightFactors,
    Emitter,
    Glass,
    Ground,
    Material,
    Model,
    PatchSet,
    PatchSky,
    PerezSky,
    SceneData,
    Sensors,
    Site,
    Sky,
    Sun,
)
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.patches import affine

from .assigning import Assignment, matched_faces
from .frames import north_matrix, up_matrix
from .grids import SensorGrid
from .patch_models import model_of_patches
from .requirements import Requirement
from .states import State, make_state
from .webs import Known, with_web

COLORS = ("pictures", "reflectance")


@dataclass(slots=True)
class Entry:
    """A model placed in the scene.

    Attributes
    ----------
    name : str
        First segment of its part paths.
    model : Model
        In the axes of its file.
    placement : (4, 4) array
        From the file's axes to the scene. [m]
    kind : {"cad", "patches", "sheet"}
        CAD parts say themselves whether they are solids or sheets.
    given_name : bool
        Whether the user chose the name; patterns then have to start with it.
    scale : float
        Factor already in the model's coordinates, for the record.
    air : set of int
        Rows of parts that are the air of a room.
    placed : Model
        The model in scene coordinates, +normals towards the active side.
    face_rows : tuple of lists
        Rows of the model's faces, by part.
    """

    name: str
    model: Model
    placement: FloatArray
    kind: str = "cad"
    given_name: bool = True
    scale: float = 1.0
    air: set[int] = field(default_factory=set)
    placed: Model = field(init=False)
    face_rows: tuple[list[int], ...] = field(init=False)

    def __post_init__(self) -> None:
        self.face_rows = tuple([] for _ in self.model.parts)
        for row, face in enumerate(self.model.faces):
            self.face_rows[face.part].append(row)
        self._place()

    def declare_air(self, part: int) -> None:
        """Turn a solid inside out: the light is in its volume."""
        if part not in self.air:
            self.air.add(part)
            self._place()

    def _place(self) -> None:
        patches = self.model.patches.moved(self.placement)
        if self.air:
            turned = patches.flipped()
            air = np.isin(patches.part_index, list(self.air))
            patches = PatchSet(
                np.where(air[:, None, None, None], turned.control_points, patches.control_points),
                patches.face_index,
                patches.part_index,
                np.where(air[:, None], turned.edge_index, patches.edge_index),
            )
        self.placed = dataclasses.replace(self.model, patches=patches)


class Scene:
    """Models, lights, sky, sensors and cameras of one simulation.

    Everything is given in scene coordinates: metres, z up, true north ``north_deg`` clockwise from
    +y. `freeze` turns the whole scene, with its sensors and cameras, to world axes (x east, y
    north).

    Parameters
    ----------
    model : Model, optional
        First model, added under its own name.
    up : {"z", "y", "x"}
        Axis that points up in the files of the models.
    north_deg : float
        Direction of true north, clockwise from +y. [deg]
    site : Site, optional
        Place on earth, for the report.
    maintenance_factor : float
        Multiplies the flux of all emitters, not the sky, the sun or the ground. (0, 1]
    colors : {"pictures", "reflectance"}
        Whether colours of the CAD file are for pictures only, or give faces without a Material the
        grey reflectance of their linear luminance, clipped to 0.05 … 0.9.
    """

    def __init__(
        self,
        model: Model | None = None,
        *,
        up: str = "z",
        north_deg: float = 0.0,
        site: Site | None = None,
        maintenance_factor: float = 1.0,
        colors: str = "pictures",
    ) -> None:
        self._up = up_matrix(up)
        self.north = north_matrix(north_deg)
        self.north_deg = float(north_deg)
        if site is not None and not isinstance(site, Site):
            raise InputError(f"Scene.site = {site!r}: expected a Site")
        self.site = site
        if not (math.isfinite(maintenance_factor) and 0.0 < maintenance_factor <= 1.0):
            raise InputError(f"Scene.maintenance_factor = {maintenance_factor}: must lie in (0, 1]")
        self.maintenance_factor = float(maintenance_factor)
        if colors not in COLORS:
            raise InputError(f"Scene.colors = {colors!r}: must be one of {', '.join(COLORS)}")
        self.colors = colors
        self.title: str | None = None
        self.accuracy = 0.01
        #: How it is solved: "default" or "nn93".
        self.method = "default"
        #: How reflected light varies over elements; None leaves the choice to the solver.
        self.basis: str | None = None
        #: Whether no edge of an element may have more than two neighbours.
        self.balanced_mesh = False
        self.entries: dict[str, Entry] = {}
        self.grids: dict[str, SensorGrid | Sensors] = {}
        self.cameras: dict[str, Camera] = {}
        self.assignments: list[Assignment] = []
        self.requirements: list[Requirement] = []
        self.states: dict[str, State] = {}
        self.notes: list[str] = []
        #: Photometric files that were read.
        self.webs: Known = {}
        self._sky: Sky | None = None
        self._sun: Sun | None = None
        self._ground: Ground | None = None
        self._daylight_factor: DaylightFactors | None = None
        if model is not None:
            self.add(model)

    # --- light from outside -------------------------------------------------------------------

    @property
    def sky(self) -> Sky | None:
        """Sky, filling z > 0."""
        return self._sky

    @sky.setter
    def sky(self, value: Sky | None) -> None:
        self._sky = _checked("sky", value, CIESky, PerezSky, PatchSky)

    @property
    def sun(self) -> Sun | None:
        """Disc of the sun."""
        return self._sun

    @sun.setter
    def sun(self, value: Sun | None) -> None:
        self._sun = _checked("sun", value, Sun)

    @property
    def ground(self) -> Ground | None:
        """Lower hemisphere; ``Ground(0.2)`` when there is a sky or a sun and nothing was set."""
        return self._ground

    @ground.setter
    def ground(self, value: Ground | None) -> None:
        self._ground = _checked("ground", value, Ground)

    @property
    def daylight_factor(self) -> DaylightFactors | None:
        """Daylight factors to be found beside the light of the scene; True is those of type 16."""
        return self._daylight_factor

    @daylight_factor.setter
    def daylight_factor(self, value: DaylightFactors | bool | None) -> None:
        if isinstance(value, bool):
            value = DaylightFactors() if value else None
        self._daylight_factor = _checked("daylight_factor", value, DaylightFactors)

    # --- things -------------------------------------------------------------------------------

    def add(
        self,
        thing: Model | PatchSet | SensorGrid | Sensors | Camera,
        name: str | None = None,
        *,
        at: ArrayLike = (0.0, 0.0, 0.0),
        two_sided: bool = False,
    ) -> None:
        """Put something into the scene.

        Parameters
        ----------
        thing : Model, PatchSet, SensorGrid, Sensors or Camera
            PatchSets are active on their +normal side only; their back is opaque and black.
        name : str, optional
            First segment of the part paths of a Model (its own name when not given), the path of a
            PatchSet (required), or another name for a grid or a camera.
        at : (3,) offset or (4, 4) matrix
            Where models and patches go. [m]
        two_sided : bool
            A PatchSet that reflects on both sides, like a sheet.

        Raises
        ------
        InputError
            For a name that is taken, and for options that the thing does not have.
        """
        if isinstance(thing, Model | PatchSet):
            self._add_geometry(thing, name, affine(at), two_sided)
            return
        if not np.array_equal(np.asarray(at), (0.0, 0.0, 0.0)) or two_sided:
            raise InputError(
                f"Scene.add: at and two_sided are for models and patches, not {thing!r}"
            )
        if isinstance(thing, Camera):
            camera = thing if name is None else dataclasses.replace(thing, name=name)
            _check_name("camera", camera.name)
            _add_new(self.cameras, "camera", camera.name, camera)
        elif isinstance(thing, SensorGrid | Sensors):
            key = thing.name if name is None else name
            _check_name("sensors", key)
            _add_new(self.grids, "sensors", key, thing)
        else:
            raise InputError(
                f"Scene.add: {type(thing).__name__}: expected a Model, PatchSet, SensorGrid, "
                "Sensors or Camera"
            )

    def _add_geometry(
        self, thing: Model | PatchSet, name: str | None, at: FloatArray, two_sided: bool
    ) -> None:
        if isinstance(thing, PatchSet):
            if not name:
                raise InputError("Scene.add: a PatchSet needs a name")
            kind = "sheet" if two_sided else "patches"
            entry = Entry(name, model_of_patches(thing, name), at, kind)
        elif two_sided:
            raise InputError("Scene.add: two_sided is for a PatchSet; sheets of a model have it")
        else:
            placement = at @ self._up
            entry = Entry(name or thing.name, thing, placement, given_name=name is not None)
        self.add_entry(entry)

    def add_entry(self, entry: Entry) -> None:
        """Put a placed model into the scene."""
        if "*" in entry.name or "?" in entry.name:
            raise InputError(f"Scene.add: name {entry.name!r}: must not contain * or ?")
        _add_new(self.entries, "model", entry.name, entry)

    def update(self, model: Model, name: str | None = None) -> None:
        """Replace the model of the same name by a new shape; assignments and place are kept.

        Raises
        ------
        InputError
            If it is no Model, if no model has the name, or an assignment matches nothing of the new
            shape.
        """
        if not isinstance(model, Model):
            raise InputError(
                f"Scene.update: a {type(model).__name__} is no Model; use from_cadquery(…) or "
                "read_step(…) first"
            )
        key = name or model.name
        if key not in self.entries or self.entries[key].kind != "cad":
            have = ", ".join(k for k, e in self.entries.items() if e.kind == "cad") or "none"
            raise InputError(f"Scene.update: no model named {key!r}; models: {have}")
        old = self.entries[key]
        self.entries[key] = Entry(key, model, old.placement, old.kind, old.given_name, old.scale)
        try:
            for assignment in self.assignments:
                self._declare_air(assignment)
            for assignment in self.assignments:
                matched_faces(self.entries, assignment)
        except InputError:
            self.entries[key] = old
            raise

    def assign(
        self,
        pattern: str,
        what: Material | Glass | Emitter | Air,
        *,
        faces: str | None = None,
        layer: str | None = None,
        color: str | None = None,
    ) -> int:
        """Give parts or faces a material, make them glass, lamps, or the air of a room.

        A face is opaque, of a Material, or it is Glass; Emitter is a slot of its own. The last
        assignment wins in each. A solid is glass as a whole.

        Parameters
        ----------
        pattern : str
            Part path: ``*`` stays in a segment, ``**`` crosses; without ``/`` it is compared with
            the last segment of every path.
        what : Material, Glass, Emitter or Air
            `Emitter.flux_lm` is the flux of each matched part; a photometric file is read now.
        faces : str, optional
            ``up``, ``down``, ``vertical``, ``#7``, a name or colour of a face, or a CadQuery
            selector.
        layer, color : str, optional
            Narrow the match to a CAD layer or a colour such as ``"#ffcc00"``.

        Returns
        -------
        int
            Number of faces.

        Raises
        ------
        InputError
            If nothing matches; the message names the three nearest paths. If a photometric file is
            not sound; it names file and line.
        """
        if not isinstance(what, Material | Glass | Emitter | Air):
            kind = type(what).__name__
            raise InputError(
                f"assign {pattern!r}: {kind}: expected a Material, Glass, Emitter or Air"
            )
        if not (faces is None or isinstance(faces, str)):
            raise InputError(
                f'assign {pattern!r}: faces = {faces!r}: expected a selector such as "up" or "#3"'
            )
        if isinstance(what, Emitter):
            what = with_web(what, self.webs)
        assignment = Assignment(pattern, what, faces, layer, color, frozenset(self.entries))
        count = sum(len(match.rows) for match in matched_faces(self.entries, assignment))
        self._declare_air(assignment)
        self.assignments.append(assignment)
        return count

    def _declare_air(self, assignment: Assignment) -> None:
        if isinstance(assignment.what, Air):
            for match in matched_faces(self.entries, assignment):
                self.entries[match.entry].declare_air(match.part)

    def require(
        self, sensors: str, metric: str, *, min: float | None = None, max: float | None = None
    ) -> None:
        """Ask that ``metric`` of the grid ``sensors`` lies within bounds, in the metric's unit.

        Raises
        ------
        InputError
            For a metric that is not computed, and bounds that nothing can meet. A grid that there
            is not is an error of `freeze`: it may be added later.
        """
        self.requirements.append(Requirement(sensors, metric, min, max))

    def add_state(
        self,
        name: str,
        *,
        present: str | Iterable[str] | None = None,
        absent: str | Iterable[str] | None = None,
        group: str | None = None,
    ) -> None:
        """Name a set of parts that are there or not, such as blinds, for `simulate_year`.

        A run of the scene itself has all its parts. With states each of these is solved for the
        year, the first one being that of nobody having closed anything. States of several window
        groups are solved one group at a time, the others being in their first state.

        Parameters
        ----------
        name : str
            Of the state.
        present : str or several, optional
            Patterns of parts that are there in this state, and in all others only if these name
            them too.
        absent : str or several, optional
            Patterns of parts that are not there in this state.
        group : str, optional
            Window group whose blinds these are, in a scene with several that are moved apart.

        Raises
        ------
        InputError
            For a name that is taken. Patterns that match nothing are errors of `freeze`: parts
            may be added later.
        """
        _add_new(self.states, "state", name, make_state(name, present, absent, group))

    def freeze(self, *, state: str | Iterable[str] | None = None) -> SceneData:
        """The scene as the solver sees it: world axes, SI units, sensors resolved.

        With all its parts, or with those of a ``state``, or of one of each window group.

        Raises
        ------
        InputError
            Naming all that is wrong, where it does not hinder looking on.
        """
        from .freezing import frozen_scene

        return frozen_scene(self, (state,) if isinstance(state, str) else tuple(state or ()))


def _checked(name: str, value: Any, *kinds: type) -> Any:
    if value is not None and not isinstance(value, kinds):
        names = " or ".join(kind.__name__ for kind in kinds)
        raise InputError(f"Scene.{name} = {value!r}: expected a {names}")
    return value


def _add_new(table: dict[str, Any], kind: str, name: str, value: Any) -> None:
    if name in table:
        raise InputError(f"Scene.add: a {kind} named {name!r} exists already; give another name")
    table[name] = value


def _check_name(kind: str, name: str) -> None:
    """Names of grids and cameras become file names."""
    if not name or name.startswith(".") or any(c in name for c in '/\\:*?"<>|\0\n'):
        raise InputError(f"{kind} {name!r}: the name becomes a file name; use letters and digits")
