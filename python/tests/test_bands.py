"""Band averages against an integration with numpy, from the tables of the crate."""

import csv

import numpy as np
import pytest
import splitsnow
from conftest import ROOT

DATA = ROOT / "crates/spectra/data"
NM = np.arange(350, 2501, 10.0)
# a spectrum with a bump in every band
SPECTRUM = 0.5 + 0.3 * np.sin(NM / 70)


def table(path):
    with open(DATA / path) as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def response(sensor):
    """Wavelengths and responses of each band."""
    bands = {}
    for row in table(f"sensors/{sensor}.csv"):
        if "response" in row:
            nm, values = bands.setdefault(row["band"], ([], []))
            nm.append(float(row["wavelength_nm"]))
            values.append(float(row["response"]))
        elif "fwhm_nm" in row:
            centre, sd = float(row["centre_nm"]), float(row["fwhm_nm"]) / np.sqrt(8 * np.log(2))
            x = np.linspace(-3, 3, 2001)
            bands[row["band"]] = centre + sd * x, np.exp(-(x**2) / 2)
        else:
            bands[row["band"]] = [float(row["from_nm"]), float(row["to_nm"])], [1, 1]
    return bands


@pytest.mark.parametrize("sensor", ["sentinel2a", "sentinel3_olci", "modis", "viirs", "landsat8", "emit", "prisma", "broadband"])
@pytest.mark.parametrize("sun", ["astm_global", "subarctic_winter", "equal_energy"])
def test_averages_are_integrals(sensor, sun):
    if sun == "equal_energy":
        sun_nm, power = np.array([1, 1e4]), np.ones(2)
    else:
        rows = table(f"suns/{'astm_g173' if sun == 'astm_global' else sun}.csv")
        column = "global" if sun == "astm_global" else "power"
        sun_nm = np.array([float(row["wavelength_nm"]) for row in rows])
        power = np.array([float(row[column]) for row in rows])
    found = splitsnow.bands(sensor, NM, sun)
    averages = found.average(SPECTRUM)
    expected = response(sensor)
    assert found.names == list(expected)
    for name, average, (low, high) in zip(found.names, averages, found.range_nm):
        nm, values = expected[name]
        assert abs(nm[0] - low) < 1e-3 and abs(nm[-1] - high) < 1e-3
        fine = np.linspace(low, high, 40001)
        weight = np.interp(fine, nm, values) * np.interp(fine, sun_nm, power)
        value = np.trapezoid(weight * np.interp(fine, NM, SPECTRUM), fine) / np.trapezoid(weight, fine)
        # Gaussians are tabulated at 121 points
        assert abs(value - average) < 2e-5, name


def test_shapes_and_errors():
    found = splitsnow.bands("viirs:M3,M5", NM)
    assert found.average(np.ones((2, 3, NM.size))).shape == (2, 3, 2)
    assert np.allclose(found.average(np.ones(NM.size)), 1)
    for call, part in [
        (lambda: splitsnow.bands("moon", NM), "no sensor is named `moon`"),
        (lambda: splitsnow.bands("viirs", NM[:20]), "do not cover"),
        (lambda: splitsnow.bands("viirs", NM[::-1]), "strictly increasing"),
        (lambda: found.average(np.ones(3)), "216 wavelengths"),
    ]:
        with pytest.raises(ValueError, match=part):
            call()
