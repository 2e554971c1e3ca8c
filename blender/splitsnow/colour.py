# SPDX-License-Identifier: MIT OR Apache-2.0
"""Colours of spectra: the CIE 1931 observer under an illuminant, with numpy alone."""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"
ILLUMINANTS = {
    "D65": ("illuminant_d65", "Daylight, the white of sRGB"),
    "D55": ("illuminant_d55", "Daylight with a lower sun"),
    "D50": ("illuminant_d50", "Daylight of print"),
    "A": ("illuminant_a", "Incandescent lamp, candle-like"),
    "E": ("illuminant_e", "The same power at all wavelengths"),
    "LED-B5": ("illuminant_led_b5", "White LED"),
    "FL3.15": ("illuminant_fl3_15", "Fluorescent lamp"),
}
# Linear Rec.709 from XYZ with white D65.
REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


@lru_cache(maxsize=None)
def _table(name):
    with open(DATA / f"{name}.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    return np.array([[float(value) for value in row] for row in rows[1:]]).T


def weights(wavelengths_nm, illuminant):
    """Contribution of each wavelength to X, Y and Z, ``(3, l)``; each sums to 1.

    Spectra are linear between the wavelengths and are summed every 5 nm, as by the library.
    """
    nm = np.asarray(wavelengths_nm, float)
    observer, light = _table("cie_1931_2deg"), _table(ILLUMINANTS[illuminant][0])
    grid = observer[0][observer[0] <= 780]
    fine = np.union1d(nm, grid[(grid > nm[0]) & (grid < nm[-1])])
    low, high = max(observer[0][0], light[0][0]), min(observer[0][-1], light[0][-1])
    inside = (fine >= low) & (fine <= high)
    used = fine[inside]
    if len(used) < 3:
        raise ValueError("the file has too few visible wavelengths for a colour; use 380 to 780 nm")
    edges = np.concatenate([used[:1], used, used[-1:]])
    power = (edges[2:] - edges[:-2]) / 2 * np.interp(used, light[0], light[1])
    sums = np.zeros((3, len(fine)))
    for row, values in zip(sums, observer[1:]):
        row[inside] = power * np.interp(used, observer[0], values)
    if (sums.sum(1) <= 0).any():
        raise ValueError("the file has no blue wavelengths; use 380 to 780 nm")
    # back to the wavelengths of the file
    hats = np.array([np.interp(fine, nm, column) for column in np.eye(len(nm))])
    sums = sums @ hats.T
    return sums / sums.sum(1, keepdims=True)


def rgb(relative_xyz, matrix=REC709):
    """Linear colours from X, Y and Z relative to white; white is (1, 1, 1).

    ``matrix`` leads from XYZ to the primaries.
    """
    white = np.linalg.solve(matrix, np.ones(3))
    return (relative_xyz * white) @ matrix.T


def lab(relative_xyz):
    """CIELAB from X, Y and Z relative to white."""
    t = np.asarray(relative_xyz, float)
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack(
        [116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1
    )


def delta_e(first, second):
    """Delta-E*ab (CIE 1976) of two colours given as X, Y and Z relative to white."""
    return np.linalg.norm(lab(first) - lab(second), axis=-1)
