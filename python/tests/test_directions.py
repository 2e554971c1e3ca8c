"""Look-ups of the light toward views, in files made of arrays."""

import inspect
import pickle
import re

import numpy as np
import pytest
from compact import write_compact
from conftest import ROOT

import splitsnow
from splitsnow import _native

SLAB = {
    "facetness": [0.1, 0.5],
    "grain_size_um": [100, 300],
    "density_kg_m3": [200, 400],
    "thickness_cm": [1, 4, 30],
}
INCIDENCES = [0, 20, 40, 60]
VIEWS = {"view_deg": [0, 20, 40, 60], "relative_azimuth_deg": [0, 60, 120, 180]}
NM = np.linspace(400, 700, 31)
POINT = (0.3, 250, 300, 10, 50)
VIEW = {"view_deg": 35, "relative_azimuth_deg": 100}
OUTPUT = {
    False: ("snow.safetensors", "views.safetensors"),
    True: ("diffuse.safetensors", "views_diffuse.safetensors"),
}


def write_output(folder, diffuse, optional=None, quantities=("transmittance", "reflectance")):
    """Writes the two files of an output directory; the factors are random."""
    random = np.random.default_rng(7)
    axes = {**(optional or {}), **SLAB, "angle_deg": [0] if diffuse else INCIDENCES}
    views = {**VIEWS, "relative_azimuth_deg": [0]} if diffuse else VIEWS
    shape = tuple(map(len, axes.values())) + (len(NM),)
    more = tuple(map(len, views.values()))
    database, anisotropy = (folder / name for name in OUTPUT[diffuse])
    write_compact(
        database, axes, NM, {q: random.uniform(0.1, 0.9, shape) for q in quantities}, diffuse
    )
    factors = {q: random.uniform(0.5, 2, more + shape) for q in quantities}
    for factor in () if diffuse else factors.values():
        # there is one direction along the normal
        factor[0] = factor[0, :1]
    write_compact(anisotropy, {**views, **axes}, NM, factors, diffuse)
    return {q: factor.astype(np.float32) for q, factor in factors.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An output directory with collimated and diffuse light."""
    return tmp_path_factory.mktemp("brdf")


@pytest.fixture(scope="module")
def factors(folder):
    return {diffuse: write_output(folder, diffuse) for diffuse in (False, True)}


@pytest.fixture(scope="module")
def sun(folder, factors):
    return splitsnow.Directions(folder)


@pytest.fixture(scope="module")
def sky(folder, factors):
    return splitsnow.Directions(folder, diffuse=True)


@pytest.fixture(scope="module")
def cold(tmp_path_factory):
    """An output directory with the temperature as an axis."""
    folder = tmp_path_factory.mktemp("cold")
    write_output(folder, False, {"temperature_c": [-20, 0]})
    return folder


def test_nodes_are_exact(sun, factors):
    axes = sun.axes
    grid = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij", sparse=True)))
    stored = factors[False]["reflectance"]
    assert np.array_equal(sun.anisotropy_factor(**grid), stored)
    database = splitsnow.Database(sun.path)
    slab = {name: grid[name] for name in database.axes}
    reflectance = database.reflectance(**slab)
    assert np.array_equal(sun.brf(**grid), stored * reflectance)
    transmittance = database.transmittance(**slab)
    assert np.array_equal(sun.btf(**grid), factors[False]["transmittance"] * transmittance)


def test_nodes_are_exact_under_diffuse_light(sky, factors, folder):
    grid = dict(zip(sky.axes, np.meshgrid(*sky.axes.values(), indexing="ij", sparse=True)))
    del grid["angle_deg"], grid["relative_azimuth_deg"]
    database = splitsnow.Database(folder / OUTPUT[True][0])
    slab = {name: grid[name][..., 0, 0] for name in database.axes if name in grid}
    grid = {name: values[:, 0, ..., 0] for name, values in grid.items()}
    slab = {name: values for name, values in grid.items() if name != "view_deg"}
    stored = {q: factor[:, 0, ..., 0, :] for q, factor in factors[True].items()}
    assert np.array_equal(sky.anisotropy_factor(**grid), stored["reflectance"])
    expected = stored["reflectance"] * database.reflectance(**slab, incidence_angle_deg=0)
    assert np.array_equal(sky.hdrf(**grid), expected)
    expected = stored["transmittance"] * database.transmittance(**slab, incidence_angle_deg=0)
    assert np.array_equal(sky.hdtf(**grid), expected)


def test_brf_is_the_anisotropy_factor_times_the_reflectance(sun):
    database = splitsnow.Database(sun.path)
    for thickness in (0, 0.5, 7, 100):
        point = (0.3, 250, 300, thickness, 50)
        factor = sun.anisotropy_factor(*point, **VIEW)
        assert factor.dtype == np.float32 and factor.shape == (31,)
        assert np.array_equal(sun.brf(*point, **VIEW), factor * database.reflectance(*point))
    assert not np.allclose(sun.btf(*POINT, **VIEW), sun.brf(*POINT, **VIEW))


def test_the_factor_is_symmetric_about_the_plane_of_incidence(sun):
    azimuth = np.array([0, 10, 100, 170, 180])
    expected = sun.brf(*POINT, view_deg=35, relative_azimuth_deg=azimuth)
    for same in (-azimuth, 360 - azimuth, azimuth + 720):
        found = sun.brf(*POINT, view_deg=35, relative_azimuth_deg=same)
        assert np.allclose(found, expected, rtol=1e-6)
    along_normal = sun.brf(*POINT, view_deg=0, relative_azimuth_deg=azimuth)
    assert np.allclose(along_normal, along_normal[0], rtol=1e-6)


def test_the_azimuth_has_no_effect_under_diffuse_light(sky):
    expected = sky.hdrf(*POINT[:4], view_deg=35)
    azimuth = [0, 77, -500, np.nan]
    found = sky.hdrf(*POINT[:4], 0, view_deg=35, relative_azimuth_deg=azimuth)
    assert found.shape == (4, 31) and (found == expected).all()
    assert np.array_equal(
        sky.anisotropy_factor(*POINT[:4], view_deg=35),
        sky.anisotropy_factor(*POINT[:4], 0, view_deg=35, relative_azimuth_deg=90),
    )


def test_broadcasting(sun):
    view, azimuth = np.array([0, 30, 55]), np.array([[0.0], [90.0]])
    found = sun.brf(*POINT, view_deg=view, relative_azimuth_deg=azimuth)
    assert found.shape == (2, 3, 31)
    for i, j in np.ndindex(2, 3):
        single = sun.brf(*POINT, view_deg=view[j], relative_azimuth_deg=azimuth[i, 0])
        assert np.array_equal(found[i, j], single)
    assert sun.btf(0.3, 250, [300, 350], 10, 50, **VIEW).shape == (2, 31)
    assert sun.brf(*POINT, view_deg=[], relative_azimuth_deg=0).shape == (0, 31)
    with pytest.raises(ValueError, match="broadcast"):
        sun.brf(*POINT, view_deg=[10, 20], relative_azimuth_deg=[0, 90, 180])


def test_many_points_equal_single_points(sun):
    """Uses more points than one task processes."""
    low, high = zip(*((nodes[0], nodes[-1]) for nodes in sun.axes.values()))
    points = np.random.default_rng(1).uniform(low, high, (5000, len(low)))
    point = lambda values: dict(zip(sun.axes, values))
    found = sun.brf(**point(points.T))
    for i in (0, 1023, 1024, 4999):
        assert np.array_equal(found[i], sun.brf(**point(points[i])))
    points[3000, 0] = 61
    points[4500, 1] = np.nan
    with pytest.raises(ValueError, match=r"^element \[3000\]: view_deg = 61 is outside"):
        sun.brf(**point(points.T))


def test_optional_axes(cold):
    found = splitsnow.Directions(cold)
    assert list(found.axes)[:3] == ["view_deg", "relative_azimuth_deg", "temperature_c"]
    database = splitsnow.Database(cold)
    for temperature in (-20, -7, 0, -20):
        factor = found.anisotropy_factor(*POINT, **VIEW, temperature_c=temperature)
        expected = factor * database.reflectance(*POINT, temperature_c=temperature)
        assert np.array_equal(found.brf(*POINT, **VIEW, temperature_c=temperature), expected)
        conditions = {"temperature_c": temperature}
        assert np.array_equal(found.brf(*POINT, **VIEW, conditions=conditions), expected)
    for temperature in np.linspace(-20, 0, 10):  # more than the cache holds
        found.brf(*POINT, **VIEW, temperature_c=temperature)
    assert np.array_equal(found.brf(*POINT, **VIEW, temperature_c=-20), expected)
    with pytest.raises(ValueError, match="give a value of temperature_c from -20 to 0"):
        found.brf(*POINT, **VIEW)
    with pytest.raises(ValueError, match="temperature_c = 5 is outside"):
        found.brf(*POINT, **VIEW, temperature_c=5)


def test_spectra_are_interpolated_between_wavelengths(sun):
    nm = np.arange(380, 721, 7.5)
    own, found = sun.brf(*POINT, **VIEW), sun.brf(*POINT, **VIEW, wavelengths_nm=nm)
    assert np.allclose(found, np.interp(nm, NM, own), rtol=1e-6)
    with pytest.raises(ValueError, match="the database covers 400 to 700 nm"):
        sun.brf(*POINT, **VIEW, wavelengths_nm=nm, clamp=False)


def test_invalid_arguments_are_rejected(sun, sky):
    for message, call in {
        "^view_deg = 60.1 is outside the database, which covers 0 to 60": lambda: sun.brf(
            *POINT, view_deg=60.1, relative_azimuth_deg=0
        ),
        "^view_deg = -5 is outside": lambda: sky.hdrf(*POINT[:4], view_deg=-5),
        "^relative_azimuth_deg = NaN is outside": lambda: sun.btf(
            *POINT, view_deg=30, relative_azimuth_deg=np.nan
        ),
        "^incidence_angle_deg = 70 is outside": lambda: sun.brf(*POINT[:4], 70, **VIEW),
        "^incidence_angle_deg = 50 is outside": lambda: sky.hdrf(*POINT, view_deg=30),
        "^thickness_cm = -1 is outside": lambda: sun.anisotropy_factor(
            0.3, 250, 300, -1, 50, **VIEW
        ),
        "^brf needs collimated light and the files are of diffuse light; ask for hdrf, or open "
        "them with diffuse=False": lambda: sky.brf(*POINT, **VIEW),
        "^hdtf needs diffuse light and .* ask for btf, or open them with diffuse=True": (
            lambda: sun.hdtf(*POINT, **VIEW)
        ),
        "the database has no axis sphericity": lambda: sun.brf(*POINT, **VIEW, sphericity=0.8),
        "no optional axis is named `soot`; use one of black": lambda: sun.brf(
            *POINT, **VIEW, soot=3
        ),
        "^view_deg is an argument of its own": lambda: sun.brf(
            *POINT, **VIEW, conditions={"view_deg": 20}
        ),
    }.items():
        with pytest.raises(ValueError, match=message):
            call()
    with pytest.raises(TypeError, match="view_deg"):
        sun.brf(*POINT, relative_azimuth_deg=0)
    with pytest.raises(TypeError, match="needs incidence_angle_deg and relative_azimuth_deg"):
        sun.anisotropy_factor(*POINT, view_deg=30)


def test_files_that_do_not_belong_together_are_refused(folder, sun, sky, cold, tmp_path):
    database, anisotropy = (folder / name for name in OUTPUT[False])
    paths = {
        "holds reflectance and transmittance, not anisotropy factors": (database, database),
        "holds anisotropy factors, not reflectance": (anisotropy, anisotropy),
        "have different temperature_c": (database, cold / "views.safetensors"),
        "have different incidence_angle_deg": (database, folder / "views_diffuse.safetensors"),
        "is of diffuse light, not collimated; open it with diffuse=True": (
            folder / "diffuse.safetensors",
            folder / "views_diffuse.safetensors",
        ),
        "is of collimated light, not diffuse; open it with diffuse=False": (
            database,
            anisotropy,
            True,
        ),
        "is a single file; give the output directory": (database,),
    }
    for message, arguments in paths.items():
        with pytest.raises(ValueError, match=message):
            splitsnow.Directions(*arguments)
    with pytest.raises(FileNotFoundError, match=r"no views.safetensors in .* axes.view_deg$"):
        splitsnow.Directions(tmp_path)
    with pytest.raises(FileNotFoundError, match="no views_diffuse.safetensors in"):
        splitsnow.Directions(tmp_path, diffuse=True)
    with pytest.raises(FileNotFoundError, match="nothing.safetensors"):
        splitsnow.Directions(database, tmp_path / "nothing.safetensors")
    (tmp_path / "views_diffuse.safetensors").write_text("not one")
    with pytest.raises(FileNotFoundError, match="no diffuse.safetensors in .* axes.diffuse"):
        splitsnow.Directions(tmp_path, diffuse=True)
    with pytest.raises(ValueError, match="cannot be used as a compact snow database"):
        splitsnow.Directions(database, tmp_path / "views_diffuse.safetensors")


def test_a_file_may_lack_a_quantity(tmp_path):
    write_output(tmp_path, False, quantities=("transmittance",))
    found = splitsnow.Directions(tmp_path)
    assert found.quantities == ("btf",)
    assert (found.btf(*POINT, **VIEW) > 0).all()
    for look_up in (found.brf, found.anisotropy_factor):
        with pytest.raises(ValueError, match="has no reflectance"):
            look_up(*POINT, **VIEW)


def test_properties(sun, sky, folder):
    assert list(sun.axes) == [*VIEWS, *SLAB, "angle_deg"]
    assert sun.axes["view_deg"].tolist() == VIEWS["view_deg"]
    assert np.array_equal(sun.wavelengths_nm, NM)
    assert sun.quantities == ("brf", "anisotropy_factor", "btf") and not sun.diffuse
    assert sky.quantities == ("hdrf", "anisotropy_factor", "hdtf") and sky.diffuse
    assert sun.path == sky.path == str(folder)
    assert "collimated light; brf" in repr(sun) and "diffuse light; hdrf" in repr(sky)
    assert "4 view_deg x 4 relative_azimuth_deg" in repr(sun)
    for quantity in {*sun.quantities, *sky.quantities}:
        look_up = inspect.signature(getattr(splitsnow.Directions, quantity))
        own = inspect.signature(splitsnow.Database.reflectance)
        assert {*look_up.parameters} == {*own.parameters, *VIEWS} - {"method"}


def test_two_files_equal_their_directory_and_can_be_pickled(folder, sun, sky):
    for directory in (sun, sky):
        files = (folder / name for name in OUTPUT[directory.diffuse])
        pair = splitsnow.Directions.open(*files, diffuse=directory.diffuse)
        expected = directory.anisotropy_factor(*POINT[:4], 0, **VIEW)
        for same in (pair, pickle.loads(pickle.dumps(pair)), pickle.loads(pickle.dumps(directory))):
            assert np.array_equal(same.anisotropy_factor(*POINT[:4], 0, **VIEW), expected)


def test_reflectance_factors_have_colours(sun):
    brf = sun.brf(*POINT, **VIEW)
    assert splitsnow.srgb(brf, sun.wavelengths_nm, "D65").shape == (3,)
    assert splitsnow.lab(brf, sun.wavelengths_nm)[0] > 0


def test_a_database_refuses_look_ups_of_anisotropy_factors(folder, cold, factors):
    message = (
        "the compact file holds anisotropy factors, not reflectance and transmittance; give "
        "snow.safetensors instead, or look up with Directions"
    )
    for out in (folder, cold):
        database = splitsnow.Database(out / "views.safetensors")
        assert list(database.axes)[:2] == list(VIEWS)
        for method in ("smooth", "varsa2025"):
            for call in (database.reflectance, database.transmittance, database.srgb):
                with pytest.raises(ValueError, match=message):
                    call(*POINT, method=method)
        with pytest.raises(ValueError, match=message):
            database.reflectance(*POINT, **VIEW)
    nodes = splitsnow.Database(folder / "views.safetensors").to_xarray()
    assert np.array_equal(nodes.reflectance, factors[False]["reflectance"])
    assert nodes.reflectance.attrs["long_name"] == "anisotropy factor of reflected light"
    assert nodes.view_deg.attrs["units"] == "degree"


def test_a_database_without_views_has_no_such_axis(folder, factors):
    database = splitsnow.Database(folder)
    for name, value in VIEW.items():
        for method in ("smooth", "varsa2025"):
            with pytest.raises(ValueError, match=f"the database has no axis {name}"):
                database.reflectance(0.5, 300, 200, 4, 20, method=method, **{name: value})


def test_parameters_name_the_views():
    names = [name for name, _, _ in _native.parameters()]
    assert names[:2] == list(VIEWS)
    assert {unit for name, unit, _ in _native.parameters() if name in VIEWS} == {"degree"}


def test_example_of_the_readme(folder, factors, monkeypatch):
    codes = re.findall(r"```python\n(.*?)```", (ROOT / "python/README.md").read_text(), re.DOTALL)
    (code,) = [code for code in codes if "splitsnow.Directions" in code]
    assert "out/views" in code
    names = {"np": np, "splitsnow": splitsnow}
    exec(code.replace("out/views", str(folder)), names)
    assert names["brf"].shape == (2, 31) and names["hdrf"].shape == (61, 31)
    assert names["colours"].shape == (2, 3)
