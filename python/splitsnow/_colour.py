"""Colours of spectra, by the CIE 1931 2-degree observer."""

from __future__ import annotations

import logging
import os
from typing import Any, Literal, Sequence, Tuple, Union, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

Name = Literal["E", "D55", "D65", "LED-B5", "FL3.15", "A", "D50"]
# A name, the path of a table of relative power, or wavelengths in nm and the power there.
Illuminant = Union[Name, str, "os.PathLike[str]", Tuple[ArrayLike, ArrayLike]]
ILLUMINANTS: Sequence[Illuminant] = ("E", "D55", "D65", "LED-B5", "FL3.15")


def xyz(
    spectrum: ArrayLike, wavelengths_nm: ArrayLike, illuminant: Illuminant = "E"
) -> NDArray[np.float64]:
    """CIE XYZ of spectra, shape ``(..., 3)``; a spectrum of 1 has Y = 1.

    ``spectrum`` is ``(..., l)``, dimensionless, at ``wavelengths_nm``, ``(l,)`` and
    increasing. Between them it is a straight line, beyond them not seen.

    ``illuminant`` is a name, the path of a table of relative power (any that
    ``splitsnow compress --illuminant`` takes; the logger ``splitsnow`` tells at level
    INFO how it was read), or a pair of arrays, wavelengths in nm and the power there.
    """
    return _seen(spectrum, wavelengths_nm, "xyz", illuminant)


def lab(
    spectrum: ArrayLike, wavelengths_nm: ArrayLike, illuminant: Illuminant = "E"
) -> NDArray[np.float64]:
    """CIELAB of spectra, shape ``(..., 3)``: L* in [0, 100], a*, b*.

    White, L* = 100, is a spectrum of 1 under the same illuminant; the arguments are
    those of :func:`xyz`.
    """
    return _seen(spectrum, wavelengths_nm, "lab", illuminant)


def srgb(
    spectrum: ArrayLike,
    wavelengths_nm: ArrayLike,
    illuminant: Illuminant = "E",
    *,
    linear: bool = False,
    clip: bool = True,
) -> NDArray[np.float64]:
    """sRGB of spectra, shape ``(..., 3)``, in [0, 1].

    A spectrum of 1 is (1, 1, 1) under any illuminant: X, Y and Z are scaled from its
    white to D65, the white of sRGB. ``linear`` leaves out the encoding of IEC
    61966-2-1 (gamma); ``clip=False`` leaves colours out of gamut as they are, below 0
    or above 1. The other arguments are those of :func:`xyz`.
    """
    space = "linear_srgb" if linear else "srgb"
    found = _seen(spectrum, wavelengths_nm, space, illuminant)
    return np.clip(found, 0.0, 1.0) if clip else found


def swatch(
    spectra: ArrayLike,
    wavelengths_nm: ArrayLike,
    illuminants: Sequence[Illuminant] = ILLUMINANTS,
    *,
    exposure: float = 1.0,
    patch: int = 48,
) -> NDArray[np.uint8]:
    """Patches of colour, an image in sRGB of shape ``(rows, columns, 3)``.

    ``spectra`` is ``(n, l)`` or ``(l,)``: a column for each spectrum, a row for each of
    ``illuminants``, patches of ``patch`` x ``patch`` pixels. Light is multiplied by
    ``exposure``, which dark snow needs; what is out of gamut then is clipped. Save it
    with ``PIL.Image.fromarray(image).save("swatch.png")`` or the like.
    """
    if not (np.isfinite(exposure) and exposure > 0):
        raise ValueError(f"exposure = {exposure} must be above 0")
    if patch < 1:
        raise ValueError(f"patch = {patch} must be 1 or more")
    bright = np.atleast_2d(np.asarray(spectra, dtype=np.float64)) * exposure
    if bright.ndim != 2:
        raise ValueError(f"spectra of shape {bright.shape} must be (n, l) or (l,)")
    rows = [srgb(bright, wavelengths_nm, illuminant) for illuminant in illuminants]
    colours = np.round(255 * np.array(rows).reshape(len(rows), -1, 3)).astype(np.uint8)
    return colours.repeat(patch, axis=0).repeat(patch, axis=1)


def _seen(
    spectrum: ArrayLike, wavelengths_nm: ArrayLike, space: str, illuminant: Illuminant
) -> NDArray[np.float64]:
    spectra = np.asarray(spectrum, dtype=np.float64)
    wavelengths = np.asarray(wavelengths_nm, dtype=np.float64).ravel()
    if spectra.ndim == 0 or spectra.shape[-1] != wavelengths.size:
        raise ValueError(
            f"spectra of shape {spectra.shape} need {wavelengths.size} values, one per "
            "wavelength, along their last axis"
        )
    rows = np.ascontiguousarray(spectra).reshape(-1, wavelengths.size)
    found = np.empty(spectra.shape[:-1] + (3,))
    _native.colours(rows, wavelengths.tolist(), (space, light(illuminant)), found.reshape(-1, 3))
    return found


def light(illuminant: Illuminant) -> Any:
    """An illuminant as the compiled half takes it: a name, or the numbers of a table."""
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
            "an illuminant is a name, a path, or a pair of wavelengths in nm and power, not "
            f"{len(columns)} columns"
        )
    return tuple(columns)
