"""The compact file reproduces the curves of the database when read as in the README."""

import json
import os
from pathlib import Path

import numpy as np
import xarray
from safetensors import safe_open

CORE_AXES = ("facetness", "grain_size_um", "density_kg_m3", "thickness_cm", "angle_deg")


def test_curves_are_reproduced_within_the_stated_errors():
    out = Path(os.environ["SPLITSNOW_OUT"])
    stored = xarray.open_zarr(out / "database.zarr").load()
    with safe_open(out / "snow.safetensors", framework="numpy") as file:
        metadata = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}
    axes = stored.transmittance.dims[:-1]
    assert metadata["axis_order"] == ",".join(axes) and axes[-5:] == CORE_AXES
    assert metadata["basis"] == "linear"
    for axis in (*axes, "wavelength_nm"):
        assert tensors[axis].dtype == np.float64
        assert np.array_equal(tensors[axis], stored[axis])
    tables = json.loads(metadata["error_table"])
    for quantity in ("transmittance", "reflectance"):
        coefficients = tensors[f"{quantity}.coefficients"]
        basis = tensors[f"{quantity}.basis"]
        components = int(metadata[f"{quantity}.components"])
        curves = stored[quantity].values.reshape(-1, stored.sizes["wavelength_nm"])
        assert coefficients.shape == (len(curves), components)
        assert basis.shape == (curves.shape[1], components)
        reconstructed = coefficients.astype(float) @ basis.astype(float).T
        rmse = np.sqrt(np.mean((reconstructed - curves) ** 2, axis=1))
        row = next(r for r in tables[quantity]["rows"] if r["components"] == components)
        # the table has six digits
        assert rmse.max() <= row["rmse"]["max"] * (1 + 1e-5)
        assert np.isclose(rmse.mean(), row["rmse"]["mean"], rtol=1e-5)
