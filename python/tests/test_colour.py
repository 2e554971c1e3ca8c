"""Colours are compared with the formulas of colorimetry and the tables in data/."""

from pathlib import Path

import numpy as np
import pytest

import splitsnow

DATA = Path(__file__).parents[2] / "crates/spectra/data"
FILES = {"E": "e", "D55": "d55", "D65": "d65", "LED-B5": "led_b5", "FL3.15": "fl3_15", "A": "a", "D50": "d50"}
POINT = (0.3, 250, 300, np.array([1, 4.5, 10]), 33)
# matrix and D65 white of IEC 61966-2-1
TO_SRGB = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
D65 = np.array([0.9505, 1.0, 1.089])


def table(name):
    lines = (DATA / f"{name}.csv").read_text().splitlines()
    return np.loadtxt([l for l in lines if l[0].isdigit()], delimiter=",").T


def tristimulus(spectrum, nm, illuminant):
    """XYZ of a spectrum and of white, summed in steps of 5 nm."""
    light_nm, power = table(f"illuminant_{FILES[illuminant]}")
    observer_nm, *observer = table("cie_1931_2deg")
    fine = np.arange(nm[0], nm[-1] + 1, 5.0)
    weights = np.gradient(fine) * np.interp(fine, light_nm, power)
    weights[[0, -1]] /= 2
    weights = np.array([np.interp(fine, observer_nm, column) for column in observer]) * weights
    white = weights.sum(axis=1)
    return weights @ np.interp(fine, nm, spectrum) / white[1], white / white[1]


def lab(xyz, white):
    f = [t ** (1 / 3) if t > (6 / 29) ** 3 else t / (3 * (6 / 29) ** 2) + 4 / 29 for t in xyz / white]
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("illuminant", FILES)
@pytest.mark.parametrize("kind", ["quick", "tailored"])
def test_colours_match_the_formulas(request, kind, illuminant):
    database = request.getfixturevalue(kind)
    point = POINT if kind == "quick" else (0.3, 300, 300, np.array([16, 21.5, 39]), 33)
    nm = database.wavelengths_nm
    spectra = database.transmittance(*point)
    options = dict(illuminant=illuminant)
    found = {
        "lab": database.lab(*point, **options),
        "linear": database.srgb(*point, linear=True, clip=False, **options),
        "srgb": database.srgb(*point, **options),
    }
    assert all(values.shape == (3, 3) for values in found.values())
    for i, spectrum in enumerate(spectra):
        xyz, white = tristimulus(spectrum, nm, illuminant)
        assert np.allclose(splitsnow.xyz(spectrum, nm, illuminant), xyz, atol=1e-6)
        assert np.allclose(splitsnow.xyz(np.ones(len(nm)), nm, illuminant), white, atol=1e-6)
        assert np.allclose(found["lab"][i], lab(xyz, white), atol=2e-3)
        linear = TO_SRGB @ (xyz / white * D65)
        assert np.allclose(found["linear"][i], linear, atol=3e-4)
        clipped = linear.clip(0, 1)
        encoded = np.where(
            clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055
        )
        assert np.allclose(found["srgb"][i], encoded, atol=3e-3)


def test_database_colours_equal_those_of_its_spectra(quick):
    nm = quick.wavelengths_nm
    for quantity in quick.quantities:
        spectra = getattr(quick, quantity)(*POINT)
        options = dict(illuminant="D55")
        assert np.allclose(
            quick.lab(*POINT, quantity=quantity, **options),
            splitsnow.lab(spectra, nm, **options),
            atol=1e-9,
        )
        assert np.allclose(
            quick.srgb(*POINT, quantity=quantity, linear=True, **options),
            splitsnow.srgb(spectra, nm, linear=True, **options),
            atol=1e-9,
        )
    assert not np.allclose(quick.lab(*POINT), quick.lab(*POINT, quantity="reflectance"), atol=1)


def test_shapes_and_clipping():
    nm = np.arange(400, 701, 10)
    blue = np.where(nm < 480, 1.0, 0.0)
    spectra = np.stack([[blue, np.ones(31)], [0.5 * blue, np.zeros(31)]])
    assert splitsnow.lab(spectra, nm).shape == (2, 2, 3)
    assert np.allclose(splitsnow.lab(spectra, nm)[0, 1], [100, 0, 0], atol=1e-6)
    assert splitsnow.lab(np.ones((0, 31)), nm).shape == (0, 3)
    assert splitsnow.srgb(blue, nm, clip=False).min() < 0
    assert splitsnow.srgb(blue, nm).min() == 0
    assert np.allclose(splitsnow.srgb(np.ones(31), nm, "FL3.15", clip=False), 1, atol=1e-3)
    # the default illuminant has equal power at all wavelengths
    assert np.array_equal(splitsnow.xyz(blue, nm), splitsnow.xyz(blue, nm, "E"))


def test_invalid_arguments_are_rejected():
    nm = np.arange(400, 701, 10)
    for message, call in {
        "31 values": lambda: splitsnow.lab(np.ones(30), nm),
        "strictly increasing": lambda: splitsnow.lab(np.ones(31), nm[::-1]),
        "no illuminant is named `B`": lambda: splitsnow.xyz(np.ones(31), nm, "B"),
        "have no colour": lambda: splitsnow.srgb(np.ones(31), nm + 500),
    }.items():
        with pytest.raises(ValueError, match=message):
            call()


def test_swatch_shows_the_colours():
    nm = np.arange(400, 701, 10)
    spectra = np.array([np.full(31, 0.2), np.linspace(0.1, 0.02, 31)])
    image = splitsnow.swatch(spectra, nm, ("E", "D65", "LED-B5"), exposure=4, patch=3)
    assert image.shape == (9, 6, 3) and image.dtype == np.uint8
    for row, illuminant in enumerate(("E", "D65", "LED-B5")):
        for column, spectrum in enumerate(spectra):
            colour = np.round(255 * splitsnow.srgb(4 * spectrum, nm, illuminant))
            patch = image[3 * row : 3 * row + 3, 3 * column : 3 * column + 3]
            assert (patch == colour).all()
    assert splitsnow.swatch(spectra[0], nm).shape == (5 * 48, 48, 3)
    for wrong in ({"exposure": 0}, {"exposure": np.nan}, {"patch": 0}, {"illuminants": ["B"]}):
        with pytest.raises(ValueError):
            splitsnow.swatch(spectra, nm, **wrong)
    with pytest.raises(ValueError):
        splitsnow.swatch(spectra[None, None], nm)


def test_a_swatch_of_three_wavelengths_is_white():
    nm = np.array([455, 551, 608])
    image = splitsnow.swatch(np.ones(3), nm, patch=1)
    assert (image == 255).all()


def test_illuminants_from_files_and_arrays(quick, tmp_path, caplog):
    nm, power = table("illuminant_d65")
    named = quick.lab(*POINT, illuminant="D65")
    arrays = quick.lab(*POINT, illuminant=(nm, 0.01 * power))
    assert np.allclose(arrays, named, atol=1e-9)
    path = tmp_path / "lamp.txt"
    rows = [f"{w / 1000:.3f}\t{p}" for w, p in zip(nm[::-1], power[::-1])]
    path.write_text("\n".join(rows) + "\n")
    with caplog.at_level("INFO", logger="splitsnow"):
        for given in (path, str(path)):
            assert np.allclose(quick.lab(*POINT, illuminant=given), named, atol=1e-9)
    assert "lamp.txt: a table, 2 columns by tabs" in caplog.text
    spectra = quick.transmittance(*POINT)
    found = splitsnow.srgb(spectra, quick.wavelengths_nm, path)
    assert np.allclose(found, splitsnow.srgb(spectra, quick.wavelengths_nm, "D65"), atol=1e-9)
    assert not np.allclose(named, quick.lab(*POINT, illuminant="A"), atol=0.1)
    part = (nm > 380) & (nm < 600)
    for message, wrong in {
        "no such file": tmp_path / "none.csv",
        "need 400 to 700 nm": (nm[part], power[part]),
        "powers": (nm, power[:-1]),
        "strictly increasing": (nm[::-1], power),
        "power of -100 at": (nm, -100 + 0 * power),
        "white is not defined": (nm, 0 * power),
        "3 columns": (nm, power, power),
    }.items():
        with pytest.raises(ValueError, match=message):
            quick.lab(*POINT, illuminant=wrong)
