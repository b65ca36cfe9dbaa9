"""Pictures of a solved field by all cameras of its scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .budget import Budget
from .iterated import Finer
from .model.result import CameraImage
from .solved_field import Field

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

    images = {}
    with stages.run("images") as tell:
        renderer = Renderer(
            scene,
            field.surfaces.elements,
            reflected=finer.reflected,
            emitted=field.surfaces.diffuse_at_corners,
            irradiance=finer.light.luminous(),
            webs=solver.webs.lamps(budget.accuracy),
            second=solver.highlights.for_pictures(field.surfaces, finer, budget),
        )
        for k, camera in enumerate(scene.cameras):
            images[camera.name] = renderer.render(camera)
            tell(k + 1, len(scene.cameras))
    return images
