# SPDX-License-Identifier: MIT OR Apache-2.0
"""Tables of transmitted colours over thickness and cosine, which the material reads.

Rows are evenly spaced in ln(1 + 2 h), where h is the thickness in cm, columns in the cosine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import colour

ROWS, COLUMNS = 512, 32
DARK = 1e-7
DEEPEST_CM = 1e4
REFLECTANCE_DEG = 45.0
DEFAULT_REFLECTANCE = 0.9


@dataclass(frozen=True)
class Table:
    """Colours as X, Y and Z relative to white, so that any primaries can follow."""

    xyz: np.ndarray
    """``(rows, columns, 3)``: transmitted light."""
    reflected: np.ndarray
    """``(3,)``: reflectance of the thickest snow of the file at 45 degrees."""
    has_reflectance: bool
    first_cm: float
    last_cm: float
    cosines: tuple
    """Of the first and the last column."""

    def at(self, thickness_cm, cosine):
        """Interpolates as the material does."""
        ends = np.log1p(2 * np.array([self.first_cm, self.last_cm]))
        row = (np.log1p(2 * np.maximum(thickness_cm, 0)) - ends[0]) / (ends[1] - ends[0])
        column = (np.asarray(cosine) - self.cosines[0]) / (self.cosines[1] - self.cosines[0])
        total = 0
        for i, u in _sides(row, len(self.xyz)):
            for j, v in _sides(column, self.xyz.shape[1]):
                total = total + (u * v)[..., None] * self.xyz[i, j]
        return total


def _sides(part, count):
    place = np.clip(part, 0, 1) * (count - 1)
    below = np.minimum(place.astype(int), count - 2)
    return (below, 1 - (place - below)), (below + 1, place - below)


def make(file, values, illuminant, rows=ROWS, columns=COLUMNS):
    """The table of one snow of a compact file."""
    snow = file.snow("transmittance", values)
    first_cm, most_cm = snow.range_cm
    if not first_cm < most_cm:
        raise ValueError(
            f"{file.path.name} has a single thickness, {first_cm:g} cm; use a file that covers a range"
        )
    weights = colour.weights(file.wavelengths_nm, illuminant)
    angles = file.axes["angle_deg"]
    cosines = np.cos(np.radians(angles[[-1, 0]]))
    if len(angles) == 1:
        cosines = np.array([0.0, 1.0])  # the same for all directions
    column_deg = np.degrees(np.arccos(np.linspace(*cosines, columns))).clip(angles[0], angles[-1])
    last_cm = float(file.axes["thickness_cm"][-1])
    while last_cm < DEEPEST_CM:
        deepest = snow.spectra([last_cm], angles[[0, -1]]) @ weights[1]
        if deepest.max() < DARK:
            break
        last_cm *= 1.25
    ends = np.log1p(2 * np.array([first_cm, last_cm]))
    thickness_cm = np.expm1(np.linspace(*ends, rows)) / 2
    thickness_cm[0], thickness_cm[-1] = first_cm, last_cm
    spectra = snow.spectra(thickness_cm, column_deg)
    has_reflectance = "reflectance" in file.quantities
    reflected = np.full(3, DEFAULT_REFLECTANCE)
    if has_reflectance:
        angle = np.clip(REFLECTANCE_DEG, angles[0], angles[-1])
        thickest = file.snow("reflectance", values).spectra(file.axes["thickness_cm"][-1], angle)
        reflected = weights @ thickest[0, 0]
    xyz = spectra @ weights.T
    return Table(xyz, reflected, has_reflectance, first_cm, last_cm, tuple(map(float, cosines)))
