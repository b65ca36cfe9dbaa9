"""Uneven lamps in mirrors, in lobes and in pictures of glossy lamps."""

import dataclasses
import math

import numpy as np
import pytest
from patchlight.solver.model import Camera, Material
from patchlight.solver.model.profiles import Profile, checked_profile
from patchlight.solver.simulation import solve

from .fixtures_light import area_rule, ceiling, grid, rectangle, setup
from .fixtures_shine import BLACK, with_materials

DOWN = (0.0, 0.0, -1.0)
FLOOR = rectangle((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
LAMP = ceiling(-0.5, 0.5, -0.4, 0.4, 1.5)


def steep(p):
    return np.exp(4.0 * p[:, 0]) * (1.2 + np.sin(3.0 * p[:, 1]))


def tilted(p):
    return 1.05 + 2.0 * p[:, 0]


def lit(patches, materials, lamp=1, profile=steep, **more):
    """Scene of bodies, one of them an uneven lamp of mean exitance 1000 lm/m²."""
    made = with_materials(setup(*patches), materials, lamps=[(lamp, "lamp", 1000.0)], **more)
    own = np.flatnonzero((made.luminaire_index == 0).any(axis=1))
    told = Profile.of(checked_profile(profile), part="lamp", placement=np.eye(4), patches=own)
    return dataclasses.replace(
        made, luminaires=(dataclasses.replace(made.luminaires[0], profile=told),)
    )


def exitance(lamp, order=48, profile=steep):
    """Points, normals, areas and exitance of an uneven lamp."""
    at, normals, areas = area_rule(lamp, order)
    level = profile(at)
    return at, normals, areas, 1000.0 * areas.sum() * level / (level @ areas)


def lux(lamp, points):
    """Illuminance of upward points, with nothing in the way."""
    at, normals, areas, level = exitance(lamp)
    ray = at[None] - np.asarray(points)[:, None]
    square = (ray**2).sum(axis=2)
    kernel = np.maximum(ray[..., 2], 0) * np.maximum(-(ray * normals).sum(axis=2), 0)
    return (kernel / (math.pi * square**2)) @ (areas * level)


def test_a_mirror_shows_an_uneven_lamp():
    points = np.array([(0.6, 0.2, 0.5), (-0.7, -0.3, 0.8), (0.1, 0.9, 0.3)])
    made = lit([FLOOR, LAMP], [Material(0.0, mirror=0.8), BLACK], sensors=[grid("g", points, DOWN)])
    found = solve(made, accuracy=0.02).sensors["g"]
    exact = 0.8 * lux(LAMP, points * (1, 1, -1))
    # A tenth of the accuracy: polynomials and form factors; the mean alone is off by a third.
    assert found.components["lamp.direct"] == pytest.approx(exact, rel=2e-3)
    assert (np.abs(found.illuminance_lx - exact) <= found.error_lx).all()


def test_a_mirror_that_shows_a_part_of_an_uneven_lamp_says_what_it_does_not_know():
    mirror = rectangle((-0.3, -2, 0), (2, -2, 0), (2, 2, 0), (-0.3, 2, 0))
    points = np.array([(-0.1, 0.0, 0.5), (0.3, 0.2, 0.8)])
    made = lit(
        [mirror, LAMP], [Material(0.0, mirror=0.8), BLACK], sensors=[grid("g", points, DOWN)]
    )
    found = solve(made, accuracy=0.05).sensors["g"]
    at, normals, areas, level = exitance(LAMP, 200)
    exact = []
    for x in points * (1, 1, -1):
        ray = at - x
        way = x + ray * (-x[2] / ray[:, 2])[:, None]
        kernel = ray[:, 2] * -(ray * normals).sum(axis=1) / (ray**2).sum(axis=1) ** 2
        exact.append(0.8 / math.pi * ((way[:, 0] > -0.3) * kernel * areas * level).sum())
    assert (np.abs(found.illuminance_lx - exact) <= found.error_lx).all()


@pytest.mark.parametrize("exponent", [10.0, 200.0])
def test_a_lobe_shows_where_a_lamp_is_bright(exponent):
    """A glossy floor seen straight down, off the middle of the lamp, by a sum over the lamp."""
    eye = (0.3, 0.1, 1.0)
    made = lit(
        [FLOOR, LAMP],
        [Material(0.0, specular=0.4, exponent=exponent), BLACK],
        profile=tilted,  # which polynomials tell on a single element
        cameras=(Camera(eye, (0.3, 0.1, 0), "c", up=(0, 1, 0), fov_deg=1.0, size=(3, 3)),),
    )
    found = solve(made, accuracy=0.3).images["c"].rgb[1, 1]
    at, _, areas, level = exitance(LAMP, profile=tilted)
    ray = at - (0.3, 0.1, 0.0)
    square = (ray**2).sum(axis=1)
    cosine = ray[:, 2] / np.sqrt(square)
    lobe = (exponent + 2.0) / (2.0 * math.pi) * cosine ** (exponent + 2.0) / square
    exact = 0.4 / math.pi * (lobe * areas * level).sum()
    # Pictures allow lamps a tenth, parts change by a tenth of the brightest; both do better.
    assert found == pytest.approx(np.full(3, exact), rel=2e-2)


def test_an_uneven_glossy_lamp_alone_looks_as_it_shines():
    """No light falls on it: there is nothing to reflect, by whatever lobe."""
    camera = Camera((0.3, 0.2, 0.2), (0.3, 0.2, 1.5), "c", up=(0, 1, 0), fov_deg=10, size=(9, 9))
    dull, glossy = (
        solve(lit([LAMP], [made], lamp=0, cameras=(camera,)), accuracy=0.05).images["c"].rgb
        for made in (BLACK, Material(0.1, specular=0.5, exponent=20.0))
    )
    assert dull.max() > 1.3 * dull.min() > 0.0
    np.testing.assert_allclose(glossy, dull, rtol=1e-9)
