"""The Blender extension without Blender: its reader of compact files agrees with the program, its
tables of colours are the originals, and its sources and files keep the limits of an extension.

tests/blender/run tests it in Blender.
"""

import compileall
import json
import os
import subprocess
import sys
import tomllib
import types
import zipfile
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "blender/splitsnow"
PROGRAM = os.environ.get("SPLITSNOW_BIN", ROOT / "target/release/splitsnow")

# The modules that need numpy alone, without the package, which imports Blender.
package = types.ModuleType("snow_for_blender")
package.__path__ = [str(SOURCE)]
sys.modules["snow_for_blender"] = package
from snow_for_blender import colour, compact, exr, presets, table  # noqa: E402

FILES = [
    *sorted((SOURCE / "presets").glob("*.safetensors")),
    *sorted((ROOT / "examples/mitsuba").glob("*.safetensors")),
    *sorted((ROOT / "fuzz/seeds/compact").glob("valid*.safetensors")),
    ROOT / "tests/data/compact_tensors_by_name.safetensors",
]


def query(path, quantity, point):
    args = [str(PROGRAM), "query", str(path), "--quantity", quantity]
    for name, value in point.items():
        name = {"angle_deg": "incidence_angle_deg"}.get(name, name)
        args.append(f"--{name.replace('_', '-')}={value!r}")
    result = subprocess.run(args, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return np.loadtxt(result.stdout.splitlines()[1:], delimiter=",", ndmin=2)[:, 1]


def agrees(path, points=12):
    """The number of spectra compared with those of the program."""
    file, random, compared = compact.CompactFile(path), np.random.default_rng(1), 0
    for quantity in file.quantities:
        for k in range(points):
            values = {}
            for name in (*file.conditions, *compact.CORE[:3]):
                low, high = file.axes[name][[0, -1]]
                # the last node, then anywhere
                part = 1 if k == 0 else random.random()
                values[name] = float(np.round(low + part * (high - low), 6)) if k else float(high)
            snow = file.snow(quantity, values)
            low, high = snow.range_cm
            if not low < np.inf:
                continue
            nodes = file.axes["thickness_cm"]
            # thinner than the first node, far beyond the last, and between
            choices = {1: max(low, 0.01 * nodes[0]), 2: 20 * nodes[-1]}
            cm = float(np.round(choices.get(k, low + 1.3 * random.random() * (nodes[-1] - low)), 6))
            cm = float(min(max(cm, low), high))
            angles = file.axes["angle_deg"]
            deg = float(np.round(angles[0] + random.random() * (angles[-1] - angles[0]), 6))
            expected = query(path, quantity, {**values, "thickness_cm": cm, "angle_deg": deg})
            found = snow.spectra(cm, deg)[0, 0]
            assert np.abs(found - expected).max() < 1e-5, (path, quantity, values, cm, deg)
            compared += 1
    return compared


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_spectra_are_those_of_the_program(path):
    if path.stem == "valid_views":
        with pytest.raises(compact.FileError, match="anisotropy factors.*choose the file"):
            compact.CompactFile(path)
        return
    assert agrees(path) >= 10


GRID = """version = 1
[axes]
facetness = [0.2, 0.6]
grain_size_um = [200, 2000]
density_kg_m3 = [200, 400]
thickness_cm = [1, 2, 4, 8]
incidence_angle_deg = [0, 45, 70]
diffuse = true
water_saturation = [0, 0.1]
{axis}
[wavelengths]
values_nm = [450, 550, 650]
[run]
engine = "hybrid"
rays = 200
"""


def built(folder, axis=""):
    (folder / "grid.toml").write_text(GRID.format(axis=axis))
    args = [str(PROGRAM), "build", str(folder / "grid.toml"), "--out", str(folder / "out")]
    result = subprocess.run(args, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return folder / "out"


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return built(tmp_path_factory.mktemp("wet"))


@pytest.mark.parametrize("basis", ["linear", "log"])
@pytest.mark.parametrize("precision", ["f32", "f16", "quantised"])
def test_variants(out, basis, precision):
    """Wet snow with curves that do not exist, and isotropic light."""
    args = [str(PROGRAM), "compress", str(out), "--basis", basis, "--precision", precision]
    result = subprocess.run(args, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    file = compact.CompactFile(out)
    assert file.basis == basis and file.absent.any() and not file.diffuse
    assert agrees(out / "snow.safetensors") >= 20
    assert compact.CompactFile(out / "diffuse.safetensors").diffuse
    assert agrees(out / "diffuse.safetensors") >= 20


def test_snow_on_ground(tmp_path):
    out = built(tmp_path, "substrate_reflectance = [0, 0.5]")
    file = compact.CompactFile(out)
    assert not file.black_substrate
    values = dict.fromkeys(("facetness", "water_saturation", "substrate_reflectance"), 0.0)
    snow = file.snow("transmittance", {**values, "facetness": 0.2, "grain_size_um": 200, "density_kg_m3": 300})
    with pytest.raises(compact.OutsideError, match="0.5 cm is outside.*covers 1 to inf cm"):
        snow.spectra(0.5, 0)
    assert agrees(out / "snow.safetensors") >= 20


def test_damaged_files_are_refused_with_the_reason(tmp_path):
    data = FILES[0].read_bytes()
    length = 8 + int.from_bytes(data[:8], "little")

    def changed(old, new):
        assert old in data[:length] and len(old) == len(new)
        return data[:length].replace(old, new, 1) + data[length:]

    cases = {
        "cannot be read": None,
        "not a safetensors file": b"text",
        "truncated": data[:-1],
        "appended": data + b"\0",
        "header is damaged": data[:8] + b"#" + data[9:],
        "format_version is 9, expected 2 or 1": changed(b'"format_version":"2"', b'"format_version":"9"'),
        "basis is lag, expected linear or log": changed(b'"basis":"log"', b'"basis":"lag"'),
    }
    for message, content in cases.items():
        path = tmp_path / "file.safetensors"
        path.unlink(missing_ok=True)
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(compact.FileError, match=message):
            compact.CompactFile(path)
    for path in sorted((ROOT / "fuzz/seeds/compact").glob("*.safetensors")):
        if not path.stem.startswith("valid"):
            with pytest.raises(compact.FileError):
                compact.CompactFile(path)


def test_values_outside_are_refused_with_the_range():
    file = compact.CompactFile(SOURCE / "presets/dry.safetensors")
    with pytest.raises(compact.OutsideError, match="grain_size_um = 50 is outside dry.safetensors, which covers 100 to 1000"):
        file.snow("transmittance", {"grain_size_um": 50, "density_kg_m3": 300})
    with pytest.raises(compact.OutsideError, match="density_kg_m3 is needed: dry.safetensors covers 100 to 450"):
        file.snow("transmittance", {"grain_size_um": 300})
    with pytest.raises(compact.OutsideError, match="no axis soot"):
        file.snow("transmittance", {"soot": 3})


@pytest.mark.parametrize("name", presets.PRESETS)
def test_presets_are_within_their_files(name):
    preset = presets.PRESETS[name]
    file = compact.CompactFile(preset.path)
    own = {key: value for key, value in preset.values.items()}
    assert set(own) == {n for n in (*file.conditions, *compact.CORE[:3]) if len(file.axes[n]) > 1}
    made = table.make(file, own, "D65")
    assert made.has_reflectance and made.first_cm == 0
    budget = json.loads(_metadata(preset.path)["error_budget"])["quantities"]
    assert max(part["total"]["delta_e"][2] for part in budget.values()) < 0.5


def _metadata(path):
    data = path.read_bytes()
    return json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])["__metadata__"]


def test_the_table_interpolates_the_file():
    """The largest colour error at random places, with white as bright as the darkest are lit."""
    file = compact.CompactFile(ROOT / "examples/mitsuba/snow.safetensors")
    made = table.make(file, {}, "D65")
    random = np.random.default_rng(1)
    cm, cosine = 60 * random.random(300), made.cosines[0] + random.random(300) * (1 - made.cosines[0])
    snow, weights = file.snow("transmittance", {}), colour.weights(file.wavelengths_nm, "D65")
    deg = np.degrees(np.arccos(cosine))
    exact = np.array([snow.spectra(a, b)[0, 0] for a, b in zip(cm, deg)]) @ weights.T
    found = made.at(cm, cosine)
    assert colour.delta_e(found, exact).max() < 0.02
    assert np.abs(found / exact - 1).max() < 2e-3


def test_colours_are_those_of_the_program(tmp_path):
    """Against the weights of docs/methods.md, summed here: a flat spectrum is white, and a
    triangular one has the tristimulus values of a sum at 5 nm."""
    nm = np.arange(380, 781, 20.0)
    for light in colour.ILLUMINANTS:
        weights = colour.weights(nm, light)
        assert np.allclose(weights.sum(1), 1)
        assert np.allclose(colour.rgb(weights @ np.ones(len(nm))), 1)
    observer = np.loadtxt(SOURCE / "data/cie_1931_2deg.csv", delimiter=",", skiprows=2)
    lamp = np.loadtxt(SOURCE / "data/illuminant_d65.csv", delimiter=",", skiprows=2)
    fine = np.arange(380, 781, 5.0)
    power = np.interp(fine, *lamp.T)[:, None] * np.array([np.interp(fine, observer[:, 0], c) for c in observer[:, 1:].T]).T
    power[[0, -1]] /= 2
    spectrum = np.interp(nm, [380, 550, 780], [0, 1, 0.2])
    expected = np.interp(fine, nm, spectrum) @ power / power.sum(0)
    assert np.allclose(colour.weights(nm, "D65") @ spectrum, expected, rtol=1e-6)


def test_tables_of_colours_are_those_of_the_library():
    own = sorted((SOURCE / "data").glob("*.csv"))
    assert len(own) == 8
    for path in own:
        assert path.read_bytes() == (ROOT / "crates/spectra/data" / path.name).read_bytes()


def test_exr_files_hold_the_numbers():
    """Read back by their own offsets, channel by channel."""
    pixels = np.random.default_rng(1).random((5, 7, 3)).astype(np.float32)
    data = exr.encoded(pixels)
    assert data[:4] == b"\x76\x2f\x31\x01"
    begin = data.index(b"screenWindowWidth\0float\0") + len(b"screenWindowWidth\0float\0") + 4 + 4 + 1
    for row, offset in enumerate(np.frombuffer(data[begin : begin + 40], "<u8").tolist()):
        top, size = np.frombuffer(data[offset : offset + 8], "<i4").tolist()
        assert (top, size) == (row, 3 * 4 * 7)
        line = np.frombuffer(data[offset + 8 : offset + 8 + size], "<f4").reshape(3, 7)
        assert np.array_equal(line[::-1].T, pixels[row])
    assert offset + 8 + size == len(data)


def test_sources_compile_and_the_zip_is_small(tmp_path):
    assert compileall.compile_dir(SOURCE, quiet=1, force=True, legacy=False)
    manifest = tomllib.loads((SOURCE / "blender_manifest.toml").read_text())
    assert manifest["id"] == "splitsnow" and manifest["type"] == "add-on"
    assert len(manifest["tagline"]) <= 64 and not manifest["tagline"].endswith(".")
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())
    version = version.get("workspace", version)["package"]["version"]
    assert manifest["version"] == version
    allowed = {".py", ".toml", ".csv", ".safetensors"}
    with zipfile.ZipFile(tmp_path / "all.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(SOURCE.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                assert path.suffix in allowed, path
                archive.write(path, path.relative_to(SOURCE))
    assert (tmp_path / "all.zip").stat().st_size < 100_000


def test_pictures_of_the_page_are_high_and_small():
    pictures = sorted((ROOT / "docs").glob("blender_*.png"))
    page = (ROOT / "docs/blender.md").read_text()
    assert len(pictures) >= 4
    for path in pictures:
        data = path.read_bytes()
        # the height is the second number of the first chunk
        assert int.from_bytes(data[20:24], "big") == 1080, path
        assert len(data) < 500_000, path
        assert f"]({path.name})" in page
