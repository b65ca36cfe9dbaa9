"""Pictures: uniform fields, known luminances, smoothness, sky, sun and ground, projections."""

import dataclasses
import math

import numpy as np
import pytest
from patchlight.solver.camera import Renderer, render
from patchlight.solver.errors import InputError
from patchlight.solver.model import (
    BLACK,
    Camera,
    CIESky,
    Elements,
    Ground,
    Material,
    PatchSet,
    SceneData,
    SceneFace,
    ScenePart,
    Sun,
)
from patchlight.solver.model.bands import LUMINANCE_WEIGHTS
from patchlight.solver.model.bezier import areas, sub_net
from patchlight.solver.model.sky import direction
from patchlight.solver.skies import ground_luminance, luminance, sun_luminance
from patchlight.solver.spectra import cct_to_rgb
from patchlight.solver.vertex_values import corner_values


def scene_of(patches, **more):
    n = len(patches)
    settings = dict(
        two_sided=np.zeros(n, dtype=bool),
        closed=np.zeros(n, dtype=bool),
        material_index=np.column_stack([np.zeros(n, dtype=int), np.full(n, BLACK)]),
        luminaire_index=np.full((n, 2), BLACK),
        parts=(ScenePart("room", "room", "patches"),),
        faces=tuple(SceneFace(0, k + 1, "plane") for k in range(n)),
        materials=(Material(),),
    )
    return SceneData(patches=patches, **(settings | more))


def elements_of(patches, k=2, cells=None, sides=(0,)):
    """Each patch in k x k elements, or in the boxes ``cells``, on the given sides."""
    if cells is None:
        t = np.linspace(0.0, 1.0, k + 1)
        cells = [(t[i], t[i + 1], t[j], t[j + 1]) for i in range(k) for j in range(k)]
    nets, index, side, boxes = [], [], [], []
    for p, net in enumerate(patches.control_points):
        for s in sides:
            for cell in cells:
                own = sub_net(net, *cell)
                nets.append(own[::-1] if s else own)
                index.append(p)
                side.append(s)
                boxes.append(cell)
    nets = np.array(nets)
    area, n = areas(nets), len(nets)
    centers = PatchSet(nets).evaluate(0.5, 0.5)[:, None]
    return Elements(
        nets, index, side, boxes, centers, centers, area[:, None], area, np.zeros((n, 1), bool)
    )


def means_of(elements, function):
    """Mean of a function of (u, v) that is linear in both, per element: (n, 1)."""
    b = elements.boxes
    return function(0.5 * (b[:, 0] + b[:, 1]), 0.5 * (b[:, 2] + b[:, 3]))[:, None]


def test_furnace_is_uniform():
    body = PatchSet.concatenated(
        PatchSet.box((4, 3, 2.5), inward=True),
        PatchSet.sphere((0.5, 0.3, -0.2), 0.4),
        PatchSet.torus((-1, 0.5, 0), (1, 1, 1), 0.4, 0.15),
    )
    scene = scene_of(body)
    elements = elements_of(body, 3)
    n = len(elements)
    reflected, emitted = np.full((n, 1), 2.0), np.full((n, 1), 1.0)
    camera = Camera((-1.6, -1.2, 0.3), (0.5, 0.3, -0.2), name="c", fov_deg=90, size=(160, 120))
    image = render(
        scene, elements, camera,
        reflected=reflected, emitted=emitted, irradiance=np.full(n, 7.0),
    )  # fmt: skip
    assert image.rgb == pytest.approx(np.full((120, 160, 3), 3.0 / math.pi), rel=1e-13)
    assert image.illuminance_lx == pytest.approx(7.0, rel=1e-13)
    assert np.isfinite(image.depth_m).all() and (image.part_index == 0).all()
    assert np.linalg.norm(image.normals, axis=-1) == pytest.approx(1.0, abs=1e-12)
    # Normals look at the viewer.
    _, rays = camera.rays()
    assert (np.einsum("hwk,hwk->hw", rays, image.normals) < 1e-9).all()


@pytest.mark.parametrize("k", [2, 3, 4])
def test_linear_field_is_shown_exactly_up_to_the_rim(k):
    floor = PatchSet.from_bilinear([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]])
    elements = elements_of(floor, k)
    camera = Camera(
        (0, 0, 1), (0, 0, 0), name="down", up=(0, 1, 0), fov_deg=90, size=(50, 50)
    )  # fmt: skip
    reflected = means_of(elements, lambda u, v: 1.0 + 2.0 * u + v)
    image = render(
        scene_of(floor), elements, camera,
        reflected=reflected, emitted=np.zeros_like(reflected), irradiance=2.0 * reflected[:, 0],
    )  # fmt: skip
    # A square view of 90 degrees from height 1 sees exactly the square [-1, 1]².
    x = (np.arange(50) + 0.5) / 50
    u, v = x[None, :], x[::-1, None]
    assert image.luminance_cd_m2 == pytest.approx((1 + 2 * u + v) / math.pi, rel=1e-12)
    assert image.illuminance_lx == pytest.approx(2 * (1 + 2 * u + v), rel=1e-12)
    assert image.depth_m == pytest.approx(
        np.sqrt(1 + (2 * u - 1) ** 2 + (2 * v - 1) ** 2), rel=1e-13
    )


def test_hanging_corners_and_welded_patches_show_no_step():
    # Two patches of one face; the left one is refined in one corner.
    left = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    right = [(1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0)]
    pair = PatchSet.from_bilinear([left, right])
    pair = PatchSet(pair.control_points, face_index=[0, 0])
    quarter = [(0, 0.5, 0.5, 1), (0.5, 1, 0, 0.5), (0.5, 1, 0.5, 1)]
    cells = quarter + [
        (0.25 * i, 0.25 * i + 0.25, 0.25 * j, 0.25 * j + 0.25) for i in (0, 1) for j in (0, 1)
    ]
    scene, elements = scene_of(pair, faces=(SceneFace(0, 1, "plane"),)), elements_of(pair, 2, cells)
    rng = np.random.default_rng(1)
    values = rng.uniform(1.0, 2.0, size=(len(elements), 1))
    corners = corner_values(scene, elements, values)

    def at(patch, u, v):
        """All values that elements of a patch give to a place."""
        found = []
        for e in np.flatnonzero(elements.patch_index == patch):
            u0, u1, v0, v1 = elements.boxes[e]
            if u0 <= u <= u1 and v0 <= v <= v1:
                x, y = (u - u0) / (u1 - u0), (v - v0) / (v1 - v0)
                weights = [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y]
                found.append(float(np.dot(weights, corners[e, :, 0])))
        return found

    for place in ((0.5, 0.1), (0.5, 0.25), (0.3, 0.5), (0.5, 0.5), (0.25, 0.25), (0.7, 0.5)):
        found = at(0, *place)
        assert len(found) >= 2
        assert found == pytest.approx(found[:1] * len(found), rel=1e-13)
    for v in (0.0, 0.25, 0.5, 0.9, 1.0):
        assert at(0, 1.0, v)[0] == pytest.approx(at(1, 0.0, v)[0], rel=1e-13)
    # Another material is another surface.
    split = scene_of(
        pair,
        faces=(SceneFace(0, 1, "plane"),),
        material_index=[(0, BLACK), (1, BLACK)],
        materials=(Material(0.5), Material(0.2)),
    )
    corners = corner_values(split, elements, np.where(elements.patch_index == 0, 1.0, 5.0)[:, None])
    assert np.unique(np.round(corners, 12)).tolist() == [1.0, 5.0]


def test_an_edge_of_shadow_between_elements_stays_sharp():
    """Bright and dark elements keep their own light, also where smaller ones hang on larger."""
    floor = PatchSet.from_bilinear([[(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]])
    small = [
        (0.5 + 0.25 * i, 0.75 + 0.25 * i, 0.5 * j, 0.5 * j + 0.5) for i in (0, 1) for j in (0, 1)
    ]
    elements = elements_of(floor, 1, [(0, 0.5, 0, 1), *small])
    values = np.array([80.0, 2.0, 2.0, 2.0, 2.0])[:, None]
    corners = corner_values(scene_of(floor), elements, values)[..., 0]
    assert corners == pytest.approx(np.repeat(values, 4, axis=1))
    # No light crosses the edge; strips one element wide keep their means.
    cells = [(0.25 * i, 0.25 * i + 0.25, 0, 1) for i in range(4)]
    elements = elements_of(floor, 1, cells)
    values = np.array([60.0, 70.0, 2.0, 3.0])[:, None]
    corners = corner_values(scene_of(floor), elements, values)[..., 0]
    assert corners[1, 1] == pytest.approx(70.0) and corners[2, 0] == pytest.approx(2.0)
    # Light that varies twofold from one to the next is one surface.
    values = np.array([10.0, 20.0, 40.0, 80.0])[:, None]
    corners = corner_values(scene_of(floor), elements, values)[..., 0]
    np.testing.assert_allclose(corners[:-1, 1], corners[1:, 0])


def test_buried_elements_do_not_darken_their_neighbours():
    floor = PatchSet.from_bilinear([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]])
    elements = elements_of(floor, 4)
    covered = elements.boxes[:, 0] >= 0.75
    elements = dataclasses.replace(elements, buried=covered[:, None])
    values = np.where(covered[:, None], 0.0, means_of(elements, lambda u, v: 1.0 + u))
    corners = corner_values(scene_of(floor), elements, values)[~covered, :, 0]
    u = elements.boxes[~covered][:, [0, 1, 1, 0]]
    assert corners == pytest.approx(1.0 + u, rel=1e-13)


def test_emission_is_not_smeared():
    floor = PatchSet.from_bilinear(
        [
            [(-1, -1, 0), (0, -1, 0), (0, 1, 0), (-1, 1, 0)],
            [(0, -1, 0), (1, -1, 0), (1, 1, 0), (0, 1, 0)],
        ]
    )
    elements = elements_of(floor, 2)
    emitted = np.where(elements.patch_index == 1, 100.0, 0.0)[:, None]
    camera = Camera((0, 0, 1), (0, 0, 0), name="d", up=(0, 1, 0), fov_deg=90, size=(40, 40))
    image = render(
        scene_of(floor), elements, camera,
        reflected=np.zeros_like(emitted), emitted=emitted, irradiance=np.zeros(len(elements)),
    )  # fmt: skip
    assert (image.luminance_cd_m2[:, :20] == 0.0).all()
    assert image.luminance_cd_m2[:, 20:] == pytest.approx(100.0 / math.pi, rel=1e-14)


def test_sides_without_elements_are_black():
    quad = PatchSet.from_bilinear([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]])
    for sides, expected in (((0,), (1.0, 0.0)), ((1,), (0.0, 1.0)), ((0, 1), (1.0, 1.0))):
        elements = elements_of(quad, 1, sides=sides)
        reflected = np.full((len(elements), 1), math.pi)
        renderer = Renderer(
            scene_of(quad), elements,
            reflected=reflected, emitted=0.0 * reflected, irradiance=reflected[:, 0],
        )  # fmt: skip
        for height, value in zip((1.0, -1.0), expected, strict=False):
            camera = Camera((0.1, 0, height), (0, 0, 0), name="x", up=(0, 1, 0), size=(8, 8))
            image = renderer.render(camera)
            assert image.luminance_cd_m2 == pytest.approx(value, rel=1e-14)
            assert image.normals[..., 2] == pytest.approx(math.copysign(1.0, height))


def test_sky_sun_and_ground():
    tiny = PatchSet.box((0.01, 0.01, 0.01), (0, 0, 500))
    sky = CIESky(12, sun_altitude_deg=30, sun_azimuth_deg=90, diffuse_illuminance_lx=9000)
    sun = Sun(30.0, 90.0, normal_illuminance_lx=70000.0, angular_radius_arcmin=60.0)
    scene = scene_of(tiny, sky=sky, sun=sun, ground=Ground(0.2))
    elements = elements_of(tiny, 1)
    grey, rgb = np.zeros((6, 1)), np.zeros((6, 3))
    target = direction(30.0, 90.0)
    camera = Camera((0, 0, 0), target, name="sun", fov_deg=20, size=(161, 161))
    image = render(
        scene, elements, camera, reflected=grey, emitted=grey, irradiance=np.zeros(6)
    )  # fmt: skip
    _, rays = camera.rays()
    middle = image.luminance_cd_m2[80, 80]
    assert middle == pytest.approx(sun_luminance(sun) + luminance(sky, target), rel=1e-12)
    assert image.luminance_cd_m2[0, 80] == pytest.approx(luminance(sky, rays[0, 80]), rel=1e-12)
    assert (image.part_index == -1).all() and np.isnan(image.depth_m).all()
    assert np.isnan(image.illuminance_lx).all() and np.isnan(image.normals).all()
    # The disc's area: pixels at its rim count by quarters.
    solid = image.luminance_cd_m2 / sun_luminance(sun)
    pixel = (2 * math.tan(math.radians(10)) / 161) ** 2 * rays.dot(target) ** 3
    assert (solid * pixel)[60:101, 60:101].sum() == pytest.approx(
        2 * math.pi * (1 - math.cos(math.radians(1.0))), rel=0.01
    )
    down = Camera((0, 0, 0), (0, 1, -1), name="down", size=(4, 4), fov_deg=20)
    image = render(scene, elements, down, reflected=rgb, emitted=rgb, irradiance=np.zeros(6))
    expected = ground_luminance(Ground(0.2), sky, sun)
    assert image.luminance_cd_m2 == pytest.approx(expected, rel=1e-12)
    up = Camera((0, 0, 0), (0, 1, 1), name="up", size=(4, 4), fov_deg=20)
    image = render(scene, elements, up, reflected=rgb, emitted=rgb, irradiance=np.zeros(6))
    assert image.rgb / image.luminance_cd_m2[..., None] == pytest.approx(
        np.broadcast_to(cct_to_rgb(sky.cct_k), (4, 4, 3)), rel=1e-12
    )


def test_without_sky_there_is_darkness():
    tiny = PatchSet.box((0.01, 0.01, 0.01), (0, 0, 500))
    zeros = np.zeros((6, 1))
    image = render(
        scene_of(tiny), elements_of(tiny, 1), Camera((0, 0, 0), (1, 0, 0.1), name="x", size=(9, 9)),
        reflected=zeros, emitted=zeros, irradiance=np.zeros(6),
    )  # fmt: skip
    assert (image.rgb == 0.0).all()


def test_colours_keep_their_luminance():
    box = PatchSet.box((2, 2, 2), inward=True)
    elements = elements_of(box, 1)
    color = np.tile([3.0, 1.0, 0.5], (6, 1))
    camera = Camera((0, 0, 0), (1, 0, 0.1), name="x", size=(16, 12))
    image = render(
        scene_of(box), elements, camera,
        reflected=color, emitted=color, irradiance=np.zeros(6),
    )  # fmt: skip
    assert image.rgb == pytest.approx(np.broadcast_to(2 * color[0] / math.pi, (12, 16, 3)))
    assert image.luminance_cd_m2 == pytest.approx(2 * color[0] @ LUMINANCE_WEIGHTS / math.pi)


@pytest.mark.parametrize("projection", ["perspective", "parallel", "fisheye", "panorama"])
def test_projections_and_the_circle_of_a_fisheye(projection):
    box = PatchSet.box((2, 2, 2), inward=True)
    elements = elements_of(box, 2)
    n = len(elements)
    wide = {"perspective": 90, "parallel": 60, "fisheye": 180, "panorama": 360}[projection]
    camera = Camera(
        (0, 0, 0), (1, 0, 0), name="x", size=(60, 60), fov_deg=wide, projection=projection
    )  # fmt: skip
    image = render(
        scene_of(box), elements, camera,
        reflected=np.full((n, 1), math.pi), emitted=np.zeros((n, 1)), irradiance=np.ones(n),
    )  # fmt: skip
    assert not np.isnan(image.rgb).any()
    outside = np.isnan(camera.rays()[1][..., 0])
    assert outside.any() == (projection == "fisheye")
    assert (image.part_index[outside] == -1).all() and np.isnan(image.depth_m[outside]).all()
    # The rim of the circle is anti-aliased against the black around it.
    wide_outside = np.pad(outside, 1, constant_values=True) if outside.any() else np.pad(outside, 1)
    near = wide_outside[2:, 1:-1] | wide_outside[:-2, 1:-1]
    near |= wide_outside[1:-1, 2:] | wide_outside[1:-1, :-2]
    inner = ~outside & ~near
    assert image.luminance_cd_m2[inner] == pytest.approx(1.0, rel=1e-13)


def test_edges_are_anti_aliased():
    quad = PatchSet.from_bilinear([[(-1, -1, 0), (1, -0.8, 0), (1.2, 1, 0), (-1, 0.9, 0)]])
    one = np.full((1, 1), math.pi)
    image = render(
        scene_of(quad), elements_of(quad, 1),
        Camera((0, 0, 3), (0, 0, 0), name="x", up=(0, 1, 0), size=(64, 64)),
        reflected=one, emitted=0 * one, irradiance=one[:, 0],
    )  # fmt: skip
    values = np.unique(np.round(image.luminance_cd_m2, 12))
    assert values.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_wrong_shapes_are_named():
    box = PatchSet.box((2, 2, 2))
    with pytest.raises(InputError, match="reflected"):
        Renderer(
            scene_of(box), elements_of(box, 1),
            reflected=np.zeros((6, 2)), emitted=np.zeros((6, 2)), irradiance=np.zeros(6),
        )  # fmt: skip
    with pytest.raises(InputError, match="irradiance"):
        Renderer(
            scene_of(box), elements_of(box, 1),
            reflected=np.zeros((6, 1)), emitted=np.zeros((6, 1)), irradiance=np.zeros(5),
        )  # fmt: skip
