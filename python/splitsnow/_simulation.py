"""The virtual spectrophotometer on one snow sample."""

from __future__ import annotations

import json
import logging
import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Mapping, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _native

Engine = Literal["auto", "reference", "spectral", "tabulated", "hybrid"]


@dataclass(frozen=True, eq=False)
class Simulation:
    """Spectra of a sample with standard errors; all arrays are ``(l,)``."""

    wavelengths_nm: NDArray[np.float64]
    """Wavelengths, nm."""
    reflectance: NDArray[np.float64]
    """Reflectance, [0, 1]."""
    reflectance_se: NDArray[np.float64]
    """Its standard error."""
    transmittance: NDArray[np.float64]
    """Transmittance, [0, 1]."""
    transmittance_se: NDArray[np.float64]
    """Its standard error."""
    absorptance: NDArray[np.float64]
    """1 - reflectance - transmittance."""
    absorptance_se: NDArray[np.float64]
    """Its standard error at most: the sum of the two, which share walks."""
    lost_share: NDArray[np.float64]
    """Share of the rays stopped at the event limit, counted as absorbed."""
    engine: str
    """The engine that ran; never ``"auto"``."""
    rays: int
    """Walks asked for."""
    seed: int
    """Seed of the random numbers."""


def simulate(
    sample: Union[str, os.PathLike[str], Mapping[str, Any]],
    *,
    engine: Engine = "auto",
    rays: Optional[int] = None,
    seed: int = 1,
    max_error: Union[None, float, Mapping[str, float]] = None,
) -> Simulation:
    """Reflectance and transmittance of a snow sample, as ``splitsnow simulate`` does.

    ``sample`` is the path of a sample file, the TOML text of one (any string of
    several lines), or its keys as a mapping (docs/formats.md; CSV paths in text or
    mapping are relative to the working directory). ``rays`` are walks: per
    wavelength in ``reference``, per node of refractive index in ``spectral`` and
    ``tabulated``, from every direction in ``hybrid``; 131,072 if not given.
    ``max_error``, for ``auto`` alone, is the error it may leave: the RMSE over the
    wavelengths as a number, or a mapping of ``"rmse"`` and ``"delta_e"``; it decides
    the rays if they are not given.

    The GIL is released, Ctrl-C stops it. Results depend on the sample, engine, rays
    and seed alone. Raises ``ValueError`` for a sample or argument that is refused.
    """
    if isinstance(sample, Mapping):
        text = json.dumps(sample, default=_plain)
        file = ("sample", text, True)
    elif isinstance(sample, str) and "\n" in sample:
        file = ("sample", sample, False)
    else:
        path = os.fspath(sample)
        file = (path, Path(path).read_text(encoding="utf-8"), False)
    for name, value in (("rays", rays), ("seed", seed)):
        if value is not None and not 0 <= value < 2**64:
            raise ValueError(f"{name} = {value} must be a whole number from 0 to 2^64 - 1")
    bounds = None
    if isinstance(max_error, Mapping):
        unknown = set(max_error) - {"delta_e", "rmse"}
        if unknown:
            raise ValueError(f"max_error has delta_e and rmse, not {', '.join(sorted(unknown))}")
        bounds = (max_error.get("delta_e"), max_error.get("rmse"))
    elif max_error is not None:
        bounds = (None, float(max_error))
    result = _native.simulate(file, engine, rays, seed, bounds)
    for warning in result.pop("warnings"):
        warnings.warn(warning, stacklevel=2)
    for note in result.pop("notes"):
        logging.getLogger("splitsnow").info(note)
    return Simulation(**result)


def _plain(value: Any) -> Any:
    """Numbers and arrays of numpy as JSON has them."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a sample holds numbers, strings, lists and tables, not {type(value).__name__}")
