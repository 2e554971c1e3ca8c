"""A finished database opens in xarray without warnings, as documented.

SPLITSNOW_OUT names the output directory of a finished `splitsnow build`, with or
without optional axes.
"""

import hashlib
import os
import shutil
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray

# Those of the snow: reflectance and transmittance have no axes of views.
OPTIONAL_AXES = (
    "black_carbon_ng_g",
    "absorber_ug_g",
    "water_saturation",
    "temperature_c",
    "sphericity",
    "substrate_reflectance",
)
CORE_DIMS = (
    "facetness",
    "grain_size_um",
    "density_kg_m3",
    "thickness_cm",
    "angle_deg",
    "wavelength_nm",
)
QUANTITIES = ("transmittance", "reflectance", "transmittance_se", "reflectance_se")


def open_strictly(path, **kwargs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return xarray.open_zarr(path, **kwargs).load()


def optional_axes(path):
    """The optional axes in the grid, in order."""
    config = tomllib.loads(open_strictly(path).attrs["config"])
    return tuple(name for name in OPTIONAL_AXES if name in config["axes"])


@pytest.fixture
def path():
    return Path(os.environ["SPLITSNOW_OUT"]) / "database.zarr"


def test_arrays_and_coordinates(path):
    data = open_strictly(path)
    dims = optional_axes(path) + CORE_DIMS
    assert set(data.data_vars) == set(QUANTITIES)
    for name in QUANTITIES:
        assert data[name].dims == dims
        assert data[name].dtype == np.float32
        assert data[name].attrs["units"] == "1"
        assert "long_name" in data[name].attrs
    assert set(data.coords) == set(dims)
    for name in dims:
        assert data[name].dtype == np.float64
        assert data.indexes[name].is_monotonic_increasing
        assert data[name].attrs["units"]


def test_values(path):
    data = open_strictly(path)
    for name in QUANTITIES:
        assert np.isfinite(data[name]).all()
    assert (data.transmittance >= 0).all() and (data.reflectance >= 0).all()
    assert (data.transmittance + data.reflectance <= 1 + 1e-6).all()
    assert (data.transmittance_se >= 0).all() and (data.reflectance_se >= 0).all()


def test_attributes(path):
    attrs = open_strictly(path).attrs
    assert attrs["program"] == "splitsnow"
    assert attrs["format_version"] == 2
    for name in ("program_version", "units", "ice_table", "water_table", "engine", "identity"):
        assert attrs[name]
    assert attrs["illumination"].startswith("collimated")
    assert "normal" in attrs["illumination"]
    substrate = "Lambertian" if "substrate_reflectance" in optional_axes(path) else "black"
    assert attrs["bottom_boundary"].startswith(substrate)
    assert isinstance(attrs["seed"], int) and isinstance(attrs["rays"], int)
    assert hashlib.sha256(attrs["config"].encode()).hexdigest() == attrs["config_sha256"]


def test_jobs(path):
    jobs = open_strictly(path, group="jobs")
    assert jobs.committed.dtype == np.uint64
    assert (jobs.committed != 0).all()
    assert ((jobs.lost_share >= 0) & (jobs.lost_share <= 1)).all()


def first_file(path):
    return "c" + ".0" * (len(optional_axes(path)) + 6)


def test_a_missing_file_reads_as_nan(path, tmp_path):
    copy = tmp_path / "database.zarr"
    shutil.copytree(path, copy)
    (copy / "transmittance" / first_file(path)).unlink()
    data = open_strictly(copy)
    assert np.isnan(data.transmittance).any()
    assert np.isfinite(data.reflectance).all()


def test_a_database_without_finished_jobs_can_be_opened(path, tmp_path):
    copy = tmp_path / "database.zarr"
    shutil.copytree(path, copy)
    jobs = [*QUANTITIES, "jobs/committed", "jobs/lost_share"]
    for file in (file for name in jobs for file in (copy / name).glob("c.*")):
        file.unlink()
    data = open_strictly(copy)
    assert all(np.isnan(data[name]).all() for name in QUANTITIES)
    assert (open_strictly(copy, group="jobs").committed == 0).all()


def test_a_corrupt_chunk_is_rejected(path, tmp_path):
    copy = tmp_path / "database.zarr"
    shutil.copytree(path, copy)
    chunk = copy / "transmittance" / first_file(path)
    content = bytearray(chunk.read_bytes())
    content[0] ^= 1
    chunk.write_bytes(content)
    with pytest.raises(Exception, match="(?i)checksum|crc"):
        open_strictly(copy)
