"""A database at one material, as a table that a renderer interpolates.

Nodes are even in ln(1 + thickness / 0.5 cm), in which -ln T bends little. The angles
are those of the database, between which its -ln T is linear in a function of the cosine
(docs/methods.md); so are the wavelengths, between which T is linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Mapping, Optional

import numpy as np
from numpy.typing import NDArray

import splitsnow

THICKNESSES = 1024
COLOUR_ANGLES = 16
"""Least number of steps in the angle, in a table of colours."""
BEND_CM = 0.5
"""Below it thickness nodes are nearly even, beyond it their ratios are."""
VISIBLE_NM = (360, 830)
"""What Mitsuba samples."""

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
    """A snow of a database."""

    database: splitsnow.Database
    snow: tuple[float, float, float]
    """Facetness, grain size in um, density in kg/m3."""
    conditions: Mapping[str, float]

    @classmethod
    def of(
        cls,
        filename: str,
        facetness: Optional[float],
        grain_size_um: Optional[float],
        density_kg_m3: Optional[float],
        conditions: Mapping[str, float],
    ) -> Material:
        """What is ``None`` is that of the database, if it has one alone."""
        database = splitsnow.Database.open(filename)
        asked = dict(
            facetness=facetness, grain_size_um=grain_size_um, density_kg_m3=density_kg_m3
        )
        snow = []
        for name, value in asked.items():
            nodes = database.axes[name]
            if value is None and len(nodes) > 1:
                raise ValueError(
                    f"{name} is needed: {database.path} covers {nodes[0]:g} to {nodes[-1]:g}"
                )
            snow.append(float(nodes[0] if value is None else value))
        return cls(database, (snow[0], snow[1], snow[2]), conditions)

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for equal materials."""
        return self.database.path, self.snow, tuple(sorted(self.conditions.items()))

    def wavelengths_nm(self) -> NDArray[np.float64]:
        """Those of the database that are visible, or the nearest one."""
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
        """``(thicknesses, angles, wavelengths)``."""
        return self.database.transmittance(
            *self.snow,
            thickness_cm[:, None],
            angle_deg,
            wavelengths_nm=wavelengths_nm,
            conditions=self.conditions,
        ).astype(np.float64)


@dataclass(frozen=True)
class Table:
    """Numbers on the nodes of thickness and angle."""

    values: NDArray[np.float32]
    """``(thicknesses, angles, k)``: -ln T at k wavelengths; or for colours -ln Y,
    then red, green and blue divided by Y."""
    deepest_cm: float
    angles_deg: NDArray[np.float64]
    wavelengths_nm: NDArray[np.float64]

    @classmethod
    def spectral(cls, material: Material) -> Table:
        """Of spectra."""
        nm = material.wavelengths_nm()
        angles_deg = material.database.axes["angle_deg"]
        transmittance, deepest_cm = _nodes(material, angles_deg, nm)
        return cls(_logarithm(transmittance), deepest_cm, angles_deg, nm)

    @classmethod
    def colour(cls, material: Material, light: Optional[NDArray[np.float64]]) -> Table:
        """Of linear sRGB under a light, ``(n, 2)`` of nm and value; beyond its ends
        it is dark. With ``None`` under D65, T = 1 being (1, 1, 1)."""
        nm = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1, 5.0)
        own = material.database.axes["angle_deg"]
        # The logarithm of a luminance is not as linear as those of its parts.
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
    """Transmittance on the nodes, and the deepest thickness."""
    thicknesses = material.database.axes["thickness_cm"]
    for name, nodes in (("thickness", thicknesses), ("angle", angles_deg)):
        if len(nodes) < 2:
            raise ValueError(
                f"{material.database.path} has a single {name}, {nodes[0]:g}: make one that covers "
                "a range"
            )
    deepest_cm = float(thicknesses[-1])
    while deepest_cm < _DEEPEST_CM:
        if material.transmittance(np.array([deepest_cm]), angles_deg, nm).max() < _DARK:
            break
        deepest_cm *= 1.25
    stretched = np.linspace(0, np.log1p(deepest_cm / BEND_CM), THICKNESSES)
    thickness_cm = BEND_CM * np.expm1(stretched)
    found = material.transmittance(thickness_cm, angles_deg, nm)
    return found, deepest_cm


def _logarithm(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return -np.log(np.maximum(values, 1e-37)).astype(np.float32)
