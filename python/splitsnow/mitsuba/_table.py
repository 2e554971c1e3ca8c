"""Tables of one material of a database, which the renderer interpolates.

Thickness nodes are evenly spaced in ln(1 + thickness / 0.5 cm), in which -ln T is nearly
linear. The angles are those of the database, between which -ln T is linear in a function
of the cosine (docs/methods.md). The wavelengths are those of the database, between which
T is linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Mapping, Optional

import numpy as np
from numpy.typing import NDArray

import splitsnow

THICKNESSES = 1024
COLOUR_ANGLES = 16
"""Smallest number of angle steps in a table of colours."""
BEND_CM = 0.5
"""Thickness below which nodes are nearly evenly spaced; above it their ratios are nearly
constant."""
VISIBLE_NM = (360, 830)
"""Range of wavelengths that Mitsuba samples."""

_DARK = 1e-7
_DEEPEST_CM = 1e4
_XYZ_TO_LINEAR_SRGB = np.array(
    [
        [3.240479, -1.537150, -0.498535],
        [-0.969256, 1.875991, 0.041556],
        [0.055648, -0.204043, 1.057311],
    ]
)


@dataclass(frozen=True)
class Material:
    """One kind of snow in a database."""

    database: splitsnow.Database
    snow: tuple[float, float, float]
    """Facetness, grain size in um, density in kg/m3."""
    conditions: Mapping[str, float]

    @classmethod
    def from_file(
        cls,
        filename: str,
        facetness: Optional[float],
        grain_size_um: Optional[float],
        density_kg_m3: Optional[float],
        conditions: Mapping[str, float],
    ) -> Material:
        """A value of ``None`` is taken from the database, if its axis has a single node."""
        database = splitsnow.Database.open(filename)
        given = dict(
            facetness=facetness, grain_size_um=grain_size_um, density_kg_m3=density_kg_m3
        )
        snow = []
        for name, value in given.items():
            nodes = database.axes[name]
            if value is None and len(nodes) > 1:
                raise ValueError(
                    f"{name} is needed: {database.path} covers {nodes[0]:g} to {nodes[-1]:g}"
                )
            snow.append(float(nodes[0] if value is None else value))
        return cls(database, (snow[0], snow[1], snow[2]), conditions)

    @property
    def key(self) -> tuple[object, ...]:
        """A key that is equal for equal materials."""
        return self.database.path, self.snow, tuple(sorted(self.conditions.items()))

    def wavelengths_nm(self) -> NDArray[np.float64]:
        """The visible wavelengths of the database, or the nearest one if there are none."""
        own = self.database.wavelengths_nm.astype(np.float64)
        low, high = VISIBLE_NM
        inner = own[(own > low) & (own < high)]
        ends = np.clip(own[[0, -1]], low, high)
        return np.unique(np.concatenate([inner, ends]))

    def transmittance(
        self,
        thickness_cm: NDArray[np.float64],
        angle_deg: NDArray[np.float64],
        wavelengths_nm: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Transmittance, ``(thicknesses, angles, wavelengths)``."""
        return self.database.transmittance(
            *self.snow,
            thickness_cm[:, None],
            angle_deg,
            wavelengths_nm=wavelengths_nm,
            conditions=self.conditions,
        ).astype(np.float64)


@dataclass(frozen=True)
class Table:
    """Values at the nodes of thickness and angle."""

    values: NDArray[np.float32]
    """``(thicknesses, angles, k)``: -ln T at k wavelengths, or for colours -ln Y followed
    by red, green and blue divided by Y."""
    deepest_cm: float
    angles_deg: NDArray[np.float64]
    wavelengths_nm: NDArray[np.float64]

    @classmethod
    def spectral(cls, material: Material) -> Table:
        """A table of spectra."""
        nm = material.wavelengths_nm()
        angles_deg = material.database.axes["angle_deg"]
        transmittance, deepest_cm = _nodes(material, angles_deg, nm)
        return cls(_logarithm(transmittance), deepest_cm, angles_deg, nm)

    @classmethod
    def colour(cls, material: Material, light: Optional[NDArray[np.float64]]) -> Table:
        """A table of linear sRGB under a light, ``(n, 2)`` with wavelength in nm and value;
        the light is 0 beyond its ends. ``None`` is D65, with T = 1 as (1, 1, 1)."""
        nm = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1, 5.0)
        own = material.database.axes["angle_deg"]
        # The logarithm of a luminance is less linear than that of a single wavelength.
        parts = -(-COLOUR_ANGLES // (len(own) - 1)) if len(own) > 1 else 1
        steps = np.arange((len(own) - 1) * parts + 1) / parts
        angles_deg = np.interp(steps, np.arange(len(own)), own)
        transmittance, deepest_cm = _nodes(material, angles_deg, nm)
        if light is None:
            xyz = splitsnow.xyz(transmittance, nm, "D65")
            rgb = splitsnow.srgb(transmittance, nm, "D65", linear=True, clip=False)
        else:
            shape = np.interp(nm, light[:, 0], light[:, 1], left=0, right=0)
            xyz = splitsnow.xyz(transmittance * shape, nm)
            rgb = xyz @ _XYZ_TO_LINEAR_SRGB.T
        luminance = np.maximum(xyz[..., 1:2], 1e-30)
        values = np.concatenate([_logarithm(luminance), rgb / luminance], -1)
        return cls(values.astype(np.float32), deepest_cm, angles_deg, nm)


def _nodes(
    material: Material, angles_deg: NDArray[np.float64], nm: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Transmittance at the nodes, and the largest thickness, cm."""
    thicknesses = material.database.axes["thickness_cm"]
    for name, nodes in (("thickness", thicknesses), ("angle", angles_deg)):
        if len(nodes) < 2:
            raise ValueError(
                f"{material.database.path} has a single {name}, {nodes[0]:g}: use a database that "
                "covers a range"
            )
    deepest_cm = float(thicknesses[-1])
    while deepest_cm < _DEEPEST_CM:
        if material.transmittance(np.array([deepest_cm]), angles_deg, nm).max() < _DARK:
            break
        deepest_cm *= 1.25
    stretched = np.linspace(0, np.log1p(deepest_cm / BEND_CM), THICKNESSES)
    thickness_cm = BEND_CM * np.expm1(stretched)
    return material.transmittance(thickness_cm, angles_deg, nm), deepest_cm


def _logarithm(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return -np.log(np.maximum(values, 1e-37)).astype(np.float32)
