"""Interpolation in a table, with the number types of the Mitsuba variant."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._table import BEND_CM, VISIBLE_NM, Table


class LookUp:
    """A table in the memory of the renderer; scalar variants use plain numbers."""

    def __init__(self, mi: Any, dr: Any, table: Table) -> None:
        self.mi, self.dr = mi, dr
        self.scalar = not dr.is_array_v(mi.Float)
        cosines = np.cos(np.deg2rad(table.angles_deg))
        self.min_cosine, self.max_cosine = self.number(cosines[-1]), self.number(cosines[0])
        coordinates = 0.4 * np.exp(-cosines / 0.02) - cosines
        slopes = 1 / np.diff(coordinates)
        self.steps = [(self.number(c), self.number(s)) for c, s in zip(coordinates, slopes)]
        thicknesses, self.angles, self.width = table.values.shape
        self.scale = self.number((thicknesses - 1) / np.log1p(table.deepest_cm / BEND_CM))
        self.last = thicknesses - 1
        self.values = self._stored(table.values)
        # Fractional index of each whole nm among the wavelengths of the table. Linear
        # interpolation between whole nm is exact if the wavelengths of the database are
        # whole numbers.
        nm = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1)
        places = np.interp(nm, table.wavelengths_nm, np.arange(len(table.wavelengths_nm)))
        self.places = self._stored(places)

    def number(self, value: float) -> Any:
        """A number that is opaque to the compiler, so that all snow shares compiled code."""
        return float(value) if self.scalar else self.dr.opaque(self.mi.Float, float(value))

    def spectrum(self, thickness_cm: Any, cosine: Any, wavelengths: Any, active: Any) -> Any:
        """Transmittance at each of ``wavelengths``, nm."""
        corners = self._corners(thickness_cm, cosine)
        spectrum = self.mi.UnpolarizedSpectrum(0)
        for channel in range(len(wavelengths)):
            nm = wavelengths[channel] - VISIBLE_NM[0]
            i, part = self._cell(nm, len(self.places) - 1)
            a, b = self._take(self.places, i, active), self._take(self.places, i + 1, active)
            i, part = self._cell(a + (b - a) * part, self.width - 1)
            ends = []
            for k in (i, self.dr.minimum(i + 1, self.width - 1)):
                depth = sum(w * self._take(self.values, start + k, active) for start, w in corners)
                ends.append(self.dr.exp(-depth))
            spectrum[channel] = ends[0] + (ends[1] - ends[0]) * part
        return spectrum

    def colour(self, thickness_cm: Any, cosine: Any, active: Any) -> Any:
        """Linear sRGB, at least 0; in monochrome variants the luminance."""
        corners = self._corners(thickness_cm, cosine)
        depth, *rgb = [
            sum(w * self._take(self.values, start + k, active) for start, w in corners)
            for k in range(4)
        ]
        luminance = self.dr.exp(-depth)
        if self.mi.is_monochromatic:
            return self.mi.Color1f(luminance)
        return self.mi.Color3f(*[self.dr.maximum(value, 0) * luminance for value in rgb])

    def _corners(self, thickness_cm: Any, cosine: Any) -> list[tuple[Any, Any]]:
        """Start index and weight of each of the four surrounding nodes."""
        i, u = self._cell(self.dr.log(1 + thickness_cm / BEND_CM) * self.scale, self.last)
        coordinate = 0.4 * self.dr.exp(cosine / -0.02) - cosine
        place = sum(self.dr.clip((coordinate - c) * slope, 0, 1) for c, slope in self.steps)
        j, v = self._cell(place, self.angles - 1)
        start = (i * self.angles + j) * self.width
        right, below = self.width, self.angles * self.width
        return [
            (start, (1 - u) * (1 - v)),
            (start + right, (1 - u) * v),
            (start + below, u * (1 - v)),
            (start + below + right, u * v),
        ]

    def _cell(self, place: Any, last: int) -> tuple[Any, Any]:
        """Node below a fractional index, clamped to the ends, and the fraction of the way
        to the next node."""
        place = self.dr.clip(place, 0, last)
        i = self.dr.minimum(self.mi.UInt32(place), max(last - 1, 0))
        return i, place - self.mi.Float(i)

    def _stored(self, values: Any) -> Any:
        flat = np.ascontiguousarray(values, np.float32).ravel()
        return flat.tolist() if self.scalar else self.mi.Float(flat)

    def _take(self, values: Any, i: Any, active: Any) -> Any:
        return values[i] if self.scalar else self.dr.gather(self.mi.Float, values, i, active)
