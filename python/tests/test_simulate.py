"""Simulations equal those of `splitsnow simulate` exactly."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import splitsnow

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SAMPLE = """version = 1
[illumination]
incidence_angle_deg = 30
[wavelengths]
values_nm = [450, 600, 1000]
[[layer]]
thickness_cm = 2
density_kg_m3 = 250
temperature_c = -5
[[layer.grain]]
size_um = { min = 200, max = 400 }
facetness = { min = 0.1, max = 0.5, mean = 0.3, sd = 0.1 }
sphericity = { min = 0.5, max = 0.9, mean = 0.7, sd = 0.1 }
"""
COLUMNS = "reflectance reflectance_se transmittance transmittance_se absorptance lost_share".split()


@pytest.fixture
def path(tmp_path):
    (tmp_path / "sample.toml").write_text(SAMPLE)
    return tmp_path / "sample.toml"


@pytest.mark.parametrize("engine", ["auto", "spectral", "reference"])
def test_equals_simulate(run, path, engine):
    measured = json.loads(
        run("simulate", path, "--engine", engine, "--rays", 4000, "--seed", 7, "--json")
    )
    found = splitsnow.simulate(path, engine=engine, rays=4000, seed=7)
    assert found.wavelengths_nm.tolist() == measured["wavelength_nm"]
    for column in COLUMNS:
        values = getattr(found, column)
        assert values.dtype == np.float64 and values.tolist() == measured[column]
    assert np.array_equal(found.absorptance_se, found.reflectance_se + found.transmittance_se)
    assert (found.engine, found.rays, found.seed) == (measured["engine"], 4000, 7)
    assert found.engine != "auto"


@pytest.mark.parametrize("engine", ["auto", "spectral"])
def test_profile_equals_the_command(run, path, engine):
    words = ("--depths-cm=0.5,1", "--engine", engine, "--rays=4000", "--seed=7", "--json")
    command = json.loads(run("simulate", path, *words))
    found = splitsnow.profile(path, [1, 0.5], engine=engine, rays=4000, seed=7)
    assert found.depths_cm.tolist() == command["depth_cm"] == [0, 0.5, 1, 2]
    for name in ("downwelling", "upwelling", "actinic"):
        for end in ("", "_se"):
            assert getattr(found, name + end).tolist() == command[name + end]
    assert found.absorbed_per_m.tolist() == [row[:3] for row in command["absorbed_per_m"]]
    net = found.downwelling - found.upwelling
    lost = found.absorbed_per_m * np.diff(found.depths_cm) / 100
    np.testing.assert_allclose(net[:, :-1] - net[:, 1:], lost, rtol=1e-9, atol=1e-15)
    assert found.engine == ("hybrid" if engine == "auto" else engine)
    with pytest.raises(ValueError, match="depth"):
        splitsnow.profile(path, [3], rays=100)
    with pytest.raises(ValueError, match="depths_cm must be"):
        splitsnow.profile(path, [-1], rays=100)


def test_path_text_and_mapping_are_equivalent(path):
    keys = tomllib.loads(SAMPLE)
    keys["wavelengths"]["values_nm"] = np.array(keys["wavelengths"]["values_nm"])
    keys["layer"][0]["thickness_cm"] = np.float32(2)
    samples = [path, str(path), SAMPLE, keys]
    first, *others = [splitsnow.simulate(sample, engine="spectral", rays=500) for sample in samples]
    for other in others:
        assert np.array_equal(first.transmittance, other.transmittance)
    seeded = splitsnow.simulate(path, engine="spectral", rays=500, seed=2)
    assert not np.array_equal(first.transmittance, seeded.transmittance)


def test_max_error_determines_the_number_of_rays():
    coarse = splitsnow.simulate(SAMPLE, max_error=0.01)
    fine = splitsnow.simulate(SAMPLE, max_error={"rmse": 0.0016, "delta_e": 1})
    assert coarse.rays < fine.rays < 131_072
    assert (fine.reflectance_se < coarse.reflectance_se).all()


def test_invalid_samples_and_arguments_are_rejected(tmp_path):
    with pytest.raises(FileNotFoundError):
        splitsnow.simulate(tmp_path / "nothing.toml")
    for message, sample, arguments in [
        ("layer.*density_kg_m3", SAMPLE.replace("250", "-3"), {}),
        ("incidence_angle_deg", {"version": 1}, {}),
        ("no engine is named `fast`", SAMPLE, {"engine": "fast"}),
        ("rays = 0", SAMPLE, {"rays": 0}),
        ("rays = -1 must", SAMPLE, {"rays": -1}),
        ("seed = 18446744073709551616 must", SAMPLE, {"seed": 2**64}),
        ("for the engine `auto`", SAMPLE, {"engine": "spectral", "max_error": 0.01}),
        ("must be above 0", SAMPLE, {"max_error": -1}),
        ("must be above 0", SAMPLE, {"max_error": np.nan}),
        ("not speed", SAMPLE, {"max_error": {"speed": 1}}),
    ]:
        with pytest.raises(ValueError, match=message):
            splitsnow.simulate(sample, **arguments)
    with pytest.raises(TypeError, match="not set"):
        splitsnow.simulate({"version": {1}})


def test_warnings_are_raised():
    dense = SAMPLE.replace("250", "500")
    with pytest.warns(UserWarning, match="density_kg_m3"):
        splitsnow.simulate(dense, engine="spectral", rays=200)


def test_ctrl_c_stops_a_simulation(path):
    code = (
        "import signal, splitsnow\n"
        # a shell may start the tests with this signal ignored
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "print('ready', flush=True)\n"
        f"splitsnow.simulate({str(path)!r}, engine='reference', rays=10**12)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline() == "ready\n"
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert "KeyboardInterrupt" in errors
