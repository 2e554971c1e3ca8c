"""Spectral databases of snow: look-ups, colours and simulations.

A database is a compact file written by ``splitsnow build`` or ``splitsnow tailor``::

    import splitsnow

    snow = splitsnow.Database.open("out/quick")
    spectra = snow.transmittance(0.3, 250, 300, thickness_cm=[2, 5], incidence_angle_deg=20)
    colours = snow.srgb(0.3, 250, 300, thickness_cm=[2, 5], incidence_angle_deg=20)

Wavelengths are in nm; reflectance and transmittance are dimensionless, in [0, 1].
:class:`Directions` looks up the light toward a view. :func:`retrieve` finds the snow of measured
spectra. :func:`bands` averages spectra over the bands of satellites.
"""

from ._bands import Bands, bands
from ._colour import lab, srgb, swatch, xyz
from ._database import Database
from ._directions import Directions
from ._native import VERSION as __version__
from ._native import simd
from ._retrieval import Retrieval, retrieve
from ._simulation import Profile, Simulation, profile, simulate

__all__ = [
    "Bands",
    "Database",
    "Directions",
    "Profile",
    "Retrieval",
    "Simulation",
    "__version__",
    "bands",
    "lab",
    "profile",
    "retrieve",
    "simd",
    "simulate",
    "srgb",
    "swatch",
    "xyz",
]
