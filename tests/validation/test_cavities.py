"""Sphere cavities, lamps of a hundred lumens, and Ward's box with and without a mirror."""

import dataclasses

import numpy as np
import pytest
from patchlight.pipeline import (
    Emitter,
    Material,
    PatchSet,
    Photometry,
    Scene,
    SensorGrid,
    simulate,
)
from patchlight.solver.model.profiles import Profile, checked_profile

from ..solver.fixtures_light import Body, scene, setup

SPHERE = Body(PatchSet.sphere((0, 0, 0), 1.0, inward=True))


def lit_sphere(rho, profile=None):
    """A cavity of which one octant shines, or all of it as ``profile`` says."""
    data = scene(setup(SPHERE), rho=rho, lamps=[(0, "wall", 100.0)])
    if profile is None:
        index = data.luminaire_index.copy()
        index[1:] = -1
        return dataclasses.replace(data, luminaire_index=index)
    (lamp,) = data.luminaires
    shape = Profile.of(
        checked_profile(profile), part=lamp.part, placement=np.eye(4), patches=np.arange(8)
    )
    return dataclasses.replace(data, luminaires=(dataclasses.replace(lamp, profile=shape),))


@pytest.mark.parametrize("rho", [0.2, 0.5, 0.8, 0.95, 0.99])
def test_indirect_light_in_a_sphere_is_even(rho):
    """One lit octant of exitance 100: E_direct = 12.5 and E_indirect = ρ E_direct / (1 − ρ)."""
    result = simulate(lit_sphere(rho), accuracy=0.03)
    (name,) = [name for name in result.components if name.endswith(".indirect")]
    expected = 12.5 * rho / (1.0 - rho)
    np.testing.assert_allclose(result.components[name], expected, rtol=1e-4)


def unevenness(accuracy):
    """Of the light of a wall that shines from 0.14 to 7.4 times as much; closed form: none."""
    result = simulate(lit_sphere(0.5, lambda p: np.exp(2.0 * p[:, 0])), accuracy=accuracy)
    return max(float(np.abs(v / 100.0 - 1.0).max()) for v in result.components.values())


@pytest.mark.slow
def test_light_of_an_uneven_wall_converges():
    """Every piece of the wall is seen by its area, whatever it shines: to 1e-6 at 1e-3."""
    found = [unevenness(accuracy) for accuracy in (0.03, 0.01, 0.003, 0.001)]
    # Below the rounding of factors, 6e-8, nothing is to converge.
    assert all(b <= 1.2 * max(a, 6e-8) for a, b in zip(found, found[1:], strict=False))
    # Unoccluded factors are asked for to 1.5e-6, at worst.
    assert found[-1] <= 1e-6, found


GAMMA = np.arange(0.0, 181.0, 1.0)


@pytest.mark.parametrize("lamp", ["panel", "web", "ball"])
def test_a_hundred_lumens_at_one_metre(lamp):
    """Φ / (π d²) under a small panel and under its photometric file, Φ / (4 π d²) under a ball."""
    cosine = 100.0 / np.pi * np.maximum(np.cos(np.radians(GAMMA)), 0.0)
    panel = PatchSet.disk((0, 0, 1), 1e-3, (0, 0, -1))
    patches, photometry, expected = {
        "panel": (panel, None, 100 / np.pi),
        "web": (panel, Photometry([0.0, 360.0], GAMMA, [cosine, cosine]), 100 / np.pi),
        "ball": (PatchSet.sphere((0, 0, 1), 1e-3), None, 25 / np.pi),
    }[lamp]
    made = Scene()
    made.add(patches, "lamp")
    made.assign("lamp", Material(0.0))
    made.assign("lamp", Emitter(100.0, photometry=photometry))
    made.add(SensorGrid(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), name="grid"))
    found = simulate(made).sensors["grid"].illuminance_lx[0]
    # The size of the lamps leaves 1e-6; a web in steps of 1° has 5e-5 less flux than a cosine.
    assert found == pytest.approx(expected, rel=1e-4)
    assert found == pytest.approx({"ball": 7.958}.get(lamp, 31.83), rel=1e-3)


#: Radiosity of the floor [W/m²] at x and y of `references.WARD_X`, `WARD_Y`; panel of 31.416 W/m².
WARD_FLOOR = np.array(
    [
        [0.01019, 0.01127, 0.01220, 0.01297, 0.01354, 0.01385],
        [0.01367, 0.01516, 0.01662, 0.01795, 0.01898, 0.01955],
        [0.02308, 0.02681, 0.03106, 0.03548, 0.03926, 0.04146],
        [0.03584, 0.04428, 0.05542, 0.06855, 0.08104, 0.08889],
    ]
)


@pytest.mark.parametrize("name", ["Ward", "Ward_mirror"])
def test_wards_box(name):
    """Ceiling and floor of a box of 10 x 6 x 3 m; then with a mirror of 75 % for its far wall."""
    import references
    import truth_room

    one = references.reference(name)
    data = one.scene()
    room = {"Ward": references.WARD, "Ward_mirror": references.WARD_MIRROR}[name]
    grid = data.sensors[0]
    # On two meshes good to 2e-4.
    truth = truth_room.irradiance(room, grid.points, grid.normals, quick=True)
    found = simulate(data, accuracy=0.03).sensors["sensors"].illuminance_lx
    np.testing.assert_allclose(found, truth, rtol=2e-3)
    assert np.sqrt(np.mean((found / truth - 1.0) ** 2)) <= 1e-3
    if name == "Ward":
        floor = 0.3 * 10.0 * found[23:].reshape(4, 6)
        # Good to 0.1 %, and rounded to five digits behind the point.
        np.testing.assert_allclose(floor, WARD_FLOOR, rtol=1e-3, atol=5e-6)
