"""Files written by `splitsnow export` open in third-party readers, with the values of the
database and of the compact file.

SPLITSNOW_OUT names the output directory of a finished `splitsnow build`, in which .ci/check
has exported the compact file as snow.nc, .csv, .npz and crtm.npz, and the database as
database.nc, .csv, .npz.
"""

import csv
import os
import warnings
from pathlib import Path

import cf_units
import numpy as np
import pytest
import xarray
from safetensors import safe_open

OUT = Path(os.environ["SPLITSNOW_OUT"])
QUANTITIES = ("transmittance", "reflectance")
CRTM_AXES = ("density_kg_m3", "thickness_cm", "grain_size_um", "wavelength_nm", "angle_deg")


def open_strictly(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return xarray.open_dataset(OUT / name, engine="scipy").load()


@pytest.fixture(scope="module")
def database():
    return xarray.open_zarr(OUT / "database.zarr").load()


@pytest.fixture(scope="module")
def compact(database):
    """The compact file on the axes of the database, reconstructed as in docs/formats.md. Exports
    have 0 and 1 for values beyond, to which the compression may go."""
    with safe_open(OUT / "snow.safetensors", framework="numpy") as file:
        assert file.metadata()["basis"] == "linear"
        tensors = {name: file.get_tensor(name) for name in file.keys()}
    reconstructed = database[list(QUANTITIES)].copy(deep=True)
    for name in QUANTITIES:
        factors = (tensors[f"{name}.coefficients"], tensors[f"{name}.basis"])
        values = factors[0].astype(float) @ factors[1].astype(float).T
        reconstructed[name].values = values.clip(0, 1).reshape(database[name].shape)
    return reconstructed


def test_netcdf_of_the_database_equals_the_database(database):
    data = open_strictly("database.nc")
    assert set(data.data_vars) == set(database.data_vars)
    for name in database.data_vars:
        assert data[name].dims == database[name].dims
        assert data[name].dtype == np.float32
        assert np.array_equal(data[name].values, database[name].values)
        assert data[name].attrs["long_name"] == database[name].attrs["long_name"]
    for name in QUANTITIES:
        assert data[name].attrs["ancillary_variables"] == f"{name}_se"
    for name in database.coords:
        assert np.array_equal(data[name].values, database[name].values)
        assert data[name].attrs["units"] == database[name].attrs["units"]


def test_netcdf_describes_itself(database):
    for name in ("database.nc", "snow.nc"):
        attrs = open_strictly(name).attrs
        assert attrs["Conventions"] == "CF-1.11"
        for key in ("title", "source", "history", "references", "wavelengths"):
            assert attrs[key]
        for key in ("illumination", "bottom_boundary"):
            assert attrs[key] == database.attrs[key]
        assert attrs["normalisation"].startswith("directional-hemispherical")
    attrs = open_strictly("database.nc").attrs
    for key in ("config", "config_sha256", "identity", "engine", "ice_table"):
        assert attrs[key] == database.attrs[key]
    assert attrs["seed"] == str(database.attrs["seed"])
    assert "provenance" in open_strictly("snow.nc").attrs


def test_units_are_valid_udunits():
    data = open_strictly("database.nc")
    expected = {
        "facetness": "1",
        "grain_size_um": "1e-6 m",
        "density_kg_m3": "kg/m^3",
        "thickness_cm": "0.01 m",
        "angle_deg": "degrees",
        "wavelength_nm": "1e-9 m",
    }
    for name in (*data.coords, *data.data_vars):
        unit = cf_units.Unit(data[name].attrs["units"])
        if name in expected or name in data.data_vars:
            assert unit == cf_units.Unit(expected.get(name, "1")), name
    assert data.wavelength_nm.attrs["standard_name"] == "radiation_wavelength"


def test_the_compact_file_is_exported_in_both_axis_orders(compact):
    data, crtm = open_strictly("snow.nc"), np.load(OUT / "crtm.npz")
    assert set(data.data_vars) == set(QUANTITIES)
    for name in QUANTITIES:
        assert data[name].dims == compact[name].dims
        # the file has single precision
        assert np.abs(data[name] - compact[name]).max() < 2e-7
        others = tuple(dim for dim in compact[name].dims if dim not in CRTM_AXES)
        ordered = data[name].transpose(*others, *CRTM_AXES)
        assert np.array_equal(crtm[name], ordered.values)
    for name in compact.coords:
        assert np.array_equal(data[name].values, compact[name].values)


@pytest.mark.parametrize("stem", ["database", "snow"])
def test_npz_equals_netcdf(stem):
    data = open_strictly(f"{stem}.nc")
    with np.load(OUT / f"{stem}.npz") as arrays:
        assert list(arrays) == [*data.transmittance.dims, *data.data_vars]
        for name in arrays:
            assert arrays[name].dtype == data[name].dtype
            assert np.array_equal(arrays[name], data[name].values)


@pytest.mark.parametrize("stem", ["database", "snow"])
def test_csv_equals_netcdf(stem):
    data = open_strictly(f"{stem}.nc")
    with open(OUT / f"{stem}.csv", newline="") as file:
        names = next(csv.reader(file))
        rows = np.array([[float(cell) for cell in row] for row in csv.reader(file)])
    dims = data.transmittance.dims
    assert names == [*dims, *data.data_vars]
    assert len(rows) == data.transmittance.size
    grid = np.meshgrid(*(data[dim].values for dim in dims), indexing="ij")
    for column, name in zip(rows.T, names):
        if name in dims:
            assert np.array_equal(column, grid[dims.index(name)].ravel())
        else:
            assert np.array_equal(column.astype(np.float32), data[name].values.ravel())
