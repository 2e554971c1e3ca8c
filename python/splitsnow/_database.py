"""Look-ups in a compact file."""

from __future__ import annotations

import functools
import json
import os
from typing import TYPE_CHECKING, Any, Callable, Literal, Mapping, Optional, TypeVar, Union, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._colour import Illuminant, native_illuminant

if TYPE_CHECKING:
    import xarray

Method = Literal["smooth", "varsa2025"]
Quantity = Literal["transmittance", "reflectance"]

# Unit and long name of each axis.
_DESCRIBED = {name: (unit, long_name) for name, unit, long_name in _native.parameters()}
_DESCRIBED["wavelength_nm"] = ("nm", "wavelength in vacuum")


_Function = TypeVar("_Function", bound=Callable[..., Any])


def former_name(function: _Function) -> _Function:
    """Makes ``function`` also accept ``angle_deg``, the name of ``incidence_angle_deg`` in
    version 0.1."""

    @functools.wraps(function)
    def renamed(*args: Any, **kwargs: Any) -> Any:
        if "angle_deg" in kwargs and "incidence_angle_deg" not in kwargs:
            kwargs["incidence_angle_deg"] = kwargs.pop("angle_deg")
        return function(*args, **kwargs)

    return cast(_Function, renamed)


class Database:
    """A compact file in memory, with look-ups anywhere within its axes.

    A file of anisotropy factors can be opened too, for its nodes; its look-ups are those of
    :class:`Directions`.

    Look-ups run on all cores with the GIL released, and any number of Python threads
    may share one database. A database is pickled as its path.
    """

    def __init__(self, path: Union[str, os.PathLike[str]]) -> None:
        """Same as :meth:`open`."""
        self._path = os.path.abspath(os.fspath(path))
        self._native = _native.Database(self._path)

    @classmethod
    def open(cls, path: Union[str, os.PathLike[str]]) -> Database:
        """Reads a compact file, given its path or that of an output directory.

        Raises ``OSError`` if the file cannot be read and ``ValueError`` if it is not a
        valid compact file.
        """
        return cls(path)

    @property
    def path(self) -> str:
        """Absolute path that was opened: of the file, or of its directory."""
        return self._path

    @property
    def wavelengths_nm(self) -> NDArray[np.float64]:
        """Wavelengths of the spectra, nm, shape ``(l,)``, increasing."""
        return self._native.wavelengths_nm

    @property
    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Nodes of the axes by name, each ``(n,)`` and increasing, slowest first:
        optional axes, if any, then facetness, grain_size_um, density_kg_m3,
        thickness_cm and angle_deg. The names include the units."""
        return dict(self._native.axes)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities in the file: ``"transmittance"``, ``"reflectance"`` or both."""
        return tuple(name for name, _ in self._native.components)

    @property
    def components(self) -> dict[str, int]:
        """Number of components of each quantity."""
        return dict(self._native.components)

    @property
    def basis(self) -> str:
        """Variable that the components represent: ``"linear"``, the spectra, or
        ``"log"``, their logarithms."""
        return self._native.basis

    @property
    def precision(self) -> str:
        """Number format of the coefficients in the file: ``"f32"``, ``"f16"`` or
        ``"quantised"``."""
        return self._native.precision

    @property
    def metadata(self) -> dict[str, str]:
        """Metadata of the file (docs/formats.md)."""
        return self._native.metadata

    @property
    def error_budget(self) -> Optional[dict[str, Any]]:
        """Error budget: errors of look-ups against new simulations (docs/formats.md).
        ``None`` if neither ``splitsnow verify`` nor ``tailor`` has measured them."""
        text = self.metadata.get("error_budget", self.metadata.get("certificate"))
        return None if text is None else dict(json.loads(text))

    #: Former name of :attr:`error_budget`.
    certificate = error_budget

    @former_name
    def transmittance(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike,
        *,
        method: Method = "smooth",
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Directional-hemispherical transmittance. The shape is the broadcast shape of
        the arguments followed by ``(l,)``.

        The arguments are scalars or arrays that broadcast: mean facetness of the
        grains, mean length of their major axis in um, density of the dry snow in
        kg/m3, thickness in cm (0 or more; inf is a half space), incidence angle from the
        normal in degrees.
        Values on optional axes are single numbers, given by name, as in
        ``black_carbon_ng_g=50``, or in ``conditions``.

        ``method="varsa2025"`` interpolates as Varsa 2025 does, in thickness and angle
        only. With ``wavelengths_nm``, ``(l,)``, spectra are interpolated linearly
        between the wavelengths of the file. Beyond its ends they are constant, or with
        ``clamp=False`` an error.

        Raises ``ValueError`` if a point is outside the database; the message names the
        first such element, the axis and its range. NaN counts as outside.
        """
        request = self._request("transmittance", method, conditions, more_conditions)
        points = (facetness, grain_size_um, density_kg_m3, thickness_cm, incidence_angle_deg)
        return self._spectra(request, points, wavelengths_nm, clamp)

    @former_name
    def reflectance(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike,
        *,
        method: Method = "smooth",
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Directional-hemispherical reflectance; as :meth:`transmittance`."""
        request = self._request("reflectance", method, conditions, more_conditions)
        points = (facetness, grain_size_um, density_kg_m3, thickness_cm, incidence_angle_deg)
        return self._spectra(request, points, wavelengths_nm, clamp)

    @former_name
    def lab(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike,
        *,
        quantity: Quantity = "transmittance",
        illuminant: Illuminant = "E",
        method: Method = "smooth",
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float64]:
        """CIELAB of the spectra: L* in [0, 100], a*, b*. The shape is the broadcast
        shape followed by ``(3,)``. White is a spectrum of 1 under the same illuminant.

        The arguments are those of :meth:`transmittance`; see :func:`splitsnow.lab`.
        """
        request = self._request(quantity, method, conditions, more_conditions)
        points = (facetness, grain_size_um, density_kg_m3, thickness_cm, incidence_angle_deg)
        return self._colours(request, points, ("lab", native_illuminant(illuminant)))

    @former_name
    def srgb(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike,
        *,
        quantity: Quantity = "transmittance",
        illuminant: Illuminant = "E",
        linear: bool = False,
        clip: bool = True,
        method: Method = "smooth",
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float64]:
        """sRGB of the spectra, in [0, 1]. The shape is the broadcast shape followed by
        ``(3,)``. A spectrum of 1 is (1, 1, 1) under any illuminant.

        The arguments are those of :meth:`transmittance` and of :func:`splitsnow.srgb`.
        """
        request = self._request(quantity, method, conditions, more_conditions)
        points = (facetness, grain_size_um, density_kg_m3, thickness_cm, incidence_angle_deg)
        space = "linear_srgb" if linear else "srgb"
        colours = self._colours(request, points, (space, native_illuminant(illuminant)))
        return np.clip(colours, 0.0, 1.0, out=colours) if clip else colours

    def to_xarray(self) -> xarray.Dataset:
        """The curves at the nodes as an ``xarray.Dataset``: one variable per quantity
        over all axes and ``wavelength_nm``, with units, and the metadata as
        attributes. In a file of anisotropy factors, ``reflectance`` and ``transmittance``
        are those of reflected and transmitted light."""
        try:
            import xarray
        except ImportError as error:
            raise ImportError("to_xarray needs the package xarray: pip install xarray") from error
        nodes: dict[str, NDArray[Any]] = {**self.axes, "wavelength_nm": self.wavelengths_nm}
        coords: dict[str, Any] = {}
        for name, values in nodes.items():
            units, long_name = _DESCRIBED[name]
            coords[name] = (name, values, {"units": units, "long_name": long_name})
        shape = tuple(len(values) for values in nodes.values())
        variables = {}
        for quantity in self.quantities:
            curves = np.empty(shape, np.float32)
            self._native.nodes(quantity, curves.reshape(-1, shape[-1]))
            long_name = f"directional-hemispherical {quantity}"
            if "view_deg" in self.axes:
                light = {"reflectance": "reflected", "transmittance": "transmitted"}[quantity]
                long_name = f"anisotropy factor of {light} light"
            variables[quantity] = (list(coords), curves, {"units": "1", "long_name": long_name})
        return xarray.Dataset(variables, coords, self.metadata)

    def __reduce__(self) -> tuple[type[Database], tuple[str]]:
        return type(self), (self._path,)

    def __repr__(self) -> str:
        axes = " x ".join(f"{len(values)} {name}" for name, values in self.axes.items())
        nm = self.wavelengths_nm
        quantities = ", ".join(self.quantities)
        return (
            f"<splitsnow.Database {self._path!r}: {quantities}; {axes}; "
            f"{len(nm)} wavelengths, {nm[0]:g}-{nm[-1]:g} nm>"
        )

    @staticmethod
    def _request(
        quantity: str,
        method: str,
        conditions: Optional[Mapping[str, float]],
        more: Mapping[str, float],
    ) -> tuple[str, str, list[tuple[str, float]]]:
        return quantity, method, condition_values(conditions, more)

    def _spectra(
        self,
        request: tuple[str, str, list[tuple[str, float]]],
        points: tuple[ArrayLike, ...],
        wavelengths_nm: Optional[ArrayLike],
        clamp: bool,
    ) -> NDArray[np.float32]:
        requested_nm = requested_wavelengths(self.wavelengths_nm, wavelengths_nm, clamp)
        return spectra(self._native, request, points, requested_nm)

    def _colours(
        self,
        request: tuple[str, str, list[tuple[str, float]]],
        points: tuple[ArrayLike, ...],
        viewing: tuple[str, Any],
    ) -> NDArray[np.float64]:
        columns, shape = _broadcast(points)
        out = np.empty(shape + (3,))
        self._native.colours(request, columns, shape, viewing, out.reshape(-1, 3))
        return out


def _broadcast(
    points: tuple[ArrayLike, ...],
) -> tuple[list[NDArray[np.float64]], tuple[int, ...]]:
    """Each coordinate as a flat array with one value, or one per point, and the
    broadcast shape.

    The arrays are copies, so that they cannot change while the GIL is released."""
    arrays = [np.asarray(values, dtype=np.float64) for values in points]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    columns = [
        np.array(array if array.size == 1 else np.broadcast_to(array, shape)).ravel()
        for array in arrays
    ]
    return columns, shape


def spectra(
    native: Any,
    request: Any,
    points: tuple[ArrayLike, ...],
    requested_nm: Optional[list[float]],
) -> NDArray[np.float32]:
    """The spectra of ``native`` at these points, at its own or the requested wavelengths."""
    columns, shape = _broadcast(points)
    l = len(native.wavelengths_nm if requested_nm is None else requested_nm)
    out = np.empty(shape + (l,), np.float32)
    native.spectra(request, columns, shape, requested_nm, out.reshape(-1, l))
    return out


def requested_wavelengths(
    own: NDArray[np.float64], wavelengths_nm: Optional[ArrayLike], clamp: bool
) -> Optional[list[float]]:
    """The wavelengths to interpolate to, as a list; ``None`` for those of the file, ``own``."""
    if wavelengths_nm is None:
        return None
    wavelengths = np.asarray(wavelengths_nm, dtype=np.float64)
    if wavelengths.ndim != 1 or wavelengths.size == 0:
        raise ValueError(
            f"wavelengths_nm has shape {wavelengths.shape}; expected a non-empty list of numbers"
        )
    if not np.isfinite(wavelengths).all():
        raise ValueError("wavelengths_nm must be finite")
    if not clamp and (wavelengths.min() < own[0] or wavelengths.max() > own[-1]):
        raise ValueError(
            f"wavelengths_nm reach from {wavelengths.min():g} to {wavelengths.max():g} nm; the "
            f"database covers {own[0]:g} to {own[-1]:g} nm (clamp=True extends its ends)"
        )
    return [float(value) for value in wavelengths]


def condition_values(
    conditions: Optional[Mapping[str, float]], more: Mapping[str, float]
) -> list[tuple[str, float]]:
    """Values on optional axes, by name."""
    merged = {**(conditions or {}), **more}
    return [(name, float(value)) for name, value in merged.items()]
