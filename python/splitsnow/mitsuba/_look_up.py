"""Interpolation in a table, in the numbers of Mitsuba's variant."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._table import BEND_CM, VISIBLE_NM, Table


class LookUp:
    """A table in the memory of the renderer; scalar variants have plain numbers."""

    def __init__(self, mi: Any, dr: Any, table: Table) -> None:
        self.mi, self.dr = mi, dr
        self.scalar = not dr.is_array_v(mi.Float)
        cosines = np.cos(np.deg2rad(table.angles_deg))
        self.least, self.greatest = self.number(cosines[-1]), self.number(cosines[0])
        bent = 0.4 * np.exp(-cosines / 0.02) - cosines
        slopes = 1 / np.diff(bent)
        self.steps = [(self.number(b), self.number(s)) for b, s in zip(bent, slopes)]
        thicknesses, self.angles, self.width = table.values.shape
        self.scale = self.number((thicknesses - 1) / np.log1p(table.deepest_cm / BEND_CM))
        self.last = thicknesses - 1
        self.values = self._held(table.values)
        # A wavelength's place among the table's: straight lines between whole nm,
        # exact where those of the database are whole numbers.
        nm = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1)
        places = np.interp(nm, table.wavelengths_nm, np.arange(len(table.wavelengths_nm)))
        self.places = self._held(places)

    def number(self, value: float) -> Any:
        """One that is no part of the compiled code, so that all snow shares it."""
        return float(value) if self.scalar else self.dr.opaque(self.mi.Float, float(value))

    def spectrum(self, thickness_cm: Any, cosine: Any, wavelengths: Any, active: Any) -> Any:
        """Transmittance at each of the wavelengths."""
        corners = self._corners(thickness_cm, cosine)
        found = self.mi.UnpolarizedSpectrum(0)
        for channel in range(len(wavelengths)):
            nm = wavelengths[channel] - VISIBLE_NM[0]
            i, part = self._cell(nm, len(self.places) - 1)
            a, b = self._take(self.places, i, active), self._take(self.places, i + 1, active)
            i, part = self._cell(a + (b - a) * part, self.width - 1)
            ends = []
            for k in (i, self.dr.minimum(i + 1, self.width - 1)):
                depth = sum(w * self._take(self.values, at + k, active) for at, w in corners)
                ends.append(self.dr.exp(-depth))
            found[channel] = ends[0] + (ends[1] - ends[0]) * part
        return found

    def colour(self, thickness_cm: Any, cosine: Any, active: Any) -> Any:
        """Linear sRGB, not below 0; in monochrome variants the luminance."""
        corners = self._corners(thickness_cm, cosine)
        depth, *rgb = [
            sum(w * self._take(self.values, at + k, active) for at, w in corners)
            for k in range(4)
        ]
        luminance = self.dr.exp(-depth)
        if self.mi.is_monochromatic:
            return self.mi.Color1f(luminance)
        return self.mi.Color3f(*[self.dr.maximum(value, 0) * luminance for value in rgb])

    def _corners(self, thickness_cm: Any, cosine: Any) -> list[tuple[Any, Any]]:
        """Where the four nodes around begin, and their weights."""
        i, u = self._cell(self.dr.log(1 + thickness_cm / BEND_CM) * self.scale, self.last)
        bent = 0.4 * self.dr.exp(cosine / -0.02) - cosine
        place = sum(self.dr.clip((bent - start) * slope, 0, 1) for start, slope in self.steps)
        j, v = self._cell(place, self.angles - 1)
        at = (i * self.angles + j) * self.width
        right, below = self.width, self.angles * self.width
        return [
            (at, (1 - u) * (1 - v)),
            (at + right, (1 - u) * v),
            (at + below, u * (1 - v)),
            (at + below + right, u * v),
        ]

    def _cell(self, place: Any, last: int) -> tuple[Any, Any]:
        """Node before a place, and the part of the way to the next; ends are kept."""
        place = self.dr.clip(place, 0, last)
        i = self.dr.minimum(self.mi.UInt32(place), max(last - 1, 0))
        return i, place - self.mi.Float(i)

    def _held(self, values: Any) -> Any:
        flat = np.ascontiguousarray(values, np.float32).ravel()
        return flat.tolist() if self.scalar else self.mi.Float(flat)

    def _take(self, values: Any, i: Any, active: Any) -> Any:
        return values[i] if self.scalar else self.dr.gather(self.mi.Float, values, i, active)
