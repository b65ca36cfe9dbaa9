"""Pictures of a solved field by all cameras of its scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .budget import Budget
from .iterated import Finer
from .model.result import CameraImage, luminous
from .solved_field import Field
from .sun_disc import is_up

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
        # What mirrors throw of it stays with the elements.
        direct = finer.light.sun
        if scene.sun is not None and direct is not None and field.sees_out and is_up(scene.sun):
            sun = SunInPictures(scene, solver.open_sky, bands=solver.bands)
            # Panes keep what they scatter.
            own = field.surfaces.elements.patch_index < scene.opaque_count
            direct = np.where(own[:, None], direct, 0.0)
            reflected = reflected - field.surfaces.reflectance * direct
            irradiance = irradiance - luminous(direct)
        renderer = Renderer(
            scene,
            field.surfaces.elements,
            reflected=reflected,
            emitted=field.surfaces.diffuse_at_corners,
            irradiance=irradiance,
            webs=solver.webs.lamps(budget.accuracy),
            second=solver.highlights.for_pictures(field.surfaces, finer, budget),
            sun=sun,
        )
        for k, camera in enumerate(scene.cameras):
            images[camera.name] = renderer.render(camera)
            tell(k + 1, len(scene.cameras))
    return images
