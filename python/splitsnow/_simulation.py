"""Simulation of one snow sample in a virtual spectrophotometer."""

from __future__ import annotations

import json
import logging
import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

Engine = Literal["auto", "reference", "spectral", "tabulated", "hybrid"]


@dataclass(frozen=True, eq=False)
class Simulation:
    """Simulated spectra of a sample with standard errors; all arrays are ``(l,)``."""

    wavelengths_nm: NDArray[np.float64]
    """Wavelengths, nm."""
    reflectance: NDArray[np.float64]
    """Reflectance, [0, 1]."""
    reflectance_se: NDArray[np.float64]
    """Standard error of the reflectance."""
    transmittance: NDArray[np.float64]
    """Transmittance, [0, 1]."""
    transmittance_se: NDArray[np.float64]
    """Standard error of the transmittance."""
    absorptance: NDArray[np.float64]
    """1 - reflectance - transmittance."""
    absorptance_se: NDArray[np.float64]
    """Upper bound of the standard error of the absorptance: the sum of the other two,
    because they share walks."""
    lost_share: NDArray[np.float64]
    """Fraction of the rays stopped at the event limit, counted as absorbed."""
    engine: str
    """Engine that ran; never ``"auto"``."""
    rays: int
    """Requested number of walks."""
    seed: int
    """Seed of the random streams."""


def simulate(
    sample: Union[str, os.PathLike[str], Mapping[str, Any]],
    *,
    engine: Engine = "auto",
    rays: Optional[int] = None,
    seed: int = 1,
    max_error: Union[None, float, Mapping[str, float]] = None,
) -> Simulation:
    """Simulates reflectance and transmittance of a snow sample, as ``splitsnow simulate``.

    ``sample`` is the path of a sample file, its TOML text (any string of several
    lines), or its keys as a mapping (docs/formats.md). CSV paths in a text or mapping
    are relative to the working directory. ``rays`` is the number of walks: per
    wavelength in ``reference``, per node of refractive index in ``spectral`` and
    ``tabulated``, from every direction in ``hybrid``; by default 32,768 in ``hybrid`` and
    ``auto`` and 131,072 in the others.
    ``max_error``, for the engine ``auto`` only, is the largest error allowed: the RMSE
    over the wavelengths as a number, or a mapping with ``"rmse"`` and ``"delta_e"``. If
    ``rays`` is not given, as many are walked as it takes: few first, then as many as their
    standard errors ask for. The result states their number.

    The GIL is released, and Ctrl-C stops the simulation. Results depend only on the
    sample, engine, rays and seed. Raises ``ValueError`` for an invalid sample or
    argument.
    """
    file = _file(sample, rays, seed)
    bounds = None
    if isinstance(max_error, Mapping):
        unknown = set(max_error) - {"delta_e", "rmse"}
        if unknown:
            raise ValueError(
                f"max_error may have the keys delta_e and rmse, not {', '.join(sorted(unknown))}"
            )
        bounds = (max_error.get("delta_e"), max_error.get("rmse"))
    elif max_error is not None:
        bounds = (None, float(max_error))
    result = _native.simulate(file, engine, rays, seed, bounds)
    _tell(result)
    return Simulation(**result)


@dataclass(frozen=True, eq=False)
class Profile:
    """Light inside a sample against depth, per incident flux, with standard errors. Arrays are
    ``(l, d)``, wavelengths times depths; those of the absorbed power are ``(l, d - 1)``."""

    wavelengths_nm: NDArray[np.float64]
    """Wavelengths, nm, ``(l,)``."""
    depths_cm: NDArray[np.float64]
    """Depths below the surface, cm, ``(d,)``: those asked for, the surface and the base."""
    downwelling: NDArray[np.float64]
    """Flux that crosses the depth downward."""
    downwelling_se: NDArray[np.float64]
    """Standard error of the downwelling flux."""
    upwelling: NDArray[np.float64]
    """Flux that crosses the depth upward."""
    upwelling_se: NDArray[np.float64]
    """Standard error of the upwelling flux."""
    actinic: NDArray[np.float64]
    """Actinic flux: the radiance integrated over all directions (spherical irradiance)."""
    actinic_se: NDArray[np.float64]
    """Standard error of the actinic flux."""
    absorbed_per_m: NDArray[np.float64]
    """Power absorbed per volume between a depth and the next, 1/m: W/m3 per W/m2."""
    absorbed_per_m_se: NDArray[np.float64]
    """Standard error of the absorbed power."""
    lost_share: float
    """Largest fraction of the rays stopped at the event limit."""
    engine: str
    """Engine that ran; never ``"auto"``."""
    rays: int
    """Requested number of walks."""
    seed: int
    """Seed of the random streams."""


def profile(
    sample: Union[str, os.PathLike[str], Mapping[str, Any]],
    depths_cm: ArrayLike,
    *,
    engine: Engine = "auto",
    rays: Optional[int] = None,
    seed: int = 1,
) -> Profile:
    """Simulates the light inside a snow sample at ``depths_cm``, numbers from 0 (the surface) to
    its thickness, as ``splitsnow simulate --depths-cm``.

    ``sample``, ``rays`` and ``seed`` are as in :func:`simulate`. The engines are ``hybrid``
    (``auto``), ``spectral`` and ``reference``. Averages over bands are
    ``bands.average(found.downwelling.T).T``; those of standard errors are upper bounds.

    Raises ``ValueError`` for an invalid sample or argument, and for a depth outside the snow.
    """
    file = _file(sample, rays, seed)
    depths = np.atleast_1d(np.asarray(depths_cm, dtype=np.float64))
    if depths.ndim != 1 or not (np.isfinite(depths).all() and (depths >= 0).all()):
        raise ValueError("depths_cm must be a list of finite numbers of 0 or more")
    result = _native.profile(file, depths.tolist(), engine, rays, seed)
    _tell(result)
    shape = (len(result["wavelengths_nm"]), -1)
    light = {
        name + end: result.pop(name + end).reshape(shape)
        for name in ("downwelling", "upwelling", "actinic", "absorbed_per_m")
        for end in ("", "_se")
    }
    return Profile(**light, **result)


def _file(
    sample: Union[str, os.PathLike[str], Mapping[str, Any]], rays: Optional[int], seed: int
) -> tuple[str, str, bool]:
    """Name and text of a sample, and whether the text is JSON."""
    for name, value in (("rays", rays), ("seed", seed)):
        if value is not None and not 0 <= value < 2**64:
            raise ValueError(f"{name} = {value} must be a whole number from 0 to 2^64 - 1")
    if isinstance(sample, Mapping):
        return ("sample", json.dumps(sample, default=_plain), True)
    if isinstance(sample, str) and "\n" in sample:
        return ("sample", sample, False)
    path = os.fspath(sample)
    return (path, Path(path).read_text(encoding="utf-8"), False)


def _tell(result: dict[str, Any]) -> None:
    """Takes warnings and notes out of a result and passes them on to the caller."""
    for warning in result.pop("warnings"):
        warnings.warn(warning, stacklevel=3)
    for note in result.pop("notes"):
        logging.getLogger("splitsnow").info(note)


def _plain(value: Any) -> Any:
    """Converts NumPy numbers and arrays to plain Python values for JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(
        f"a sample may hold numbers, strings, lists and mappings, not {type(value).__name__}"
    )
