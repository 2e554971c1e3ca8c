"""Broadband albedo of deep clean snow, compared with TARTES 2 (see tartes_albedo.py).

Reads data/kernel.csv and data/broadband_SUN.csv, and prints the table of docs/bands.md.
"""

import csv
from pathlib import Path

import numpy as np
import tartes

HERE = Path(__file__).parent
SUNS = HERE.parents[1] / "crates/spectra/data/suns"
NM = np.arange(350, 2501, 5.0)


def rows(path):
    with open(path) as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def constants(path):
    """The numbers in lines `# key number`."""
    words = [line[1:].replace(":", " ").split() for line in open(path) if line.startswith("#")]
    numbers = {}
    for word in words:
        try:
            numbers[word[0]] = float(word[-1])
        except (IndexError, ValueError):
            pass
    return numbers


kernel = rows(HERE / "data/kernel.csv")
snow = constants(HERE / "data/kernel.csv")
column = lambda name: np.array([float(row[name]) for row in kernel])  # noqa: E731
ssa = snow["specific_surface_area_m2_kg"]
g = np.interp(NM, column("wavelength_nm"), (1 + column("p1")) / 2)
b = np.interp(NM, column("wavelength_nm"), column("mean_path_m") * ssa * snow["ice_density_kg_m3"] / 4)


def albedo(with_our_grains):
    values = []
    for i, nm in enumerate(NM):
        shape = dict(shape_parameterization="constant", g0=g[i], B0=b[i]) if with_our_grains else {}
        value = tartes.albedo(
            nm * 1e-9, ssa, density=snow["density_kg_m3"], thickness=1.0,
            refrac_index="w2008", dir_frac=1.0, sza=0.0, **shape,
        )  # fmt: skip
        values.append(float(np.squeeze(value)))
    return np.array(values)


def power(sun):
    name, column = ("astm_g173", sun[5:]) if sun.startswith("astm_") else (sun, "power")
    table = rows(SUNS / f"{name}.csv")
    return [np.array([float(row[key]) for row in table]) for key in ("wavelength_nm", column)]


spectra = [albedo(False), albedo(True)]
for sun in ("astm_global", "astm_direct", "subarctic_winter"):
    for row in rows(HERE / f"data/broadband_{sun}.csv"):
        fine = np.arange(float(row["from_nm"]), float(row["to_nm"]) + 0.01, 0.1)
        weight = np.interp(fine, *power(sun))
        found = [
            np.trapezoid(weight * np.interp(fine, NM, values), fine) / np.trapezoid(weight, fine)
            for values in spectra
        ]
        ours, se = float(row["reflectance"]), float(row["reflectance_se"])
        print(sun, row["band"], f"{ours:.5f} ({se:.5f})", *(f"{value:.4f}" for value in found))
