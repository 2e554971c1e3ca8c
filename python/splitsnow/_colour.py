"""Colours of spectra, with the CIE 1931 2-degree observer."""

from __future__ import annotations

import logging
import os
from typing import Any, Literal, Sequence, Tuple, Union, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

Name = Literal["E", "D55", "D65", "LED-B5", "FL3.15", "A", "D50"]
# A name, the path of a table of relative power, or wavelengths in nm and relative power.
Illuminant = Union[Name, str, "os.PathLike[str]", Tuple[ArrayLike, ArrayLike]]
ILLUMINANTS: Sequence[Illuminant] = ("E", "D55", "D65", "LED-B5", "FL3.15")


def xyz(
    spectrum: ArrayLike, wavelengths_nm: ArrayLike, illuminant: Illuminant = "E"
) -> NDArray[np.float64]:
    """CIE XYZ of spectra, shape ``(..., 3)``; a spectrum of 1 has Y = 1.

    ``spectrum`` is ``(..., l)``, dimensionless, at ``wavelengths_nm``, ``(l,)`` and
    increasing. It is interpolated linearly between the wavelengths; wavelengths beyond
    the ends do not contribute.

    ``illuminant`` is a name, the path of a table of relative power (any format that
    ``splitsnow compress --illuminant`` accepts), or a pair of arrays, wavelengths in nm
    and relative power. The logger ``splitsnow`` reports at level INFO how a file was
    read.
    """
    return _colours(spectrum, wavelengths_nm, "xyz", illuminant)


def lab(
    spectrum: ArrayLike, wavelengths_nm: ArrayLike, illuminant: Illuminant = "E"
) -> NDArray[np.float64]:
    """CIELAB of spectra, shape ``(..., 3)``: L* in [0, 100], a*, b*.

    White, L* = 100, is a spectrum of 1 under the same illuminant. The arguments are
    those of :func:`xyz`.
    """
    return _colours(spectrum, wavelengths_nm, "lab", illuminant)


def srgb(
    spectrum: ArrayLike,
    wavelengths_nm: ArrayLike,
    illuminant: Illuminant = "E",
    *,
    linear: bool = False,
    clip: bool = True,
) -> NDArray[np.float64]:
    """sRGB of spectra, shape ``(..., 3)``, in [0, 1].

    A spectrum of 1 is (1, 1, 1) under any illuminant: X, Y and Z are scaled from the
    white of the illuminant to D65, the white of sRGB. ``linear=True`` omits the gamma
    encoding of IEC 61966-2-1. ``clip=False`` keeps colours out of gamut, below 0 or
    above 1. The other arguments are those of :func:`xyz`.
    """
    space = "linear_srgb" if linear else "srgb"
    colours = _colours(spectrum, wavelengths_nm, space, illuminant)
    return np.clip(colours, 0.0, 1.0) if clip else colours


def swatch(
    spectra: ArrayLike,
    wavelengths_nm: ArrayLike,
    illuminants: Sequence[Illuminant] = ILLUMINANTS,
    *,
    exposure: float = 1.0,
    patch: int = 48,
) -> NDArray[np.uint8]:
    """An sRGB image of colour patches, shape ``(rows, columns, 3)``.

    ``spectra`` is ``(n, l)`` or ``(l,)``. The image has a column for each spectrum and a
    row for each of ``illuminants``; each patch has ``patch`` x ``patch`` pixels. Spectra
    are multiplied by ``exposure``, to brighten dark snow; colours out of gamut are
    clipped. Save the image with ``PIL.Image.fromarray(image).save("swatch.png")``.
    """
    if not (np.isfinite(exposure) and exposure > 0):
        raise ValueError(f"exposure = {exposure} must be above 0")
    if patch < 1:
        raise ValueError(f"patch = {patch} must be 1 or more")
    exposed = np.atleast_2d(np.asarray(spectra, dtype=np.float64)) * exposure
    if exposed.ndim != 2:
        raise ValueError(f"spectra have shape {exposed.shape}; expected (n, l) or (l,)")
    rows = [srgb(exposed, wavelengths_nm, illuminant) for illuminant in illuminants]
    colours = np.round(255 * np.array(rows).reshape(len(rows), -1, 3)).astype(np.uint8)
    return colours.repeat(patch, axis=0).repeat(patch, axis=1)


def _colours(
    spectrum: ArrayLike, wavelengths_nm: ArrayLike, space: str, illuminant: Illuminant
) -> NDArray[np.float64]:
    spectra = np.asarray(spectrum, dtype=np.float64)
    wavelengths = np.asarray(wavelengths_nm, dtype=np.float64).ravel()
    if spectra.ndim == 0 or spectra.shape[-1] != wavelengths.size:
        raise ValueError(
            f"spectra have shape {spectra.shape}; their last axis must have "
            f"{wavelengths.size} values, one per wavelength"
        )
    rows = np.ascontiguousarray(spectra).reshape(-1, wavelengths.size)
    colours = np.empty(spectra.shape[:-1] + (3,))
    viewing = (space, native_illuminant(illuminant))
    _native.colours(rows, wavelengths.tolist(), viewing, colours.reshape(-1, 3))
    return colours


def native_illuminant(illuminant: Illuminant) -> Any:
    """Converts to the form of ``_native``: a name, or the numbers of a table."""
    if isinstance(illuminant, str) and illuminant in get_args(Name):
        return illuminant
    if isinstance(illuminant, (str, os.PathLike)):
        path = os.fspath(illuminant)
        wavelengths_nm, power, report = _native.illuminant(path)
        logging.getLogger("splitsnow").info("read %s: %s", path, report)
        return wavelengths_nm, power
    columns = [np.asarray(column, dtype=np.float64).ravel().tolist() for column in illuminant]
    if len(columns) != 2:
        raise ValueError(
            "illuminant must be a name, a path, or a pair of arrays, wavelengths in nm and "
            f"relative power, not {len(columns)} columns"
        )
    return tuple(columns)
