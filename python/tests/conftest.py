"""Fixtures: databases built by the compiled `splitsnow`.

SPLITSNOW_BIN names the program (default: target/release/splitsnow). SPLITSNOW_OUT names
the output directory of `splitsnow build configs/quick.toml`, which is built if not set.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import splitsnow

ROOT = Path(__file__).parents[2]
WITH_CARBON = """version = 1
[axes]
facetness = [0.3]
grain_size_um = [200, 400]
density_kg_m3 = [250]
thickness_cm = [2, 5, 10]
incidence_angle_deg = [0, 60]
black_carbon_ng_g = [0, 100]
water_saturation = [0.05]
[wavelengths]
values_nm = [450, 550, 650]
[run]
engine = "hybrid"
rays = 4000
"""


@pytest.fixture(scope="session")
def run():
    """Runs the program and returns its standard output."""
    program = os.environ.get("SPLITSNOW_BIN", ROOT / "target/release/splitsnow")

    def run(*args):
        args = [str(program), *map(str, args)]
        result = subprocess.run(args, cwd=ROOT, capture_output=True, text=True)
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run


@pytest.fixture(scope="session")
def out(run, tmp_path_factory):
    if "SPLITSNOW_OUT" in os.environ:
        return (ROOT / os.environ["SPLITSNOW_OUT"]).resolve()
    out = tmp_path_factory.mktemp("quick")
    run("build", "configs/quick.toml", "--out", out)
    return out


@pytest.fixture(scope="session")
def quick(out):
    return splitsnow.Database.open(out)


@pytest.fixture(scope="session")
def sooty(run, tmp_path_factory):
    """A database with black carbon as an axis."""
    folder = tmp_path_factory.mktemp("sooty")
    (folder / "grid.toml").write_text(WITH_CARBON)
    run("build", folder / "grid.toml", "--out", folder / "out")
    return splitsnow.Database.open(folder / "out")


@pytest.fixture(scope="session")
def tailored(run, tmp_path_factory):
    """A tailored database: few wavelengths, an error budget, transmittance only."""
    folder = tmp_path_factory.mktemp("igloo")
    run("tailor", "configs/scenes/igloo.toml", "--out", folder)
    return splitsnow.Database.open(folder)


@pytest.fixture(scope="session")
def query(run):
    """Runs `splitsnow query` on a database and returns wavelengths and values."""

    def query(database, *point, **options):
        names = "facetness grain-size-um density-kg-m3 thickness-cm incidence-angle-deg".split()
        options.update(zip(names, point))
        args = [f"--{name.replace('_', '-')}={value}" for name, value in options.items()]
        lines = run("query", database.path, *args).splitlines()
        assert lines[0] == "wavelength_nm,value"
        return np.loadtxt(lines[1:], delimiter=",", dtype=np.float32).T

    return query
