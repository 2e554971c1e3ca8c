"""Averages of spectra over the bands of sensors."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import List, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native


@dataclass(frozen=True)
class Bands:
    """The bands of a sensor, for spectra at certain wavelengths."""

    #: Names of the bands.
    names: List[str]
    #: Response-weighted mean wavelengths, nm, ``(b,)``.
    centre_nm: NDArray[np.float64]
    #: First and last wavelengths with a response, nm, ``(b, 2)``.
    range_nm: NDArray[np.float64]
    #: Weights of the wavelengths, ``(b, l)``; those of a band add up to 1.
    weights: NDArray[np.float64]

    def average(self, spectra: ArrayLike) -> NDArray[np.float64]:
        """Averages of spectra ``(..., l)`` over the bands, ``(..., b)``.

        The averages of standard errors are upper bounds of the standard errors of the
        averages, for any correlation between wavelengths.
        """
        values = np.asarray(spectra, float)
        if values.ndim == 0 or values.shape[-1] != self.weights.shape[1]:
            raise ValueError(
                f"the last axis of the spectra must have {self.weights.shape[1]} wavelengths; "
                f"their shape is {values.shape}"
            )
        averages: NDArray[np.float64] = values @ self.weights.T
        return averages


def bands(
    sensor: Union[str, "os.PathLike[str]"],
    wavelengths_nm: ArrayLike,
    sun: Union[str, "os.PathLike[str]"] = "astm_global",
) -> Bands:
    """The bands of a sensor, for spectra at ``wavelengths_nm``, ``(l,)`` and increasing.

    ``sensor`` and ``sun`` are what ``--bands`` and ``--sun`` of the program accept: names such
    as ``"sentinel2a"``, ``"sentinel2a:B3,B11"`` and ``"broadband"``, and ``"astm_global"``
    and ``"subarctic_winter"``; or paths of tables. Wavelengths must be at most 30 nm apart
    within the bands::

        snow = splitsnow.Database.open("out/alpine")
        msi = splitsnow.bands("sentinel2a", snow.wavelengths_nm)
        reflectance = msi.average(snow.reflectance(0.3, 250, 300, 50, 60))
    """
    nm = np.asarray(wavelengths_nm, float)
    if nm.ndim != 1 or not (np.isfinite(nm).all() and (np.diff(nm) > 0).all()):
        raise ValueError("wavelengths_nm must be one list of finite, strictly increasing numbers")
    found = _native.bands(os.fspath(sensor), nm.tolist(), os.fspath(sun))
    return Bands(
        names=[band[0] for band in found],
        centre_nm=np.array([band[1] for band in found]),
        range_nm=np.array([band[2:4] for band in found]),
        weights=np.array([band[4] for band in found]),
    )
