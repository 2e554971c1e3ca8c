"""Look-ups equal those of `splitsnow query` and follow the broadcasting rules of NumPy."""

import json
import multiprocessing
import pickle
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import xarray
from conftest import ROOT

import splitsnow

POINT = (0.3, 250, 300, 4.5, 33)


@pytest.mark.parametrize("quantity", ["transmittance", "reflectance"])
def test_equals_query(quick, query, quantity):
    spectrum = getattr(quick, quantity)(*POINT)
    nm, values = query(quick, *POINT, quantity=quantity)
    assert spectrum.dtype == np.float32 and spectrum.shape == (31,)
    assert np.array_equal(quick.wavelengths_nm, nm)
    assert np.array_equal(spectrum, values)


def test_equals_query_by_the_published_method(quick, query):
    point = (0.5, 300, 200, 4.5, 20)
    spectrum = quick.transmittance(*point, method="varsa2025")
    assert np.array_equal(spectrum, query(quick, *point, method="varsa2025")[1])
    assert not np.allclose(spectrum, quick.transmittance(*point), rtol=1e-4)


def test_equals_query_for_a_tailored_file_and_optional_axes(tailored, sooty, query):
    point = (0.3, 300, 300, 21.5, 33)
    assert np.array_equal(tailored.transmittance(*point), query(tailored, *point)[1])
    point = (0.3, 300, 250, 4, 33)
    conditions = {"black_carbon_ng_g": 30}
    expected = query(sooty, *point, **conditions)[1]
    assert np.array_equal(sooty.transmittance(*point, black_carbon_ng_g=30), expected)
    assert np.array_equal(sooty.transmittance(*point, conditions=conditions), expected)
    # a look-up prepared for one value is not reused for another
    assert (sooty.transmittance(*point, black_carbon_ng_g=60) < expected).all()
    assert np.array_equal(sooty.transmittance(*point, black_carbon_ng_g=30), expected)
    for soot in range(20):  # more than the cache holds
        sooty.transmittance(*point, black_carbon_ng_g=soot)
    assert np.array_equal(sooty.transmittance(*point, black_carbon_ng_g=30), expected)


def test_files_with_unaligned_tensors_can_be_read():
    path = ROOT / "tests/data/compact_tensors_by_name.safetensors"
    older = splitsnow.Database.open(path)
    data = path.read_bytes()
    begin = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:begin])

    def tensor(name):
        entry = header[name]
        dtype = {"F32": "<f4", "U8": "u1"}[entry["dtype"]]
        first, last = (begin + offset for offset in entry["data_offsets"])
        return np.frombuffer(data[first:last], dtype).reshape(entry["shape"])

    scales = tensor("transmittance.quantisation").astype(float)
    y = np.zeros((9, 7))
    for k, (offset, step) in enumerate(scales):
        coefficients = offset + step * tensor(f"transmittance.coefficients.{k}")
        y += np.outer(coefficients, tensor("transmittance.basis")[:, k].astype(float))
    found = older.transmittance(0.3, 200, 300, [[1], [3], [9]], [0, 60, 80])
    assert np.allclose(found.reshape(9, 7), np.exp(-y), rtol=1e-5)


def test_broadcasting(quick):
    thickness, angle = np.array([1, 2, 5]), np.array([[0.0], [40.0]])
    found = quick.reflectance(0.3, 250, 300, thickness, angle)
    assert found.shape == (2, 3, 31)
    for i, j in np.ndindex(2, 3):
        assert np.array_equal(
            found[i, j], quick.reflectance(0.3, 250, 300, thickness[j], angle[i, 0])
        )
    assert quick.reflectance([0.3], 250, 300, 2, 0).shape == (1, 31)
    assert quick.reflectance([], 250, 300, 2, 0).shape == (0, 31)
    assert quick.reflectance(np.full((2, 0, 3), 0.3), 250, 300, 2, [0, 1, 2]).shape == (2, 0, 3, 31)
    with pytest.raises(ValueError, match="broadcast"):
        quick.reflectance([0.3, 0.4], 250, 300, [1, 2, 3], 0)


def random_points(count):
    """Random points within the axes of configs/quick.toml."""
    u = np.random.default_rng(1).random((5, count))
    low, high = np.array([[0.1, 100, 200, 0, 0], [0.9, 500, 400, 10, 80]])[..., None]
    return low + u * (high - low)


def test_many_points_equal_single_points(quick):
    """Uses more points than one task processes."""
    points = random_points(10_000)
    found = quick.transmittance(*points)
    for i in [0, 1023, 1024, 5000, 9999]:
        assert np.array_equal(found[i], quick.transmittance(*points[:, i]))
    columns = [p.astype(np.float32)[::2] for p in points]  # strided, another dtype
    found = quick.transmittance(*columns)
    assert np.array_equal(found[7], quick.transmittance(*[float(c[7]) for c in columns]))


def test_threads_share_a_database(out):
    fresh = splitsnow.Database.open(out)
    points = random_points(3000)
    expected = splitsnow.Database.open(out).transmittance(*points)
    with ThreadPoolExecutor(8) as threads:
        for found in threads.map(lambda _: fresh.transmittance(*points), range(32)):
            assert np.array_equal(found, expected)


def test_look_ups_work_in_a_forked_process(quick):
    points = random_points(3000)
    expected = quick.transmittance(*points)
    with warnings.catch_warnings():
        # forking while threads run causes a warning, but is safe here
        warnings.simplefilter("ignore", DeprecationWarning)
        with multiprocessing.get_context("fork").Pool(1) as pool:
            found = pool.apply_async(quick.transmittance, points).get(timeout=60)
    assert np.array_equal(found, expected)


def test_spectra_are_interpolated_between_wavelengths(tailored):
    own = tailored.wavelengths_nm
    assert len(own) < 31
    point = (0.3, 300, 300, np.array([20, 25]), 33)
    found = tailored.transmittance(*point)
    nm = np.arange(380, 721, 7.5)
    resampled = tailored.transmittance(*point, wavelengths_nm=nm)
    assert resampled.shape == (2, len(nm)) and resampled.dtype == np.float32
    for spectrum, values in zip(found, resampled):
        assert np.allclose(values, np.interp(nm, own, spectrum), rtol=1e-6, atol=1e-9)
    assert np.array_equal(tailored.transmittance(*point, wavelengths_nm=own, clamp=False), found)
    with pytest.raises(ValueError, match="380 to 717.5 nm; the database covers 400 to 700 nm"):
        tailored.transmittance(*point, wavelengths_nm=nm, clamp=False)
    for wrong in ([], 500, [[500]], [np.nan]):
        with pytest.raises(ValueError, match="wavelengths_nm"):
            tailored.transmittance(*point, wavelengths_nm=wrong)


@pytest.mark.parametrize(
    "axis, value", list(enumerate([0.95, 501, 199, -0.1, 80.1]))
)
def test_errors_name_the_axis_that_is_out_of_range(quick, axis, value):
    # messages use the name of the argument
    names = [name.replace("angle_deg", "incidence_angle_deg") for name in quick.axes]
    for value in (value, np.nan, np.inf, -np.inf):
        point = list(POINT)
        point[axis] = value
        if names[axis] == "thickness_cm" and value == np.inf:
            # a half space, as in the command: look-ups reach beyond the longest thickness
            deep = quick.reflectance(*point)
            assert (deep == quick.reflectance(*POINT[:3], 1e6, *POINT[4:])).all()
            continue
        with pytest.raises(ValueError, match=f"^{names[axis]} = .* covers"):
            quick.transmittance(*point)


def test_the_first_invalid_element_is_named(quick):
    thickness = np.full((3, 2000), 2.0)
    thickness[1, 1500] = np.nan
    thickness[2, 1000] = -1  # in another task
    with pytest.raises(ValueError, match=r"^element \[1, 1500\]: thickness_cm = NaN"):
        quick.transmittance(0.3, 250, 300, thickness, 0)


def test_invalid_arguments_are_rejected(quick, sooty, tailored):
    for message, call in {
        "give a value of black_carbon_ng_g from 0 to 100": lambda: sooty.transmittance(
            0.3, 300, 250, 4, 0
        ),
        "no axis temperature_c": lambda: quick.transmittance(*POINT, temperature_c=-3),
        "the database has no axis sphericity": lambda: quick.transmittance(
            0.5, 300, 200, 4, 0, method="varsa2025", sphericity=0.8
        ),
        "no optional axis is named `soot`; use one of black": lambda: quick.transmittance(
            *POINT, soot=3
        ),
        "black_carbon_ng_g = NaN is outside": lambda: sooty.transmittance(
            0.3, 300, 250, 4, 0, black_carbon_ng_g=np.nan
        ),
        "no method is named `best`": lambda: quick.transmittance(*POINT, method="best"),
        "has no reflectance": lambda: tailored.reflectance(0.3, 300, 300, 21.5, 33),
        "no quantity is named `R`": lambda: quick.lab(*POINT, quantity="R"),
        "no illuminant is named `D60`": lambda: quick.lab(*POINT, illuminant="D60"),
        "facetness = 0.3 lies between": lambda: quick.transmittance(*POINT, method="varsa2025"),
    }.items():
        with pytest.raises(ValueError, match=message):
            call()


def test_unreadable_files_are_errors(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing.safetensors"):
        splitsnow.Database.open(tmp_path / "nothing.safetensors")
    with pytest.raises(FileNotFoundError, match="snow.safetensors"):
        splitsnow.Database.open(tmp_path)
    other = tmp_path / "other.safetensors"
    other.write_text("not one")
    with pytest.raises(ValueError, match="cannot be used as a compact snow database"):
        splitsnow.Database.open(str(other))


def test_properties(quick, sooty, tailored, out):
    assert list(quick.axes) == ["facetness", "grain_size_um", "density_kg_m3", "thickness_cm", "angle_deg"]
    assert quick.axes["facetness"].tolist() == [0.1, 0.5, 0.9]
    assert list(sooty.axes)[:2] == ["black_carbon_ng_g", "water_saturation"]
    assert sooty.axes["black_carbon_ng_g"].tolist() == [0, 100]
    assert quick.quantities == ("transmittance", "reflectance")
    assert tailored.quantities == ("transmittance",) == tuple(tailored.components)
    assert quick.components == {q: int(quick.metadata[f"{q}.components"]) for q in quick.quantities}
    assert (quick.basis, quick.precision) == ("linear", "f32")
    assert tailored.basis == tailored.metadata["basis"] == "log"
    assert tailored.precision == tailored.metadata["precision"]
    assert quick.path == str(out)
    assert tailored.certificate == tailored.error_budget
    assert tailored.error_budget["quantities"]["transmittance"]["total"]["delta_e"][2] < 0.5
    assert "3 facetness x 3 grain_size_um" in repr(quick) and "31 wavelengths" in repr(quick)


def test_databases_can_be_pickled(quick):
    copy = pickle.loads(pickle.dumps(quick))
    assert np.array_equal(copy.transmittance(*POINT), quick.transmittance(*POINT))


def test_nodes_equal_those_of_the_zarr_store(quick, sooty, out):
    nodes = quick.to_xarray()
    stored = xarray.open_zarr(out / "database.zarr").load()
    for quantity in quick.quantities:
        assert nodes[quantity].dims == stored[quantity].dims
        assert nodes[quantity].dtype == np.float32 and nodes[quantity].attrs["units"] == "1"
        # the truncation error of the compression, as stated in the file
        table = json.loads(quick.metadata["error_table"])[quantity]
        bound = table["rows"][table["chosen"] - 1]["rmse"]["max"]
        rmse = ((nodes[quantity] - stored[quantity]) ** 2).mean("wavelength_nm") ** 0.5
        assert np.isclose(rmse.max(), bound, rtol=1e-3)
    for name in nodes.coords:
        assert np.allclose(nodes[name], stored[name], rtol=1e-6)
        assert nodes[name].attrs == stored[name].attrs
    # nodes can be selected by keywords: `angle_deg` is the name of the dimension
    node = dict(facetness=0.5, grain_size_um=300, density_kg_m3=200, thickness_cm=5, angle_deg=40)
    assert np.allclose(nodes.transmittance.sel(node), quick.transmittance(**node), atol=1e-6)
    sooty_nodes = sooty.to_xarray()
    assert sooty_nodes.attrs["format"] == "splitsnow-compact"
    node = dict(
        black_carbon_ng_g=100, water_saturation=0.05, facetness=0.3, grain_size_um=400,
        density_kg_m3=250, thickness_cm=5, angle_deg=60,
    )  # fmt: skip
    assert np.allclose(sooty_nodes.reflectance.sel(node), sooty.reflectance(**node), atol=1e-6)
