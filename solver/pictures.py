"""Pictures of a solved field by all cameras of its scene."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .budget import Budget
from .iterated import Finer
from .model.bands import in_primaries
from .model.result import CameraImage, luminous
from .solved_field import Field
from .sun_disc import is_up
from .surfaces import Surfaces

if TYPE_CHECKING:
    from .field import FieldSolver


def render_all(
    field: Field, finer: Finer, solver: FieldSolver, budget: Budget
) -> dict[str, CameraImage]:
    """Pictures by the cameras of a scene, by name."""
    scene, stages = solver.scene, solver.stages
    if not scene.cameras:
        return {}
    from .camera import Renderer
    from .sun_pictures import SunInPictures

    images = {}
    with stages.run("images") as tell:
        reflected, irradiance, sun = finer.reflected, finer.light.luminous(), None
        surfaces, bands = field.surfaces, min(solver.bands, 3)
        # What mirrors throw of it stays with the elements.
        direct = finer.light.sun
        if scene.sun is not None and direct is not None and field.sees_out and is_up(scene.sun):
            sun = SunInPictures(scene, solver.open_sky, bands=bands)
            # Panes keep what they scatter.
            own = surfaces.elements.patch_index < scene.opaque_count
            direct = np.where(own[:, None], direct, 0.0)
            reflected = reflected - surfaces.reflectance * direct
            irradiance = irradiance - luminous(direct)
        if solver.bands > bands:  # of twenty bands pictures show the primaries
            surfaces = Surfaces.of(scene, surfaces.elements, bands)
            reflected = in_primaries(reflected)
            sent = {group: in_primaries(values) for group, values in finer.sent.items()}
            finer = replace(finer, sent=sent)
        renderer = Renderer(
            scene,
            surfaces.elements,
            reflected=reflected,
            emitted=surfaces.diffuse_at_corners,
            irradiance=irradiance,
            webs=solver.webs.lamps(budget.accuracy),
            second=solver.highlights.for_pictures(surfaces, finer, budget),
            sun=sun,
        )
        for k, camera in enumerate(scene.cameras):
            images[camera.name] = renderer.render(camera)
            tell(k + 1, len(scene.cameras))
    return images
