"""Sky that a flat mirror shows to sensors, beside a window."""

import numpy as np
import pytest
from patchlight.pipeline import simulate


@pytest.mark.parametrize("name", ["D2", "D2_clear"])
def test_sky_in_a_mirror_is_that_of_the_image(name):
    """A side wall that mirrors shows the window from the image of each sensor, x' = 8 m − x."""
    import truth_window
    from cases.d2_window import CASE, CLEAR, CLEAR_ROOM, ROOM
    from references import with_mirror
    from tools.ours import scene_data

    case, room = {"D2": (CASE, ROOM), "D2_clear": (CLEAR, CLEAR_ROOM)}[name]
    points, normals = case.points, case.normals
    images = points * (-1.0, 1.0, 1.0) + (2.0 * room.size[0], 0.0, 0.0)
    direct, mirrored = (truth_window.direct(room, p, normals) for p in (points, images))
    # The wall at x = 4 m is the fourth body.
    made = with_mirror(scene_data(case), 3, 0.75)
    found = simulate(made, accuracy=0.3).sensors["sensors"].components["sky.direct"]
    # As exact as sky that is seen straight, whatever is asked for: bounds of 1e-6 are stated.
    np.testing.assert_allclose(found, direct + 0.75 * mirrored, rtol=2e-6)
