"""Light in twenty bands: closed forms, what grey rooms keep, modelled skies and suns."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from patchlight.pipeline import (
    Camera,
    CIESky,
    Emitter,
    Ground,
    Material,
    PatchSet,
    PatchSky,
    Scene,
    SensorGrid,
    Sun,
    load_scene,
    simulate,
)
from patchlight.solver.errors import InputError
from patchlight.solver.light_colors import LightColors
from patchlight.solver.model import bands as b
from patchlight.solver.model.colorimetry import chromaticity, melanopic_der
from patchlight.solver.model.result import luminous
from patchlight.solver.skies import luminance
from patchlight.solver.sky_color import daylight_weights, sky_chromaticity
from patchlight.solver.spectra import cct_color, daylight_basis, temperature_and_distance

from .window_room import window_room

UP = (0.0, 0.0, 1.0)
CLEAR = {"sun_altitude_deg": 40.0, "sun_azimuth_deg": 150.0}


def grid(points, normals=UP, *, spectral=True, name="g"):
    return SensorGrid(points, normals, name=name, spectral=spectral)


def open_field(sky, normals, **light):
    """Sensors that see nothing but sky and ground."""
    scene = Scene()
    scene.add(PatchSet.disk((0, 0, -50), 0.1, (0, 0, -1)), "below")
    scene.sky, scene.sun = sky, light.get("sun")
    scene.ground = Ground(light.get("ground", 0.0))
    scene.add(grid(np.zeros((len(normals), 3)), np.array(normals, dtype=float)))
    return simulate(scene, accuracy=0.01, cache=False).sensors["g"]


def solved(scene, **options):
    return simulate(scene, **{"accuracy": 0.02, "cache": False, **options})


def lit_room(spectral, rho=0.5, **light):
    """The room with sky, sun and a lamp of 3000 K, and sensors from window to rear wall."""
    scene = window_room(4.0, 3.0, rho)
    scene.add(PatchSet.disk((0, 3, 2.9), 0.2, (0, 0, -1)), "lamp")
    scene.assign("lamp", Emitter(2000, cct_k=3000, group="lamp"))
    scene.sky, scene.sun = light.get("sky", CIESky(12, **CLEAR)), light.get("sun")
    scene.add(grid([(0.2, y, 0.8) for y in (0.5, 1.5, 2.5, 3.5)], spectral=spectral))
    return scene


SUN = Sun(40.0, 150.0, normal_illuminance_lx=60_000.0)


def test_grey_rooms_have_the_illuminance_of_one_band():
    one = solved(lit_room(False, sun=SUN))
    many = solved(lit_room(True, sun=SUN))
    assert (one.settings["bands"], many.settings["bands"]) == (1, 20)
    a, found = one.sensors["g"], many.sensors["g"]
    # What GMRES leaves; nothing else is told anew.
    assert found.illuminance_lx == pytest.approx(a.illuminance_lx, rel=1e-6)
    for name, lux in a.components.items():
        assert found.components[name] == pytest.approx(lux, rel=1e-6, abs=1e-6)
    assert found.error_lx == pytest.approx(a.error_lx, rel=1e-3)
    assert found.spectral.bands_lx.sum(axis=1) == pytest.approx(found.illuminance_lx, rel=1e-12)
    # Light of a group keeps one colour: it is solved once for all its bands.
    assert many.counters["matrix_products"] == one.counters["matrix_products"]
    assert a.spectral is None and not [name for name in a.metrics if "CCT" in name]


@pytest.mark.parametrize(
    ("light", "cct_k", "ratio"),
    [
        ({"cct_k": 6504.0}, 6504.0, 1.0),
        ({"cct_k": 2855.5}, 2855.5, 0.496),
        ({"spectrum": [(300, 1), (900, 1)]}, 5455.0, 0.906),
    ],
    ids=["D65", "illuminant A", "equal energy"],
)
def test_grey_rooms_keep_the_colour_of_light(light, cct_k, ratio):
    """0.1 % of twenty bands; the ratios are those of CIE S 026, to their printed digits."""
    scene = Scene()
    scene.add(PatchSet.box((4, 4, 3), inward=True), "room")
    scene.assign("room", Material(0.7))
    scene.add(PatchSet.disk((0, 0, 1.4), 0.3, (0, 0, -1)), "lamp")
    scene.assign("lamp", Emitter(2000, **light))
    scene.add(grid([(1, 1, -0.7), (-1.5, 0, 0.5)], (0, -1, 0)))
    found = solved(scene).sensors["g"].spectral
    assert found.cct_k == pytest.approx(cct_k, rel=1e-3)
    assert found.melanopic_der == pytest.approx(ratio, abs=5e-4)
    assert found.cct_error_k == pytest.approx(0.0, abs=1e-6)
    if "cct_k" in light:
        known = chromaticity(cct_color(cct_k, 20))
        assert found.chromaticity == pytest.approx(np.tile(known, (2, 1)), abs=1e-9)


def test_sphere_of_saturated_walls_has_its_closed_form_in_each_band():
    """A wall that emits M and reflects ρ everywhere in a sphere gets and shows M / (1 − ρ)."""
    walls = [(400, 0.05), (500, 0.2), (560, 0.2), (600, 0.9), (700, 0.95)]
    scene = Scene()
    scene.add(PatchSet.sphere((0, 0, 0), 1.0, inward=True), "ball")
    scene.assign("ball", Material(walls))
    scene.assign("ball", Emitter(4.0 * np.pi * 100.0, cct_k=5000))
    scene.add(grid([(0, 0, 0), (0.3, 0.2, -0.4)], (0, 0, 1)))
    found = simulate(scene, accuracy=0.01, cache=False).sensors["g"]
    rho = b.band_means(*np.array(walls, dtype=float).T, held=True)
    expected = 100.0 * cct_color(5000.0, 20) / (1.0 - rho)
    # What the form factors of a sphere leave at this accuracy, ten times in the reddest band.
    assert found.spectral.bands_lx == pytest.approx(np.tile(expected, (2, 1)), rel=1e-3)
    assert found.illuminance_lx == pytest.approx(np.full(2, expected.sum()), rel=1e-3)
    assert found.spectral.cct_k[0] < 3000.0 < 5000.0


def test_lights_of_different_colour_add_up():
    """Tristimulus values of sky and lamp together are the sums of those of each alone."""
    rho = (0.7, 0.5, 0.3)
    both = solved(lit_room(True, rho)).sensors["g"].spectral
    sky, lamp = lit_room(True, rho), lit_room(True, rho, sky=None)
    sky.assign("lamp", Emitter(0.0, cct_k=3000, group="lamp"))
    parts = [solved(scene).sensors["g"].spectral for scene in (sky, lamp)]
    total = sum(part.bands_lx for part in parts)
    # Each is solved to 1e-4 of the accuracy, 2e-6 of what is reflected.
    assert both.bands_lx == pytest.approx(total, rel=1e-5)
    low, high = (np.minimum, np.maximum)
    assert (both.cct_k > low(parts[0].cct_k, parts[1].cct_k)).all()
    assert (both.cct_k < high(parts[0].cct_k, parts[1].cct_k)).all()
    assert both.melanopic_edi_lx == pytest.approx(
        sum(part.melanopic_edi_lx for part in parts), rel=1e-5
    )
    # Warm walls: light that was reflected is redder than what came in.
    assert (parts[0].cct_k < 6500.0).all() and (np.diff(parts[0].cct_k) < 0.0).any()


@pytest.mark.parametrize("color", ["chain", "preetham"])
def test_colour_of_open_skies_is_the_integral_over_them(color):
    """Against 200 altitudes and 720 azimuths, at sensors up, away from the sun and towards it."""
    sky = CIESky(12, **CLEAR, color=color)
    normals = np.array([(0, 0, 1), (0, 1, 0), (0, -1, 0)], dtype=float)
    found = open_field(sky, normals)
    x, w = np.polynomial.legendre.leggauss(200)
    altitude, turn = np.meshgrid(0.25 * np.pi * (x + 1), 2 * np.pi * (np.arange(720) + 0.5) / 720)
    c = np.cos(altitude)
    d = np.stack([c * np.sin(turn), c * np.cos(turn), np.sin(altitude)], axis=-1).reshape(-1, 3)
    solid = (np.tile(w, 720) * c.ravel()) * 0.25 * np.pi * 2 * np.pi / 720
    weights = daylight_weights(sky_chromaticity(sky, d, color))
    light = np.concatenate([np.ones((len(d), 1)), weights], axis=1) @ daylight_basis(20)
    light *= (luminance(sky, d) * solid / light.sum(axis=1))[:, None]
    expected = np.maximum(normals @ d.T, 0.0) @ light
    cct, duv = temperature_and_distance(chromaticity(expected))
    assert found.spectral.cct_k == pytest.approx(cct, rel=5e-3)  # what 577 cells leave
    assert found.spectral.duv == pytest.approx(duv, abs=2e-4)
    assert found.spectral.melanopic_der == pytest.approx(melanopic_der(expected), rel=1e-3)
    told = found.spectral
    assert (np.abs(told.cct_k - cct) < told.cct_error_k).all()
    assert (told.cct_error_k < 0.025 * cct).all()  # 2 %, and a little of the illuminance
    assert (np.abs(told.duv - duv) < told.duv_error).all()
    assert (np.abs(told.melanopic_der - melanopic_der(expected)) < told.der_error).all()
    assert cct[1] > cct[2]  # bluer away from the sun
    # The level is that of the sky without the model.
    plain = open_field(CIESky(12, **CLEAR), normals)
    assert found.illuminance_lx == pytest.approx(plain.illuminance_lx, rel=1e-12)
    assert plain.spectral.cct_k == pytest.approx(np.full(3, 6500.0), rel=1e-3)


def test_colour_of_the_sky_reaches_the_room_and_not_its_level():
    plain, chain, glazed = (lit_room(True, 0.6) for _ in range(3))
    chain.sky = glazed.sky = CIESky(12, **CLEAR, color="chain")
    from patchlight.pipeline import Glass

    from .window_room import opening

    glazed.add(opening(), "pane", two_sided=True)
    glazed.assign("pane", Glass(0.006))
    a, found, behind = (solved(scene).sensors["g"] for scene in (plain, chain, glazed))
    for name, lux in a.components.items():
        assert found.components[name] == pytest.approx(lux, rel=1e-6, abs=1e-9)
    assert (found.spectral.cct_k > a.spectral.cct_k + 500.0).all()
    # 2 % of what comes straight from the sky, of about 11 000 K.
    assert (found.spectral.cct_error_k < 250.0).all()
    # Glass is grey: behind it the sky is darker than the lamp, of 3000 K, but not less blue.
    assert (behind.spectral.cct_k < found.spectral.cct_k).all()
    assert (behind.spectral.cct_k > a.spectral.cct_k).all()


@pytest.mark.parametrize(("color", "azimuth"), [("chain", 170.0), ("preetham", 350.0)])
def test_colour_that_cells_leave_of_a_window_is_within_its_error(color, azimuth, monkeypatch):
    """Against 2305 cells on elements and at sensors; the window looks to azimuth 180."""
    import patchlight.solver.incident as incident

    places = [(0.2, y, 0.8) for y in (0.3, 1.5, 2.5, 3.5)] + [(0.3, 1.0, 1.2), (0.3, 3.5, 1.2)]
    normals = [UP] * 4 + [(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)]

    def told():
        scene = window_room(4.0, 3.0, 0.5)
        scene.sky = CIESky(12, sun_altitude_deg=40.0, sun_azimuth_deg=azimuth, color=color)
        scene.add(grid(places, normals))
        return solved(scene).sensors["g"].spectral

    usual = told()
    monkeypatch.setattr(incident, "ELEMENT_PARTS", 4)
    monkeypatch.setattr(incident, "SENSOR_PARTS", 4)
    finer = told()
    for value, error in (
        ("cct_k", "cct_error_k"),
        ("duv", "duv_error"),
        ("melanopic_der", "der_error"),
    ):
        off = np.abs(getattr(usual, value) - getattr(finer, value))
        assert (off <= getattr(usual, error)).all() and off.max() > 0.0


def test_black_skies_leave_other_light_its_colour():
    """A sky of 0 lx, or a measured one that is dark all over, has a model and no light."""
    for sky in (
        CIESky(12, **CLEAR, color="chain", diffuse_illuminance_lx=0.0),
        PatchSky(np.zeros(145), **CLEAR, color="preetham"),
    ):
        found = solved(lit_room(True, sky=sky)).sensors["g"]
        assert np.isfinite(found.illuminance_lx).all()
        assert found.spectral.cct_k == pytest.approx(np.full(4, 3000.0), rel=1e-3)
        for bands in (3, 20):
            colors = LightColors(lit_room(True, sky=sky).freeze(), bands)
            # Of illuminance 1, as of all light.
            assert luminous(colors.sky) == pytest.approx(1.0, abs=1e-3)
            assert colors.ground == pytest.approx(colors.sky)


def test_skies_have_the_same_colour_in_three_bands_and_in_twenty():
    """Direct light of a modelled sky on the elements of a coloured room."""
    found = {}
    for spectral in (False, True):
        scene = lit_room(spectral, (0.7, 0.5, 0.3), sky=CIESky(12, **CLEAR, color="preetham"))
        result = solved(scene, accuracy=0.05)
        assert result.settings["bands"] == (20 if spectral else 3)
        found[spectral] = result.components["sky.direct"]
    lit = found[True].sum(axis=1) > 1.0
    rgb = b.in_primaries(found[True][lit])
    # sRGB is told to four digits, and its primaries by another rule over wavelength.
    assert found[False][lit] == pytest.approx(rgb, rel=1e-2)
    blue = found[False][lit] / found[False][lit].sum(axis=1)[:, None]
    assert np.ptp(blue[:, 2]) > 0.02  # other walls see other parts of it


def test_the_sun_is_modelled_by_its_altitude():
    """ASTM G173's air; low suns are redder. 4997 K at 30 degrees by the spectrum at every nm."""
    found = {}
    for altitude in (30.0, 10.0):
        sun = Sun(altitude, 180.0, normal_illuminance_lx=50_000.0, color="spectrl2")
        found[altitude] = open_field(None, [(0, 0, 1)], sun=sun).spectral.cct_k[0]
    assert found[30.0] == pytest.approx(4997.0, rel=2e-3)
    assert found[10.0] == pytest.approx(3924.0, rel=4e-3)


def test_low_suns_are_modelled_where_refraction_shows_them():
    """It lifts the sun of 1 degree to 1° 21': less air, and a sun less red."""
    import pvlib
    from patchlight.solver.spectra import spectrum_color
    from patchlight.solver.sun_spectrum import sun_spectrum

    zenith = 90.0 - 1.0 - 0.355  # what tables of refraction have, to an arcmin
    told = pvlib.spectrum.spectrl2(
        zenith, 0.0, 0.0, 0.2, 101325.0,
        pvlib.atmosphere.get_relative_airmass(zenith), 1.42, 0.344, 0.084, dayofyear=93,
    )  # fmt: skip
    pairs = zip(told["wavelength"].ravel(), told["dni"].ravel(), strict=True)
    pairs = tuple((float(x), float(y)) for x, y in pairs if x < 1000.0)
    expected = spectrum_color(pairs)[1]
    # One arcmin there is 0.4 %; without refraction it is 8 % less.
    assert spectrum_color(sun_spectrum(1.0))[1] == pytest.approx(expected, rel=5e-3)


def test_the_ground_has_the_colour_of_the_light_on_it():
    sun = Sun(40.0, 150.0, normal_illuminance_lx=60_000.0, cct_k=4500.0)
    sky = CIESky(12, **CLEAR, cct_k=12_000.0)
    down = open_field(sky, [(0, 0, -1)], sun=sun, ground=0.3)
    up = open_field(sky, [(0, 0, 1)], sun=sun, ground=0.3)
    assert down.spectral.bands_lx == pytest.approx(0.3 * up.spectral.bands_lx, rel=1e-4)


def test_pictures_of_twenty_bands_are_those_of_three():
    """But for what spectra of primaries, reflected twice, differ from primaries themselves."""

    def picture(spectral):
        scene = lit_room(spectral, (0.6, 0.4, 0.3), sun=SUN)
        scene.assign("floor", Material((0.4, 0.4, 0.4), specular=0.1, exponent=20))
        scene.add(Camera((0, 3.9, 1.5), (0, 0, 1.2), name="c", size=(48, 36)))
        return solved(scene, accuracy=0.05).images["c"]

    three, many = picture(False), picture(True)
    assert many.luminance_cd_m2.sum() == pytest.approx(three.luminance_cd_m2.sum(), rel=0.02)
    assert many.rgb.sum(axis=(0, 1)) == pytest.approx(three.rgb.sum(axis=(0, 1)), rel=0.04)


def test_what_is_known_of_a_room_serves_other_bands():
    """Form factors do not depend on bands: runs in one process share them."""
    first = simulate(lit_room(False), accuracy=0.02)
    again = simulate(lit_room(True), accuracy=0.02)
    assert again.counters.get("pairs_reused", 0) > 0
    assert again.sensors["g"].illuminance_lx == pytest.approx(
        first.sensors["g"].illuminance_lx, rel=1e-6
    )


def test_daylight_factors_do_without_spectra():
    """They are of illuminance alone; a year tells melanopic values as well."""
    from patchlight.pipeline.freezing import frozen_scene
    from patchlight.solver.daylight import overcast_scene
    from patchlight.solver.daylit import DaylitScene

    scene = lit_room(True)
    scene.daylight_factor = True
    data = frozen_scene(scene)
    assert (data.bands, overcast_scene(data).bands) == (20, 1)
    year = DaylitScene.of(data, accuracy=0.1)
    assert year.scene.bands == 20
    assert not year.stages.warnings


def test_requirements_on_colour_need_sensors_that_ask_for_it():
    scene = lit_room(False)
    scene.require("g", "EDI_avg_lx", min=200)
    with pytest.raises(InputError, match="'g' EDI_avg_lx: colour and melanopic values need spect"):
        scene.freeze()


def test_light_outside_the_bands_is_named():
    """365 nm is just visible to the observer from 360 nm on, and in none of the bands."""
    for spectral in (False, True):
        scene = lit_room(spectral, sky=None)
        scene.assign("lamp", Emitter(2000, spectrum=[(355, 0), (365, 1), (375, 0)]))
        if not spectral:
            scene.freeze()
            continue
        with pytest.raises(InputError, match="emitter of lamp.*: spectrum from 355 to 375 nm: no"):
            scene.freeze()


def test_what_is_not_told_has_no_error():
    """Saturated light has no colour temperature, darkness nothing at all."""
    from patchlight.reports.run_files import grid_csv

    scene = lit_room(True, sky=None)
    scene.assign("lamp", Emitter(2000, spectrum=[(520, 0), (530, 1), (540, 0)]))
    scene.add(grid([(0, 0, 20.0)], name="dark"))
    found = solved(scene).sensors
    green, dark = found["g"].spectral, found["dark"].spectral
    assert np.isnan(green.cct_k).all() and np.isnan(green.cct_error_k).all()
    assert np.isnan(green.duv_error).all() and np.isfinite(green.der_error).all()
    assert np.isnan(dark.der_error).all() and np.isnan(dark.cct_error_k).all()
    for grid_found in found.values():
        assert grid_found.metric_errors.keys() == grid_found.metrics.keys()
    row = next(csv.DictReader(grid_csv(found["dark"]).splitlines()))
    assert (row["CCT_K"], row["CCT_error_K"], row["DER_error"]) == ("nan", "nan", "nan")
    assert float(row["EDI_error_lx"]) >= 0.0


def test_unnamed_spectra_are_told_apart():
    """They would share a name, and the ledger of absorbed light would add them up."""
    dark, bright = (Material([(400, r), (550, 2 * r), (700, r)]) for r in (0.1, 0.4))
    alike = Material([(400, 0.1), (550, 0.2), (700, 0.10001)])
    scene = lit_room(False, sky=None)
    walls = {"floor": dark, "ceiling": bright, "west": alike, "east": dark}
    for name, material in walls.items():
        scene.assign(name, material)
    found = solved(scene, accuracy=0.1)
    names = [m.name for m in found.scene.materials]
    assert len(set(names)) == len(names) == 4
    assert found.balance.absorbed_by_material.keys() == {*names, "black"}
    assert sum("spectrum 400 to 700 nm" in name for name in names) == 3


def test_lamps_of_different_spectrum_have_rows_of_their_own():
    from patchlight.reports.inputs import luminaire_rows

    narrow = [(440, 0), (450, 1), (460, 0), (570, 0), (575, 0.6), (580, 0)]
    other = [(440, 0), (450, 1), (460, 0), (570, 0), (575, 0.6), (580, 1e-12)]
    scene = lit_room(False, sky=None)
    for k, spectrum in enumerate((narrow, other, narrow)):
        scene.add(PatchSet.disk((0.5 * k - 1, 2, 2.9), 0.2, (0, 0, -1)), f"s{k}")
        scene.assign(f"s{k}", Emitter(100, spectrum=spectrum, group="s"))
    rows = [row for row in luminaire_rows(scene.freeze()) if row["group"] == "s"]
    assert sorted(row["count"] for row in rows) == ["1", "2"]


def test_steep_spectra_reflect_in_three_bands_about_what_they_do_in_twenty():
    """In a closed room, where a primary near 1 would make three times too much light."""

    def mean(spectral):
        scene = Scene()
        scene.add(PatchSet.box((4, 4, 3), inward=True), "room")
        scene.assign("room", Material([(400, 0.05), (559, 0.05), (561, 0.7), (700, 0.7)]))
        scene.add(PatchSet.disk((0, 0, 1.4), 0.3, (0, 0, -1)), "lamp")
        scene.assign("lamp", Emitter(2000, cct_k=2700))
        scene.add(grid([(1, 0, -0.7), (-1, 1, -0.7)], spectral=spectral))
        return solved(scene).sensors["g"].illuminance_lx.mean()

    # What three bands are as a model of interreflection: see section 11 of the theory.
    assert mean(False) == pytest.approx(mean(True), rel=0.1)


def test_coloured_mirrors_are_named_where_light_is_told_by_wavelength():
    for spectral, mirror, said in ((True, (0.9, 0.6, 0.3), True), (True, 0.8, False),
                                   (False, (0.9, 0.6, 0.3), False)):  # fmt: skip
        scene = lit_room(spectral, sky=None)
        scene.assign("north", Material(0.05, mirror=mirror, name="copper"))
        found = [text for text in scene.freeze().warnings if "mirrors of a colour" in text]
        assert bool(found) == said and all(text.endswith(": copper") for text in found)


def test_colour_by_luminance_asks_for_a_level():
    def warned(spectral=True, type_=12, **level):
        sky = CIESky(type_, **CLEAR, color="chain", **level)
        return any("no level" in text for text in lit_room(spectral, sky=sky).freeze().warnings)

    assert warned()
    assert not warned(diffuse_illuminance_lx=12_000.0) and not warned(estimated=True)
    assert not warned(type_=16)  # one colour whatever its level
    assert not warned(spectral=False)  # no colours at all


def test_three_bands_are_doubted_where_lamps_light_coloured_rooms():
    """Against both in a sphere, where what is estimated is exact."""

    def ball(rho, spectral=False, **light):
        scene = Scene()
        scene.add(PatchSet.sphere((0, 0, 0), 1.0, inward=True), "ball")
        scene.assign("ball", Material(rho))
        scene.assign("ball", Emitter(1000.0, **light))
        scene.add(grid([(0.1, 0, 0)], spectral=spectral))
        return scene

    def noted(scene):
        return [text for text in scene.freeze().notes if "coloured surfaces under lamps" in text]

    red = (0.7, 0.2, 0.1)
    three, twenty = (
        solved(ball(red, spectral, cct_k=2700)).sensors["g"].illuminance_lx[0]
        for spectral in (False, True)
    )
    assert three > 1.05 * twenty
    (note,) = noted(ball(red, cct_k=2700))
    assert f"roughly {three / twenty - 1.0:.0%} above" in note
    assert not noted(ball((0.6, 0.55, 0.5), cct_k=2700))  # hardly coloured
    assert not noted(ball(0.7, cct_k=2700)) and not noted(ball(red, True, cct_k=2700))


def test_colour_models_without_effect_are_named():
    scene = lit_room(False)
    scene.sky = CIESky(12, **CLEAR, color="chain")
    assert "no sensor tells colours apart" in solved(scene).skipped["colour of the sky"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CIESky(16, color="blue"), "CIESky.color = 'blue': must be one of constant"),
        (
            lambda: CIESky(16, 40.0, color="preetham"),
            "the sky has no sun; give sun_altitude_deg and sun_azimuth_deg",
        ),
        (lambda: CIESky(16, color="chain", cct_k=5000), "give cct_k or color = 'chain', not both"),
        (lambda: Sun(9, 9, normal_illuminance_lx=9, color="red"), "Sun.color = 'red'"),
        (lambda: grid([(0, 0, 1)], spectral="yes"), "spectral = 'yes': must be True or False"),
    ],
)
def test_bad_colours_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_scene_files_ask_for_spectra(tmp_path):
    import cadquery as cq

    room = cq.Workplane().box(4000, 5000, 3000).translate((0, 0, 1500))
    lamp = cq.Workplane().box(500, 500, 50).translate((0, 0, 2900))
    parts = cq.Assembly().add(room, name="room").add(lamp, name="lamp")
    parts.export(str(tmp_path / "room.step"))
    path = tmp_path / "scene.toml"
    path.write_text("""
schema_version = 1
accuracy = 0.05
[[model]]
file = "room.step"
[[assign]]
parts = "room"
air = true
material = { reflectance = [[400, 0.2], [500, 0.3], [600, 0.8], [700, 0.85]] }
[[assign]]
parts = "lamp"
emitter = { flux_lm = 3000, cct_k = 4000 }
[[sensors]]
name = "eyes"
points_m = [[1, 1, 1.2], [-1, 1, 1.2]]
normal = [0, -1, 0]
spectral = true
[[requirements]]
sensors = "eyes"
metric = "EDI_avg_lx"
min = 1
""")
    from patchlight.reports import write_run

    result = simulate(load_scene(path), cache=False)
    found = result.sensors["eyes"]
    assert result.settings["bands"] == 20
    assert found.metrics["CCT_avg_K"] < 4000.0 and 0.3 < found.metrics["DER_avg"] < 0.72
    assert found.metric_errors["EDI_avg_lx"] > 0.0
    assert found.metrics["EDI_avg_lx"] == pytest.approx(found.spectral.melanopic_edi_lx.mean())
    write_run(result, tmp_path / "out")
    with open(tmp_path / "out" / "grids" / "eyes.csv", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert float(rows[0]["CCT_K"]) == pytest.approx(found.spectral.cct_k[0], rel=1e-6)
    assert float(rows[0]["EDI_error_lx"]) == pytest.approx(found.edi_error_lx[0], rel=1e-6)
    for name, values in (("Duv", found.spectral.duv_error), ("DER", found.spectral.der_error)):
        assert float(rows[0][f"{name}_error"]) == pytest.approx(values[0], rel=1e-6)
    assert float(rows[1]["EDI_melanopic_lx"]) == pytest.approx(
        found.spectral.melanopic_edi_lx[1], rel=1e-6
    )
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "mean correlated colour temperature" in text and "modelled in 20 bands" in text


def test_reports_name_the_models_of_colour():
    from patchlight.pipeline.freezing import frozen_scene
    from patchlight.reports.inputs import light_facts

    sun = Sun(40.0, 150.0, normal_illuminance_lx=60_000.0, color="spectrl2")
    scene = lit_room(True, sky=CIESky(12, **CLEAR, color="chain"), sun=sun)
    facts = dict(light_facts(frozen_scene(scene)))
    assert "colour by direction modelled (Chain et al. 1999" in facts["Sky"]
    assert "colour by altitude modelled (Bird and Riordan 1986" in facts["Sun"]
