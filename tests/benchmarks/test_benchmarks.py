"""The truths against second ways to find them, and cheap cases through every tool."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parent
UP = np.array([0.0, 0.0, 1.0])


def _sum(points, normals, at, outward, weights):
    """Irradiance by a plain sum over source points, all seen."""
    to = at[None] - points[:, None]
    r2 = (to**2).sum(-1)
    facing = np.maximum(-(to * outward[None]).sum(-1), 0.0)
    return ((to * normals[:, None]).sum(-1) * facing / r2**2 * weights).sum(1)


def _cells(count):
    return (np.arange(count) + 0.5) / count


def test_square_and_disk_agree_with_sums():
    from truths import disk, polygon

    points = np.array([[0.1, 0.2, 0.0], [1.5, -0.4, 0.3]])
    normals = np.array([[0.0, 0.0, 1.0], [-0.6, 0.0, 0.8]])
    s = 2.0 * _cells(400) - 1.0
    x, y = (g.ravel() for g in np.meshgrid(s, s))
    at = np.stack([x, y, np.full_like(x, 1.0)], axis=1)
    corners = np.array([[-1.0, -1, 1], [-1, 1, 1], [1, 1, 1], [1, -1, 1]])
    expected = _sum(points, normals, at, -UP, np.full(len(at), 4.0 / len(at)))
    # Midpoint rule: error of the order of the cell's size squared, 6e-6.
    assert polygon(points, normals, corners) == pytest.approx(expected, rel=2e-5)
    # Radii at midpoints, weights 2 π r dr / turns; the rule's error is of the same order.
    r, t = (g.ravel() for g in np.meshgrid(_cells(400), 2.0 * math.pi * _cells(400)))
    at = np.stack([r * np.cos(t), r * np.sin(t), np.full_like(r, 1.0)], axis=1)
    expected = _sum(points, normals, at, -UP, 2.0 * math.pi * r / 400**2)
    assert disk(points, normals, (0, 0, 1), 1.0, (0, 0, -1)) == pytest.approx(expected, rel=2e-5)


def test_sphere_agrees_with_a_disk_of_the_same_outline():
    """From a point a sphere looks like the disk its tangents touch, also at a low sun."""
    from truths import disk, polygon, sphere

    radius, distance = 0.25, 0.6
    points, normals = np.zeros((3, 3)), np.array([[0, 0, 1], [0.6, 0, 0.8], [0, -0.8, 0.6]])
    height = distance - radius**2 / distance
    rim = radius * math.sqrt(1.0 - (radius / distance) ** 2)
    expected = disk(points, normals, (0, 0, height), rim, (0, 0, -1))
    found = sphere(points, normals, (0, 0, distance), radius)
    # Both are exact; the contour sum of 512 steps has converged.
    assert found == pytest.approx(expected, rel=1e-11)
    half = sphere(points[:1], np.array([[1.0, 0, 0]]), (0, 0, distance), radius)
    arc = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 2001)
    above = np.stack([rim * np.cos(arc), rim * np.sin(arc), np.full_like(arc, height)], axis=1)
    cut = polygon(points[:1], np.array([[1.0, 0, 0]]), above[::-1])
    # A half disk as a polygon of 2000 sides: area short by 4e-7.
    assert half == pytest.approx(cut, rel=2e-6)


def test_cylinder_agrees_with_a_sum_over_its_surface():
    from truths import cylinder_above

    points = np.array([[0.0, 0.0, 0.0], [0.7, 0.9, 1.0], [1.6, -0.5, 1.5]])
    x, t = (g.ravel() for g in np.meshgrid(2.0 * _cells(600) - 1.0, 2.0 * math.pi * _cells(2400)))
    out = np.stack([np.zeros_like(t), np.cos(t), np.sin(t)], axis=1)
    at = np.stack([x, 0.15 * out[:, 1], 2.0 + 0.15 * out[:, 2]], axis=1)
    weights = np.full(len(x), 2.0 * 2.0 * math.pi * 0.15 / len(x))
    expected = _sum(points, np.tile(UP, (3, 1)), at, out, weights)
    found = cylinder_above(points, 2.0, 1.0, 0.15)
    # The facing cosine has a kink at the silhouette: midpoint rule to (2 π / 2400)².
    assert found == pytest.approx(expected, rel=3e-5)


def test_penumbra_agrees_with_a_fine_grid_of_rays():
    from truth_penumbra import square_behind_sphere

    points = np.array([(-1, -1, 0), (-0.5, -0.5, 0), (-0.5, 0, 0), (0.2, 0.1, 0), (0.9, 0.1, 0)])
    points = points.astype(float)
    center, radius = np.array([0.0, 0.0, 1.2]), 0.3
    s = _cells(1000) - 0.5
    x, y = np.meshgrid(s, s)
    all_found = square_behind_sphere(points, 1.0, 2.5, center, radius)
    for point, found in zip(points, all_found, strict=True):
        to = np.stack([x - point[0], y - point[1], np.full_like(x, 2.5)], axis=-1)
        r2 = (to**2).sum(-1)
        ball = center - point
        free = ball @ ball - (to @ ball) ** 2 / r2 > radius**2
        # Cells cut by the shadow's edge are right or wrong at random: about 1e-3 / 1000^0.5.
        assert found == pytest.approx(float((2.5**2 / r2**2 * free).mean()), abs=2e-5)


def test_room_of_one_reflectance_balances():
    """All that the lamps send is absorbed: ∫ E (1 − ρ) over the walls is π A of the lamps."""
    from truth_room import FACES, Room, _Mesh, _reflectance, _solved

    panels = np.array([(x, x + 0.6, y, y + 0.6) for x in (0.7, 2.7) for y in (0.4, 2.0)])
    lines = (
        (0.0, 0.05, 0.2, 0.45, 0.7, 1.0, 1.3, 1.65, 2.0),
        (0.0, 0.05, 0.2, 0.4, 0.7, 1.0, 1.25, 1.5),
        (0.0, 0.05, 0.2, 0.5, 0.9, 1.35, 1.8, 2.2, 2.5, 2.65, 2.7),
    )
    room = Room((4.0, 3.0, 2.7), 0.2, 0.5, 0.7, panels, lines)

    def absorbed(pieces):
        mesh = _Mesh.of(room, pieces)
        total = 0.0
        for face, values in enumerate(_solved(room, mesh)):
            _, _, i, j = FACES[face]
            area = np.outer(np.diff(mesh.borders[i]), np.diff(mesh.borders[j]))
            total += float((values * (1.0 - _reflectance(room, mesh, face)) * area).sum())
        return total / (math.pi * 4 * 0.36)

    coarse, fine = absorbed(1), absorbed(2)
    # Second order, then extrapolated.
    assert abs(fine - 1.0) < 0.3 * abs(coarse - 1.0)
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(1.0, abs=2e-4)


def test_window_lets_in_what_a_vertical_plane_gets_of_the_sky():
    """A (3/14 + 4/(7π)) 7π/9 through the opening; all of it is absorbed or leaves again."""
    import truth_window
    from cases.d2_window import ROOM

    x0, x1, z0, z1 = ROOM.opening
    entering = (x1 - x0) * (z1 - z0) * (3 / 14 + 4 / (7 * math.pi)) * 7 * math.pi / 9

    def balance(pieces):
        mesh = truth_window._Mesh.of(ROOM, pieces)
        first = kept = 0.0
        for face, reflected in enumerate(truth_window._reflected(ROOM, mesh)):
            _, _, i, j = truth_window.FACES[face]
            area = np.outer(np.diff(mesh.borders[i]), np.diff(mesh.borders[j]))
            at, normals = (a.reshape(-1, 3) for a in truth_window._cells(ROOM, mesh, face))
            direct = truth_window.direct(ROOM, at, normals, 16).reshape(area.shape)
            absorbed = 1.0 - truth_window._reflectance(ROOM, mesh, face)
            first += float((direct * area).sum())
            kept += float(((direct + reflected) * absorbed * area).sum())
        return np.array([first, kept]) / entering

    coarse, fine = balance(1), balance(2)
    # Second order, then extrapolated; what leaves through the opening counts as absorbed by it.
    assert (np.abs(fine - 1.0) < 0.3 * np.abs(coarse - 1.0)).all()
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(1.0, abs=2e-4)


@pytest.mark.slow
def test_clear_sky_through_the_window_on_other_meshes():
    """Cells of other sizes, and the luminance by the solver's own formula, which is separate."""
    import dataclasses

    import truth_window
    from cases.d2_window import CLEAR, CLEAR_ROOM, SUN
    from patchlight.solver.model import CIESky
    from patchlight.solver.skies import relative_luminance

    d = np.random.default_rng(1).normal(size=(3, 400))
    d[1], d[2] = -np.abs(d[1]), np.abs(d[2])
    sky = CIESky(12, sun_altitude_deg=SUN[0], sun_azimuth_deg=SUN[1])
    luminance = truth_window.relative_luminance(CLEAR_ROOM.sun, *d, np.linalg.norm(d, axis=0))
    np.testing.assert_allclose(luminance, relative_luminance(sky, d.T), rtol=1e-12)
    few = slice(None, None, 7)
    points, normals = CLEAR.points[few], CLEAR.normals[few]
    direct = truth_window.direct(CLEAR_ROOM, points, normals)
    finer = truth_window.direct(CLEAR_ROOM, points, normals, 40)
    np.testing.assert_allclose(direct, finer, rtol=1e-6)
    other = dataclasses.replace(
        CLEAR_ROOM,
        lines=(
            (0.0, 0.03, 0.12, 0.3, 0.55, 0.8, 0.95, 1.25, 1.6, 2.0),
            (0.0, 0.03, 0.12, 0.35, 0.7, 1.1, 1.6, 2.2, 2.9, 3.7, 4.5, 5.1, 5.6, 5.85, 5.96, 6.0),
            (0.0, 0.03, 0.12, 0.3, 0.6, 0.9, 1.05, 1.4, 1.8, 2.1, 2.3, 2.45, 2.6, 2.67, 2.7),
        ),
    )
    one, two = (truth_window._gather(other, k, points, normals) for k in (1, 2))
    # On two meshes errors of h² cancel: 3e-5 are left; on three both agree to 6e-6.
    truth = CLEAR.truth()[few]
    np.testing.assert_allclose(direct + (4.0 * two - one) / 3.0, truth, rtol=5e-5)


@pytest.mark.parametrize("case", ["WINDOW_OVERCAST", "WINDOW_CLEAR", "ROOF_OVERCAST", "ROOF_CLEAR"])
def test_daylight_of_a_black_room_agrees_with_directions(case):
    """Of all directions those that go through the opening, and the solver's formula of the sky."""
    from cases import d1_daylight
    from patchlight.solver.model import CIESky
    from patchlight.solver.skies import relative_luminance

    case = getattr(d1_daylight, case)
    altitude = 0.5 * math.pi * _cells(1000)[:, None]
    azimuth = 2.0 * math.pi * _cells(4000)[None, :]
    d = np.stack(
        np.broadcast_arrays(
            np.cos(altitude) * np.sin(azimuth),
            np.cos(altitude) * np.cos(azimuth),
            np.sin(altitude),
        ),
        axis=-1,
    )
    sky = CIESky(16)
    if case.sun is not None:
        sky = CIESky(12, sun_altitude_deg=case.sun[0], sun_azimuth_deg=case.sun[1])
    light = relative_luminance(sky, d.reshape(-1, 3)).reshape(1000, 4000)
    light *= np.sin(altitude) * np.cos(altitude) * (0.5 * math.pi / 1000) * (2.0 * math.pi / 4000)
    (opening,) = [body.shape.corners() for body in case.bodies if body.sky]
    low, high = opening.min(axis=0), opening.max(axis=0)
    axis = int(np.argmin(high - low))
    truth = case.truth()
    for k in (2, 45, 93):
        point = case.points[k]
        with np.errstate(divide="ignore"):
            away = (low[axis] - point[axis]) / d[..., axis]
        met = away > 0.0
        for i in set(range(3)) - {axis}:
            at = point[i] + away * d[..., i]
            met &= (at > low[i]) & (at < high[i])
        # Cells that the rim of the opening cuts are right or wrong as by chance, 1 in 1000 across.
        assert float(light[met].sum()) == pytest.approx(truth[k], rel=2e-3)


def test_sun_through_a_window_agrees_with_rays_to_the_disc():
    from cases import d3_sun

    disc, toward = d3_sun.DISC, np.array(d3_sun._TOWARD)
    across = np.cross(toward, UP)
    across /= np.linalg.norm(across)
    upward = np.cross(across, toward)
    # Points evenly over the disc projected onto the plane that faces it, on no lines: a sunflower.
    sine = math.sin(math.radians(disc.radius)) * np.sqrt(_cells(1_000_000))
    angle = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(1_000_000)
    away = (sine * np.cos(angle))[..., None] * across + (sine * np.sin(angle))[..., None] * upward
    d = away + np.sqrt(1.0 - sine**2)[..., None] * toward
    # Light on an upward plane: the cosine on it over that on the plane that faces the disc.
    weight = d[..., 2] / np.sqrt(1.0 - sine**2)
    truth = d3_sun.CASE.truth()
    whole = math.sin(math.radians(disc.altitude))
    # Both penumbrae are there, from the dark to full light.
    assert truth[:61].max() == pytest.approx(whole, rel=1e-4) and truth[:61].min() == 0.0
    assert truth[61:].max() == pytest.approx(whole, rel=1e-4) and truth[61:].min() == 0.0
    for k in range(0, len(truth), 7):
        point = d3_sun.POINTS[k]
        x, _, z = np.moveaxis(point - d * (point[1] / d[..., 1])[..., None], -1, 0)
        seen = (x > d3_sun.X0) & (x < d3_sun.X1) & (z > d3_sun.Z0) & (z < d3_sun.Z1)
        # Of some 1000 points next to an edge a few are on the wrong side: 1e-6 of the light each.
        assert float((weight * seen).mean()) == pytest.approx(truth[k], abs=4e-5)


def test_cost_is_read_off_between_points():
    from measure import Point, cost

    def at(cpu, rms):
        return Point("tool", "", cpu, (cpu,), rms, rms, 0.0)

    points = [at(1.0, 1e-1), at(2.0, 5e-1), at(100.0, 1e-3)]
    assert cost(points, 1e-2) == (pytest.approx(10.0), "measured")
    assert cost(points, 0.5) == (1.0, "at most")
    assert cost(points, 1e-4) == (pytest.approx(1e4), "extrapolated")
    assert cost([], 1e-2) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    # One case each of straight light, of shadow, of reflection, of daylight and of sun; bounds on
    # the root mean square of the quickest settings, about twice what they have.
    ("case", "bounds"),
    [
        ("A1_far", {"patchlight": 1e-6, "radiance": 2e-2, "mitsuba": 6e-2}),
        ("B", {"patchlight": 1e-4, "radiance": 7e-2, "mitsuba": 6e-2}),
        ("C3", {"patchlight": 2e-2, "radiance": 3e-2, "mitsuba": 8e-2}),
        ("D1_roof", {"patchlight": 1e-6, "radiance": 2e-2}),
        ("D3", {"patchlight": 1e-4, "radiance": 3e-1, "mitsuba": 2.5e-1}),
        ("D2", {"patchlight": 3e-3, "radiance": 4e-2, "mitsuba": 3e-1}),
        ("F", {"patchlight": 2.5e-2, "mitsuba": 1.5e-1}),
    ],
)
def test_cheap_case_through_every_tool(tmp_path, case, bounds):
    command = [sys.executable, str(FOLDER / "run.py"), "--case", case, "--settings", "1"]
    command += ["--repeats", "1", "-o", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "benchmarks.json").read_text(encoding="utf-8"))
    found = {p["tool"]: p["rms"] for p in report["cases"][0]["points"]}
    missing = {name for name, said in report["tools"].items() if said.startswith("missing:")}
    assert set(found) == set(bounds) - missing and "patchlight" in found
    for tool, rms in found.items():
        assert rms <= bounds[tool], tool
    assert (tmp_path / "benchmarks.png").stat().st_size > 0


def test_unknown_case_is_named():
    command = [sys.executable, str(FOLDER / "run.py"), "--case", "nothing", "-o", "unused"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2 and "nothing" in done.stderr and "C3_surf" in done.stderr


@pytest.mark.slow
def test_rates_are_compared_at_one_error():
    """Every way reaches the error that it is timed at; which is faster is for the benchmark."""
    import bulk_rate

    found = bulk_rate.measure(side=8, receivers=8)
    assert found["compared"] > 0.3
    for name in ("edges", "nn93", "polygon"):
        assert found[name]["rms"] <= bulk_rate.ERROR and found[name]["pairs_per_s"] > 0.0


def test_no_decomposition_has_less_than_the_least_patches():
    """Of planes in a box, a disc, rings and plates with holes; squares and rows reach it."""
    import cadquery as cq
    from importing import least_patches, trimmed
    from patchlight.importers.convert import convert_faces
    from patchlight.importers.extract import Extractor, faces_of

    assert [least_patches(*n) for n in ((3, 0), (4, 0), (6, 0), (8, 1), (16, 3))] == [
        1,
        1,
        2,
        4,
        10,
    ]
    plate = cq.Workplane().box(8, 4, 1).faces(">Z").workplane()
    ring = cq.Workplane().circle(3).circle(1.5).extrude(1)
    shapes = [
        plate.rarray(2, 2, 3, 1).hole(1),
        plate.hole(1.5),
        ring,
        cq.Workplane()
        .polyline([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)])
        .close()
        .extrude(1),
    ]
    pairs = []
    for shape in shapes:
        found = shape.val().wrapped
        extractor = Extractor(found, 1e-5)
        raws = [extractor.face(face) for face in faces_of(found)]
        faces = convert_faces(raws, 1e-4, 1.0, 8.0)
        pairs += trimmed([(raws, 1e-4)], [faces])["plane"]
    assert len(pairs) == 8
    assert all(patches >= least for patches, least, _ in pairs)
    assert sum(patches == least for patches, least, _ in pairs) >= 6
    assert sorted(holes for _, _, holes in pairs) == [0, 0, 1, 1, 1, 1, 3, 3]
