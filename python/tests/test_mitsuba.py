"""Snow in Mitsuba scenes is compared with look-ups."""

import importlib
import math
import re
import sys

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from conftest import ROOT

import splitsnow
import splitsnow.mitsuba
from splitsnow.mitsuba._llvm import check_llvm
from splitsnow.mitsuba._look_up import LookUp
from splitsnow.mitsuba._table import Material, Table

VARIANTS = ["scalar_spectral", "llvm_ad_spectral", "scalar_rgb", "llvm_ad_rgb"]
SNOW = (0.4, 260.0, 270.0)
NAMED = dict(zip(("facetness", "grain_size_um", "density_kg_m3"), SNOW))
UNIFORM = {"type": "spectrum", "value": 2.0}
NM = np.arange(360, 831, 5.0)
FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


@pytest.fixture(params=VARIANTS)
def variant(request):
    use(request.param)
    return request.param


@pytest.fixture(autouse=True)
def scenes():
    """Detaches the scenes of a test afterwards; otherwise the next test would compile them."""
    yield
    while _scenes:
        variant, scene = _scenes.pop()
        mi.set_variant(variant)
        splitsnow.mitsuba.detach(scene)


_scenes = []


def use(variant):
    mi.set_variant(variant)
    splitsnow.mitsuba.register()


def slab(entries, bottom=0.0, top=0.1, half_width=20.0):
    """A wide slab between two heights."""
    middle, half = (bottom + top) / 2, (top - bottom) / 2
    pose = mi.ScalarTransform4f().translate([0, 0, middle]).scale([half_width, half_width, half])
    return {"type": "cube", "to_world": pose, **entries}


def scene_of(spp=16, size=2, **shapes):
    """A scene with a camera that looks at the origin from below."""
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
    sensor = {
        "type": "perspective",
        "fov": 0.5,
        "film": film,
        "sampler": {"type": "independent", "sample_count": spp},
        "to_world": mi.ScalarTransform4f().look_at([0, 0, -5], [0, 0, 0], [0, 1, 0]),
    }
    scene = mi.load_dict({"type": "scene", "path": {"type": "path"}, "eye": sensor, **shapes})
    assert splitsnow.mitsuba.attach(scene) > 0
    _scenes.append((mi.variant(), scene))
    return scene


def towards(angle_deg):
    angle = math.radians(angle_deg)
    return [math.sin(angle), 0.0, math.cos(angle)]


def snow(database, **options):
    options = {"irradiance": UNIFORM, "reflected": False, "to_light": [0, 0, 1], **options}
    return splitsnow.mitsuba.snow(database.path, **{**NAMED, **options})


def pixel(scene):
    return np.array(mi.render(scene)).mean((0, 1))


def radiances(scene, origins, direction, nm=(450, 520, 600, 680)):
    """Radiance along rays from `origins`, ``(rays, wavelengths or colours)``."""
    found = []
    for start in [np.transpose(origins)] if "llvm" in mi.variant() else origins:
        ray = mi.Ray3f(mi.Point3f(*start), mi.Vector3f(*direction))
        if mi.is_spectral:
            ray.wavelengths = mi.UnpolarizedSpectrum(*map(float, nm))
        si = scene.ray_intersect(ray)
        values = si.emitter(scene).eval(si, si.is_valid())
        found.append(np.array(values).reshape(len(values), -1).T)
    return np.concatenate(found)


def radiance(scene, nm=(450, 520, 600, 680)):
    return radiances(scene, [[0.01, 0.02, -5]], [0, 0, 1], nm)[0]


def expected(database, thickness_cm, angle_deg, nm=(450, 520, 600, 680), **conditions):
    """The radiance from the formula under UNIFORM, in the format of :func:`radiance`; in rgb
    variants as a pixel."""
    rgb = not mi.is_spectral
    spectrum = database.transmittance(
        *NAMED.values(), thickness_cm, angle_deg, wavelengths_nm=NM if rgb else nm, **conditions
    )
    found = 2 * math.cos(math.radians(angle_deg)) * spectrum / math.pi
    return FROM_XYZ @ splitsnow.xyz(found, NM) if rgb else found


@pytest.mark.parametrize("thickness_cm, angle_deg", [(1, 0), (2.5, 70), (5, 30), (14, 45)])
def test_backlit_slab(variant, quick, thickness_cm, angle_deg):
    entries = snow(quick, to_light=towards(angle_deg))
    scene = scene_of(slab=slab(entries, top=thickness_cm / 100))
    along_cm = thickness_cm / math.cos(math.radians(angle_deg))
    assert np.allclose(radiance(scene), expected(quick, along_cm, angle_deg), rtol=1e-3)


@pytest.mark.parametrize("angle_deg", [0, 50])
def test_pixels_match_the_look_up(variant, quick, angle_deg):
    scene = scene_of(4096, slab=slab(snow(quick, to_light=towards(angle_deg)), top=0.04))
    rendered = pixel(scene)
    spectrum = quick.transmittance(
        *SNOW, 4 / math.cos(math.radians(angle_deg)), angle_deg, wavelengths_nm=NM
    )
    spectrum = 2 * math.cos(math.radians(angle_deg)) * spectrum / math.pi
    assert np.allclose(rendered, FROM_XYZ @ splitsnow.xyz(spectrum, NM), rtol=0.01)


def test_irradiance_follows_mitsuba(quick):
    """A number means D65, and D65 is white. A tabulated spectrum is used exactly."""
    use("llvm_ad_rgb")
    plain = pixel(scene_of(slab=slab(snow(quick, irradiance=2.0))))
    white = pixel(scene_of(slab=slab(snow(quick, irradiance={"type": "d65", "scale": 2.0}))))
    assert np.allclose(plain, white)
    colour = quick.srgb(*SNOW, 10, 0, illuminant="D65", linear=True, clip=False)
    assert np.allclose(plain, 2 / math.pi * colour, rtol=0.02)  # from 400-700 nm only
    tinted = pixel(scene_of(slab=slab(snow(quick, irradiance={"type": "rgb", "value": [2, 0, 1]}))))
    assert np.allclose(tinted, plain * [1, 0, 0.5])
    lamp = [(500.0, 1.0), (560.0, 3.0), (600.0, 0.5)]
    given = {"type": "spectrum", "value": lamp}
    narrow = pixel(scene_of(slab=slab(snow(quick, irradiance=given))))
    shape = np.interp(NM, *np.transpose(lamp), left=0, right=0)
    spectrum = shape * quick.transmittance(*SNOW, 10, 0, wavelengths_nm=NM) / math.pi
    assert np.allclose(narrow, np.maximum(FROM_XYZ @ splitsnow.xyz(spectrum, NM), 0), rtol=2e-3)


def test_scalar_and_llvm_agree(quick):
    """On a sphere under oblique light, at the same points."""
    origins = [[x, y, -5] for x in np.linspace(-0.9, 0.9, 9) for y in (-0.35, 0.1, 0.3)]
    for kind in ("rgb", "spectral"):
        found = {}
        for variant in (f"scalar_{kind}", f"llvm_ad_{kind}"):
            use(variant)
            entries = snow(quick, to_light=[1, 0.2, 0.5], metres_per_unit=0.05)
            scene = scene_of(ball={"type": "sphere", **entries})
            found[variant] = radiances(scene, origins, [0, 0, 1])
        scalar, llvm = found.values()
        assert scalar.shape == (27, len(scalar[0])) and (scalar == 0).any() and (scalar > 0).any()
        assert np.allclose(scalar, llvm, rtol=1e-3, atol=1e-6)


def test_a_sphere_transmits_along_its_chords(quick):
    use("llvm_ad_spectral")
    scene = scene_of(ball={"type": "sphere", **snow(quick, metres_per_unit=0.04)})
    x = np.array([0.0, 0.3, 0.6, 0.9])
    found = radiances(scene, np.stack([x, 0 * x, 0 * x - 5], -1), [0, 0, 1])
    for distance, values in zip(x, found):
        half = math.sqrt(1 - distance**2)
        wanted = expected(quick, 8 * half, math.degrees(math.acos(half)))
        assert np.allclose(values, wanted, rtol=2e-3)


def boxes(path, heights):
    """Writes a mesh of boxes, one above another."""
    corners = [(x, y) for x, y in ((-20, -20), (20, -20), (20, 20), (-20, 20))]
    lines, faces = [], []
    for bottom, top in heights:
        first = len(lines) + 1
        lines += [f"v {x} {y} {z}" for z in (bottom, top) for x, y in corners]
        around = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
        for face in [(3, 2, 1, 0), (4, 5, 6, 7), *around]:
            faces.append("f " + " ".join(str(first + i) for i in face))
    path.write_text("\n".join(lines + faces) + "\n")
    return str(path)


def test_thicknesses_of_pieces_add(variant, quick, tmp_path):
    """Also for separate shapes that are apart, touch or overlap. Different snow is opaque."""
    two = boxes(tmp_path / "two.obj", [(0, 0.02), (0.07, 0.1)])
    mesh = {"type": "obj", "filename": two, "face_normals": True}
    entries = snow(quick, to_light=towards(40))
    wanted = expected(quick, 5 / math.cos(math.radians(40)), 40)
    assert np.allclose(radiance(scene_of(both={**mesh, **entries})), wanted, rtol=1e-3)
    for bottom in (0.015, 0.02, 0.03):
        top = max(0.05, bottom + 0.03)
        lower, upper = slab(entries, top=0.02), slab(entries, bottom, top)
        for a, b in ((lower, upper), (upper, lower)):
            assert np.allclose(radiance(scene_of(a=a, b=b)), wanted, rtol=1e-3)
    other = snow(quick, to_light=towards(40), facetness=0.5)
    assert (radiance(scene_of(a=slab(entries, top=0.02), b=slab(other, 0.03, 0.06))) == 0).all()
    # a lit surface of snow shows the light transmitted by the snow above it
    facing = radiances(scene_of(a=slab(entries, top=0.02), b=slab(entries, 0.5, 0.55)),
                       [[0.01, 0, 0.3]], [0, 0, -1])[0]  # fmt: skip
    assert np.allclose(facing, wanted, rtol=1e-3)


def test_shadows_and_the_illuminated_side(variant, quick):
    to_world = mi.ScalarTransform4f().translate([0, 0, 3])
    card = {"type": "rectangle", "to_world": to_world}
    lit = expected(quick, 10, 0)
    assert (radiance(scene_of(slab=slab(snow(quick)), card=card)) == 0).all()
    ignored = snow(quick, shadows=False)
    assert np.allclose(radiance(scene_of(slab=slab(ignored), card=card)), lit, rtol=1e-3)
    scene = scene_of(slab=slab(snow(quick)))
    above = radiances(scene, [[0.01, 0.02, 3]], [0, 0, -1])
    assert (above == 0).all() and np.allclose(radiance(scene), lit, rtol=1e-3)


def test_incidence_angles_outside_the_database_give_no_light(variant, quick):
    for angle_deg, lit in ((79.5, True), (81, False)):
        scene = scene_of(slab=slab(snow(quick, to_light=towards(angle_deg)), top=0.01))
        assert (radiance(scene) > 0).all() == lit


def test_thick_snow_is_dark_and_blue(quick):
    use("llvm_ad_rgb")
    seen = [pixel(scene_of(slab=slab(snow(quick), top=top))) for top in (0.01, 0.03, 0.1, 0.3)]
    red, green, blue = np.transpose(seen)
    assert (np.diff(green) < 0).all() and (np.diff(blue / red) > 0).all()
    assert blue[0] / red[0] < 1.1 and blue[3] / red[3] > 2


def test_conditions(variant, sooty):
    for soot in (0, 60):
        entries = splitsnow.mitsuba.snow(
            sooty.path, grain_size_um=260, to_light=[0, 0, 1], irradiance=UNIFORM,
            reflected=False, black_carbon_ng_g=soot,
        )  # fmt: skip
        scene = scene_of(slab=slab(entries, top=0.05))
        nm = [460, 500, 550, 640]
        shown = NM if not mi.is_spectral else nm
        spectrum = sooty.transmittance(
            0.3, 260, 250, 5, 0, wavelengths_nm=shown, black_carbon_ng_g=soot
        )
        wanted = 2 / math.pi * spectrum
        if not mi.is_spectral:
            wanted = FROM_XYZ @ splitsnow.xyz(wanted, NM)
        assert np.allclose(radiance(scene, nm), wanted, rtol=1e-3)


@pytest.mark.parametrize("variant", VARIANTS[:2])
def test_wavelengths_outside_are_clamped(variant, quick):
    use(variant)
    scene = scene_of(slab=slab(snow(quick)))
    ends = quick.wavelengths_nm[[0, 0, -1, -1]]
    assert np.allclose(
        radiance(scene, (360, 400, 700, 830)), expected(quick, 10, 0, ends), rtol=1e-3
    )


def test_the_table_reproduces_the_database(quick, tailored):
    rng = np.random.default_rng(1)
    thickness_cm = 100 * rng.random(20_000) ** np.repeat([1, 4], 10_000)
    for database, parameters in ((quick, SNOW), (tailored, (0.3, 300.0, 300.0))):
        material = Material(database, parameters, {})
        angle_deg = rng.uniform(*database.axes["angle_deg"][[0, -1]], 20_000)
        nm = np.array([380, 433, 567, 701.0])
        use("llvm_ad_spectral")
        look_up = LookUp(mi, dr, Table.spectral(material))
        waves = mi.UnpolarizedSpectrum(*map(float, nm))
        arguments = (mi.Float(thickness_cm), mi.Float(np.cos(np.radians(angle_deg))))
        found = np.array(look_up.spectrum(*arguments, waves, True)).T
        wanted = database.transmittance(*parameters, thickness_cm, angle_deg, wavelengths_nm=nm)
        significant = wanted > 1e-4
        assert significant.mean() > 0.3
        error = np.abs(found / wanted - 1)
        known = thickness_cm <= database.axes["thickness_cm"][-1]
        assert error[known][significant[known]].max() < 2e-4
        # Deeper, look-ups go on with the decay at each angle, which noise makes differ. Between
        # angles they are then no longer linear in the logarithm, as the table is.
        assert error[significant].max() < 2e-3
        use("llvm_ad_rgb")
        look_up = LookUp(mi, dr, Table.colour(material, None))
        arguments = (mi.Float(thickness_cm), mi.Float(np.cos(np.radians(angle_deg))))
        found = np.array(look_up.colour(*arguments, True)).T
        spectra = database.transmittance(*parameters, thickness_cm, angle_deg, wavelengths_nm=NM)
        wanted = np.maximum(splitsnow.srgb(spectra, NM, "D65", linear=True, clip=False), 0)
        brightest = wanted.max(-1, keepdims=True)
        assert (np.abs(found - wanted) / brightest)[brightest[:, 0] > 1e-4].max() < 3e-4


@pytest.mark.parametrize("variant", ["llvm_ad_spectral", "llvm_ad_rgb"])
def test_sky(variant, quick):
    """The mean equals the integral over the directions that the database covers. Single values
    scatter less than those of uniform directions would, by more than half."""
    use(variant)
    origins = np.random.default_rng(2).uniform(-0.5, 0.5, (40_000, 3)) - [0, 0, 5]
    cosine = np.linspace(math.cos(math.radians(80)), 1, 2001)
    middle = (cosine[1:] + cosine[:-1]) / 2
    nm = NM if not mi.is_spectral else [450, 520, 600, 680]
    spectra = quick.transmittance(
        *SNOW, 3 / middle, np.degrees(np.arccos(middle)), wavelengths_nm=nm
    )
    wanted = (spectra * middle[:, None]).sum(0) * (cosine[1] - cosine[0]) * 2 * 2 / math.pi
    if not mi.is_spectral:
        wanted = FROM_XYZ @ splitsnow.xyz(wanted, NM)
    for up, share in ((None, 1), ([0, 0, 1], 1), ([1, 0, 0], 0.5), ([0, 0, -1], 0)):
        entries = snow(quick, light="sky", to_light=None, up=up)
        scene = scene_of(slab=slab(entries, top=0.03))
        found = radiances(scene, origins, [0, 0, 1])
        assert np.allclose(found.mean(0), share * wanted, rtol=0.02)
        if mi.is_spectral and share == 1:
            # Uniform directions: values of 0 outside the file, else of this light.
            light = spectra * middle[:, None]
            squares = (light**2).sum(0) * (cosine[1] - cosine[0])
            uniform = np.sqrt(squares * (2 * 2 / math.pi / wanted) ** 2 - 1)
            print("relative scatter", found.std(0) / wanted, "of uniform directions", uniform)
            assert (found.std(0) / wanted < 0.5 * uniform).all()


def test_reflection(quick):
    use("llvm_ad_rgb")
    sun = {"type": "directional", "direction": [0, 0, 1], "irradiance": {"type": "rgb", "value": 2}}
    both = snow(quick, reflected=True, reflectance_angle_deg=30)
    seen = pixel(scene_of(4096, slab=slab(both), sun=sun))
    through = pixel(scene_of(slab=slab(both)))
    spectrum = quick.reflectance(*SNOW, quick.axes["thickness_cm"][-1], 30, wavelengths_nm=NM)
    wanted = splitsnow.srgb(spectrum, NM, "D65", linear=True) * 2 / math.pi
    assert np.allclose(seen - through, wanted, rtol=0.02)
    assert snow(quick, reflected=0.5, transmitted=False).keys() == {"bsdf"}
    own = snow(quick, reflected=True, reflectance=0.5, transmitted=False)
    scene = scene_of(4096, a=slab(snow(quick), 9, 10), b=slab(own), sun=sun)
    assert np.allclose(pixel(scene), 1 / math.pi, rtol=0.02)


@pytest.mark.parametrize("turn_deg", [0, 90])
def test_snow_illuminates_its_surroundings(quick, turn_deg):
    """For each face of the cube above a white sheet, emitter sampling and BSDF sampling give the
    same light."""
    use("llvm_ad_rgb")
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}
    to_world = mi.ScalarTransform4f().translate([0, 0, -0.5])
    sheet = {"type": "rectangle", "bsdf": white, "to_world": to_world}
    turned = mi.ScalarTransform4f().translate([0, 0, 3]).rotate([1, 0, 0], turn_deg).scale(3)
    entries = snow(quick, metres_per_unit=0.01)
    scene = scene_of(slab={"type": "cube", "to_world": turned, **entries}, sheet=sheet)
    sensor = mi.load_dict({
        "type": "perspective", "fov": 0.5,
        "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
        "to_world": mi.ScalarTransform4f().look_at([-8, 0, -0.2], [0, 0, -0.5], [0, 0, 1]),
    })  # fmt: skip
    seen = []
    for samples in ((1, 0), (0, 1)):
        options = dict(zip(("emitter_samples", "bsdf_samples"), samples))
        direct = mi.load_dict({"type": "direct", **options})
        image = np.array(mi.render(scene, sensor=sensor, integrator=direct, spp=32768))
        seen.append(image.mean((0, 1)))
    assert (seen[0] > 0.4 * expected(quick, 6, 0)).all()
    assert np.allclose(*seen, rtol=0.02)


def test_surfaces_facing_the_light_are_dark(tailored):
    """Also at grazing angles, where positions on large triangles are inaccurate."""
    use("llvm_ad_rgb")
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 35).rotate([0, 1, 0], 20)
    to_world = turn.scale([20, 20, 0.05])
    down = np.array(turn @ mi.ScalarVector3f(0, 0, -1)).ravel()
    along = np.array(turn @ mi.ScalarVector3f(1, 0, 0)).ravel()
    origins = np.random.default_rng(4).uniform(-5, 5, (50_000, 3)) * [1, 1, 0] - [0, 0, 20]
    for grazing in (1, 0.1, 0.02):
        to_light = along + grazing * down
        entries = splitsnow.mitsuba.snow(tailored.path, to_light=to_light, reflected=False)
        scene = scene_of(slab={"type": "cube", "to_world": to_world, **entries})
        assert (radiances(scene, origins, [0, 0, 1]) == 0).all(), grazing


def test_parameters_can_be_changed(quick):
    use("llvm_ad_rgb")
    scene = scene_of(slab=slab(snow(quick, irradiance={"type": "rgb", "value": 1.0})))
    before = pixel(scene)
    parameters = mi.traverse(scene)
    (key,) = [key for key in parameters.keys() if key.endswith("irradiance.value")]
    parameters[key] = mi.Color3f(3.0)
    parameters.update()
    assert np.allclose(pixel(scene), 3 * before)
    texture = mi.load_dict(snow(quick)["emitter"]["radiance"])
    assert "facetness" not in repr(texture) and "PcaSnow" in repr(texture)
    assert 0 < texture.mean() <= texture.max()
    splitsnow.mitsuba.detach(scene)
    assert (pixel(scene) == 0).all()


def test_unattached_snow_is_an_error(variant, quick):
    scene = mi.load_dict({"type": "scene", "slab": slab(snow(quick))})
    with pytest.raises(Exception, match=r"call splitsnow.mitsuba.attach\(scene\)"):
        radiance(scene)
    splitsnow.mitsuba.attach(scene)
    assert (radiance(scene) > 0).all()
    splitsnow.mitsuba.detach(scene)
    assert (radiance(scene) == 0).all()


def test_invalid_parameters_are_rejected(quick, sooty, tailored, tmp_path):
    use("llvm_ad_rgb")
    plain = snow(quick)["emitter"]["radiance"]
    for message, change in {
        "filename is needed": {"filename": None},
        "cannot open|No such file": {"filename": str(tmp_path / "none.safetensors")},
        "facetness = 2 is outside": {"facetness": 2.0},
        "facetness is needed": {"facetness": None},
        "to_light is needed": {"to_light": None},
        "to_light must be": {"to_light": [0, 0, 0]},
        "directional or sky": {"light": "lamp"},
        "metres_per_unit must be": {"metres_per_unit": -1.0},
        "no optional axis is named `colour`": {"colour": 3.0},
        "temper must be a number": {"temper": "cold"},
    }.items():
        wrong = {key: value for key, value in {**plain, **change}.items() if value is not None}
        with pytest.raises(Exception, match=message):
            mi.load_dict(wrong)
    with pytest.raises(FileNotFoundError):
        splitsnow.mitsuba.snow(tmp_path / "none.safetensors")
    with pytest.raises(ValueError, match="has no reflectance: set"):
        splitsnow.mitsuba.snow(tailored.path, to_light=[0, 0, 1])
    with pytest.raises(ValueError, match="grain_size_um is needed: .* covers 200 to 400"):
        splitsnow.mitsuba.snow(sooty.path)
    with pytest.raises(ValueError, match="no shape of the scene is snow"):
        splitsnow.mitsuba.attach(mi.load_dict({"type": "scene", "a": {"type": "sphere"}}))
    for variant, message in (("llvm_ad_mono_polarized", "polarisation"),):
        mi.set_variant(variant)
        with pytest.raises(RuntimeError, match=message):
            splitsnow.mitsuba.register()


def test_missing_dependencies_are_named(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setenv("DRJIT_LIBLLVM_PATH", "/no/such/libLLVM.so")
        with pytest.raises(RuntimeError, match="apt install libllvm19"):
            check_llvm.__wrapped__()
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(ImportError, match="pip install mitsuba"):
        splitsnow.mitsuba.register()


def test_mitsuba_reads_exported_spectra(run, quick, tmp_path):
    """Mitsuba reads the output of `export --format spd`."""
    use("scalar_spectral")
    file = tmp_path / "snow.spd"
    point = (0.3, 250, 300, 4.5, 33)
    names = "facetness grain-size-um density-kg-m3 thickness-cm incidence-angle-deg".split()
    args = [f"--{name}={value}" for name, value in zip(names, point)]
    run("export", quick.path, "--format", "spd", "--out", file, *args)
    spectrum = mi.load_dict({"type": "spectrum", "filename": str(file)})
    si = mi.SurfaceInteraction3f()
    si.wavelengths = [450, 515, 600, 690]
    expected = quick.transmittance(*point, wavelengths_nm=[450, 515, 600, 690])
    assert np.allclose(np.array(spectrum.eval(si)).ravel(), expected, rtol=1e-4)


@pytest.mark.parametrize("file", ["README.md", "docs/mitsuba.md"])
def test_documented_examples_run(file, monkeypatch):
    text = (ROOT / file).read_text()
    codes = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (code,) = [code for code in codes if "splitsnow.mitsuba" in code]
    names = {}
    monkeypatch.chdir(ROOT)
    exec(code, names)
    _scenes.append((mi.variant(), names["scene"]))
    if "image" in names:
        image = np.array(names["image"])
        assert image.max() > 0.005 and image[..., 2].sum() > image[..., 0].sum()


@pytest.mark.parametrize("variant", ["llvm_ad_spectral", "scalar_rgb"])
def test_example_blocks(variant, monkeypatch, tmp_path):
    """From left to right the blocks become darker and bluer; the first is nearly white. Each
    matches the look-up at its thickness, plus a few per cent reflected by the substrate."""
    monkeypatch.syspath_prepend(str(ROOT / "examples/mitsuba"))
    blocks = importlib.import_module("blocks")
    out = tmp_path / "blocks"
    size = ["--size", "80", "--spp", "128" if "llvm" in variant else "8"]
    monkeypatch.setattr(sys, "argv", ["blocks", *size, "--variant", variant, "--out", str(out)])
    blocks.stage.main(*blocks.PICTURE)
    image = np.array(mi.Bitmap(str(out.with_suffix(".exr"))))
    shown = np.array(mi.Bitmap(str(out.with_suffix(".png"))))
    assert image.shape == shown.shape == (40, 80, 3)
    columns = [10, 28, 45, 62]
    seen = np.array([image[14:22, x : x + 9].mean((0, 1)) for x in columns])
    database = splitsnow.Database.open(blocks.FILE)
    assert (database.wavelengths_nm[[0, -1]] == [360, 830]).all()
    spectra = database.transmittance(0.3, 300, 275, blocks.THICKNESSES_CM, 0, wavelengths_nm=NM)
    wanted = splitsnow.srgb(spectra, NM, "D65", linear=True, clip=False) / math.pi
    seen, wanted = np.maximum(seen, 0), np.maximum(wanted, 0)  # blue out of gamut
    assert (np.abs(seen - wanted) < 0.05 * wanted.max(-1, keepdims=True)).all()
    assert (np.diff(seen, axis=0) < 0).all()
    assert (wanted[:, 2] < seen[:, 2]).all()
    red, green, blue = seen.T
    assert 0.8 < red[0] / blue[0] < 1 and (np.diff(red / blue) < 0).all()
    bytes_seen = np.array([shown[14:22, x : x + 9].mean((0, 1)) for x in columns])
    assert (bytes_seen[0] > 200).all() and bytes_seen[3, 0] < 20 and bytes_seen[3, 2] > 60
    assert image[:3].max() < 1e-5  # above the blocks
