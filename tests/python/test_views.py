"""The factors toward views of a database, as third-party readers see them.

`.ci/check` has built tests/data/views.toml, with more walks, in the folder `views` of
SPLITSNOW_OUT and exported its factors as views.nc and views.npz.
"""

import os
from pathlib import Path

import numpy as np
import pytest
import xarray
from safetensors import safe_open

OUT = Path(os.environ["SPLITSNOW_OUT"]) / "views"
NAMES = ("brf", "btf", "hdrf", "hdtf")


@pytest.fixture(scope="module")
def database():
    return xarray.open_zarr(OUT / "database.zarr").load()


def test_dimensions_are_those_on_which_a_factor_depends(database):
    snow = ("facetness", "grain_size_um", "density_kg_m3", "thickness_cm")
    views = ("view_deg", "relative_azimuth_deg")
    assert database.brf.dims == views + snow + ("angle_deg", "wavelength_nm")
    assert database.hdrf.dims == views[:1] + snow + ("wavelength_nm",)
    assert database.view_deg.attrs["units"] == "degree"


def test_netcdf_holds_all_factors_and_albedos(database):
    data = xarray.open_dataset(OUT / "views.nc", engine="scipy").load()
    stored = set(database.data_vars) - {"curve_status"}
    assert set(data.data_vars) == stored | {"anisotropy_factor", "anisotropy_factor_diffuse"}
    for name in stored:
        assert data[name].dims == database[name].dims
        assert np.array_equal(data[name].values, database[name].values, equal_nan=True)
    for name in NAMES:
        assert data[name].attrs["ancillary_variables"] == f"{name}_se"
    assert data.view_deg.attrs["standard_name"] == "sensor_zenith_angle"
    for suffix, factor in (("", "brf"), ("_diffuse", "hdrf")):
        ratio = data[factor] / data[f"reflectance{suffix}"]
        found = data[f"anisotropy_factor{suffix}"]
        assert found.dims == data[factor].dims
        np.testing.assert_allclose(found.values, ratio.transpose(*found.dims).values, rtol=1e-6)


def test_npz_has_the_same_arrays(database):
    arrays = np.load(OUT / "views.npz")
    for name in NAMES:
        assert np.array_equal(arrays[name], database[name].values, equal_nan=True)
    assert np.array_equal(arrays["view_deg"], database.view_deg.values)


def test_the_compact_file_is_read_as_documented(database):
    with safe_open(OUT / "views.safetensors", framework="numpy") as file:
        metadata = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}
    assert metadata["content"] == "anisotropy_factor"
    assert metadata["basis"] == "linear"
    order = metadata["axis_order"].split(",")
    assert order[:2] == ["view_deg", "relative_azimuth_deg"]
    shape = [len(tensors[name]) for name in order]
    assert tensors["reflectance.coefficients"].shape[0] == np.prod(shape)
    factors = tensors["reflectance.coefficients"] @ tensors["reflectance.basis"].T
    factors = factors.reshape(*shape, -1)
    # where the factor is well known, the file is near the database
    brf, se = database.brf.values, database.brf_se.values
    known = se < 0.1 * brf
    ratio = (database.brf / database.reflectance).transpose(*database.brf.dims).values
    assert known.sum() > 10
    # the bound of the compression: twice the median error
    assert np.abs(factors - ratio)[known].max() < 0.1
