"""From measured spectra to the snow."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._bands import bands as _bands
from ._database import _DESCRIBED, Database, Quantity

if TYPE_CHECKING:
    import xarray

#: Range ``(min, max)``; a Gaussian or a range as text, ``"26+-3"`` or ``"20..60"``; ``None`` for
#: the whole axis.
Prior = Union[None, tuple[float, float], str]

# Largest distance between two measured wavelengths over which values are interpolated, nm.
_MAX_GAP_NM = 30.0
_WAVELENGTH_DIMENSIONS = ("wavelength_nm", "wavelength", "wavelengths", "band")
_MEASURES = {
    "ssa_m2_kg": ("m2 kg-1", "specific surface area of the grains"),
    "optical_radius_um": ("um", "optical radius of the grains"),
}


@dataclass(frozen=True, eq=False)
class Retrieval:
    """The snow of each measured spectrum. ``...`` is the shape of the spectra without the
    wavelengths; spectra with NaN have NaN here."""

    names: tuple[str, ...]
    """Names of the ``k`` quantities: specific surface area and optical radius, if the grain size
    is unknown and the file states its grains, then the ``d`` unknowns."""
    unknowns: tuple[str, ...]
    """Names of the unknowns, the last ``d`` of ``names``."""
    best: NDArray[np.float64]
    """Most probable values, ``(..., k)``."""
    p68: NDArray[np.float64]
    """Ends of the central 68 %, ``(..., k, 2)``."""
    p95: NDArray[np.float64]
    """Ends of the central 95 %, ``(..., k, 2)``."""
    covariance: NDArray[np.float64]
    """Covariance of the unknowns by the derivatives at the optimum (Laplace), ``(..., d, d)``."""
    chi_square: NDArray[np.float64]
    """Chi-square of the values that were used, ``(...)``."""
    converged: NDArray[np.bool_]
    """Whether the search ended, ``(...)``."""
    wavelengths_nm: NDArray[np.float64]
    """Wavelengths of the file that were used, or mean wavelengths of the bands, nm, ``(n,)``."""
    fitted: NDArray[np.float64]
    """Fitted spectra, ``(..., n)``."""
    jacobian: Optional[NDArray[np.float64]]
    """Derivatives of the fitted values with the unknowns, ``(..., n, d)``; ``None`` unless asked
    for."""
    _coords: dict[str, Any] = field(default_factory=dict, repr=False)
    _dims: Optional[tuple[str, ...]] = field(default=None, repr=False)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The most probable values of one quantity, ``(...)``."""
        if name not in self.names:
            raise KeyError(f"there is no {name}; use one of {', '.join(self.names)}")
        values: NDArray[np.float64] = self.best[..., self.names.index(name)]
        return values

    def to_xarray(self) -> xarray.Dataset:
        """The results as an ``xarray.Dataset``: for each quantity its most probable value, and
        ``NAME_low``, ``NAME_high`` of the central 68 %; ``chi_square``, ``converged``, and
        ``fitted`` over ``wavelength_nm``. Dimensions and coordinates are those of the spectra if
        these were a DataArray."""
        try:
            import xarray
        except ImportError as error:
            raise ImportError("to_xarray needs the package xarray: pip install xarray") from error
        shape = self.chi_square.shape
        dims = self._dims or tuple(f"dim_{i}" for i in range(len(shape)))
        variables: dict[str, Any] = {}
        for i, name in enumerate(self.names):
            units, long_name = _MEASURES.get(name) or _description(name)
            for suffix, values in (
                ("", self.best[..., i]),
                ("_low", self.p68[..., i, 0]),
                ("_high", self.p68[..., i, 1]),
            ):
                variables[name + suffix] = (dims, values, {"units": units, "long_name": long_name})
        variables["chi_square"] = (dims, self.chi_square, {"units": "1"})
        variables["converged"] = (dims, self.converged)
        variables["fitted"] = ((*dims, "wavelength_nm"), self.fitted, {"units": "1"})
        coords = {**self._coords, "wavelength_nm": ("wavelength_nm", self.wavelengths_nm)}
        return xarray.Dataset(variables, coords)


def _description(name: str) -> tuple[str, str]:
    stored = {"incidence_angle_deg": "angle_deg"}.get(name, name)
    return _DESCRIBED[stored]


def retrieve(
    spectra: Union[ArrayLike, xarray.DataArray],
    database: Database,
    *,
    wavelengths_nm: Optional[ArrayLike] = None,
    bands: Union[None, str, os.PathLike[str]] = None,
    sun: Union[str, os.PathLike[str]] = "astm_global",
    quantity: Quantity = "reflectance",
    free: Optional[Mapping[str, Prior]] = None,
    fix: Optional[Mapping[str, ArrayLike]] = None,
    sigma: Optional[ArrayLike] = None,
    noise: float = 0.005,
    level: float = 0.02,
    correlated: float = 0.01,
    correlation_nm: float = 100.0,
    intervals: Literal["laplace", "grid"] = "laplace",
    jacobian: bool = False,
) -> Retrieval:
    """The snow of each of ``spectra``, ``(..., l)``, on all cores with the GIL released.

    ``database`` is a compact file that covers the snow. All of its axes with several values are
    unknown, unless ``fix`` gives their value: one number, or for axes (not for ``ssa_m2_kg`` and
    ``optical_radius_um``) an array that broadcasts to the shape ``(...)``. ``free`` gives priors:
    ``{"facetness": (0.1, 0.6), "ssa_m2_kg": "26+-3"}``, as ``--free`` of
    ``splitsnow retrieve``.

    ``wavelengths_nm``, ``(l,)``, are those of the spectra; by default those of the file, or the
    coordinate of a ``DataArray``, whose dimension of wavelengths may be anywhere. Spectra are
    compared at the wavelengths of the file that coincide with one of these or lie between two of
    them at most 30 nm apart.

    With ``bands``, a sensor as :func:`splitsnow.bands` takes it, such as ``"sentinel2a:B3,B8A"``,
    the values of the spectra are averages over its bands under ``sun``, in the order of the
    sensor; then there are no ``wavelengths_nm``.

    The errors are ``sigma``, which broadcasts to the spectra, or else ``noise``, of each value;
    ``level``, relative, of each spectrum; ``correlated``, absolute, correlated over
    ``correlation_nm``; and those that the file states.

    Optima are found by Levenberg and Marquardt from the nearest spectrum of a coarse grid.
    Intervals are those of a Gaussian with the derivatives at the optimum, cut off at the ends of
    the ranges (``"laplace"``), or of the distribution on a grid (``"grid"``), which is exact, a
    thousand times slower, and possible for up to four unknowns.

    Raises ``ValueError`` for values outside the file and statements that contradict each other.
    """
    dims: Optional[tuple[str, ...]] = None
    coords: dict[str, Any] = {}
    if hasattr(spectra, "dims") and hasattr(spectra, "transpose"):
        array: Any = spectra
        names = [name for name in _WAVELENGTH_DIMENSIONS if name in array.dims]
        if len(names) != 1:
            raise ValueError(
                f"the spectra have the dimensions {tuple(array.dims)}; one of them must be "
                f"{' or '.join(_WAVELENGTH_DIMENSIONS)}"
            )
        array = array.transpose(..., names[0])
        dims = tuple(str(name) for name in array.dims[:-1])
        coords = {
            str(name): values
            for name, values in array.coords.items()
            if names[0] not in values.dims
        }
        if wavelengths_nm is None and bands is None and names[0] in array.coords:
            wavelengths_nm = array.coords[names[0]].values
        spectra = array.values
    values = np.asarray(spectra, dtype=np.float64)
    if bands is not None and wavelengths_nm is not None:
        raise ValueError("give bands or wavelengths_nm, not both")
    own = database.wavelengths_nm
    if bands is not None:
        nm = _bands(bands, own, sun).centre_nm
    else:
        nm = own if wavelengths_nm is None else np.asarray(wavelengths_nm, dtype=np.float64)
    if values.ndim == 0 or nm.ndim != 1 or values.shape[-1] != len(nm):
        raise ValueError(
            f"the spectra have the shape {values.shape}; expected (..., {len(nm)}), "
            f"one value per {'wavelength' if bands is None else 'band'}"
        )
    order: Any = slice(None)
    if bands is not None:
        # the bands by increasing wavelength, and the way back
        by_wavelength = np.argsort(nm, kind="stable")
        order = np.argsort(by_wavelength)
        indices, below, share = np.arange(len(nm)), by_wavelength, np.zeros(len(nm))
        used = nm
    else:
        if not (np.isfinite(nm).all() and (np.diff(nm) > 0).all()):
            raise ValueError("wavelengths_nm must be finite and increase")
        indices, below, share = _matched(own, nm)
        used = own[indices]
    shape, n = values.shape[:-1], len(indices)
    rows = np.ascontiguousarray(_between(values, below, share).reshape(-1, n))
    errors = None
    if sigma is not None:
        stated = np.broadcast_to(np.asarray(sigma, dtype=np.float64), values.shape)
        errors = np.ascontiguousarray(_between(stated, below, share).reshape(-1, n))
        if not (errors[np.isfinite(rows).all(axis=1)] > 0).all():
            raise ValueError("sigma must be above 0")
    known, varying = [], []
    for name, value in (fix or {}).items():
        numbers = np.asarray(value, dtype=np.float64)
        if numbers.ndim == 0:
            known.append(f"{name}={float(numbers)!r}")
        else:
            flat = np.ascontiguousarray(np.broadcast_to(numbers, shape)).ravel()
            varying.append((name, flat))
    for name, number in (
        ("noise", noise),
        ("level", level),
        ("correlated", correlated),
        ("correlation_nm", correlation_nm),
    ):
        if not 0 <= number < np.inf:
            raise ValueError(f"{name} = {number} must be finite and not negative")
    if intervals not in ("laplace", "grid"):
        raise ValueError(f"there are no intervals {intervals!r}; use laplace or grid")
    (found, d), arrays, converged = _native.retrieve(
        database._native,
        quantity,
        [int(i) for i in indices],
        None if bands is None else (os.fspath(bands), os.fspath(sun)),
        rows,
        errors,
        ([_statement(name, prior) for name, prior in (free or {}).items()], known, varying),
        (noise, level, correlated, correlation_nm),
        intervals == "grid",
        jacobian,
    )
    parts = dict(arrays)
    k = len(found)
    derivatives = None
    if jacobian:
        derivatives = np.swapaxes(parts["jacobian"].reshape(*shape, d, n)[..., order], -1, -2)
    return Retrieval(
        names=tuple(found),
        unknowns=tuple(found[k - d :]),
        best=parts["best"].reshape(*shape, k),
        p68=parts["p68"].reshape(*shape, k, 2),
        p95=parts["p95"].reshape(*shape, k, 2),
        covariance=parts["covariance"].reshape(*shape, d, d),
        chi_square=parts["chi_square"].reshape(shape),
        converged=np.array(converged, dtype=bool).reshape(shape),
        wavelengths_nm=used,
        fitted=parts["fitted"].reshape(*shape, n)[..., order],
        jacobian=derivatives,
        _coords=coords,
        _dims=dims,
    )


def _statement(name: str, prior: Prior) -> str:
    if prior is None:
        return name
    if isinstance(prior, str):
        return f"{name}={prior}"
    low, high = prior
    return f"{name}={float(low)!r}..{float(high)!r}"


def _matched(
    own: NDArray[np.float64], nm: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Indices of the wavelengths ``own`` that have values; for each, the index of the measured
    wavelength below it, and the share of the next."""
    found: list[tuple[int, int, float]] = []
    for i, wanted in enumerate(own):
        above = int(np.searchsorted(nm, wanted))
        if above < len(nm) and nm[above] == wanted:
            found.append((i, above, 0.0))
        elif 0 < above < len(nm) and nm[above] - nm[above - 1] <= _MAX_GAP_NM:
            gap = nm[above] - nm[above - 1]
            found.append((i, above - 1, float((wanted - nm[above - 1]) / gap)))
    if len(found) < 2:
        raise ValueError(
            f"only {len(found)} wavelengths of the file ({own[0]:g} to {own[-1]:g} nm) have "
            f"values ({nm[0]:g} to {nm[-1]:g} nm), at least 2 are needed; values are interpolated "
            f"between wavelengths at most {_MAX_GAP_NM:g} nm apart"
        )
    indices, below, share = zip(*found)
    return np.array(indices), np.array(below), np.array(share)


def _between(
    values: NDArray[np.float64], below: NDArray[np.intp], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Linear interpolation along the last axis."""
    next_ = values[..., np.minimum(below + 1, values.shape[-1] - 1)]
    mixed = values[..., below] * (1 - share) + next_ * share
    return np.where(share == 0, values[..., below], mixed)
