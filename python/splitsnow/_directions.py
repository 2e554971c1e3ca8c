"""Look-ups of the light toward views."""

from __future__ import annotations

import os
from typing import Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._database import condition_values, former_name, requested_wavelengths, spectra


class Directions:
    """The light that leaves the snow toward views, under one kind of light.

    Two compact files are in memory: one of reflectance and transmittance, and one of their
    anisotropy factors, which the look-ups multiply. Names of quantities are those of
    Schaepman-Strub et al. (2006).

    Look-ups run on all cores with the GIL released, and any number of Python threads may
    share one object. It is pickled as its paths.
    """

    def __init__(
        self,
        path: Union[str, os.PathLike[str]],
        anisotropy_path: Union[None, str, os.PathLike[str]] = None,
        diffuse: bool = False,
    ) -> None:
        """Reads the two files of an output directory, or the file of reflectance and
        transmittance at ``path`` and that of anisotropy factors at ``anisotropy_path``.

        The files of a directory are ``snow.safetensors`` and ``views.safetensors``. With
        ``diffuse=True`` they are ``diffuse.safetensors`` and ``views_diffuse.safetensors``,
        of isotropic light.

        Raises ``OSError`` if a file cannot be read, and ``ValueError`` if it is not a valid
        compact file or the files do not belong together.
        """
        self._path = os.path.abspath(os.fspath(path))
        self._anisotropy_path = None
        if anisotropy_path is not None:
            self._anisotropy_path = os.path.abspath(os.fspath(anisotropy_path))
        self._diffuse = bool(diffuse)
        self._native = _native.Directions(self._path, self._anisotropy_path, self._diffuse)

    @classmethod
    def open(
        cls,
        path: Union[str, os.PathLike[str]],
        anisotropy_path: Union[None, str, os.PathLike[str]] = None,
        diffuse: bool = False,
    ) -> Directions:
        """Same as the constructor."""
        return cls(path, anisotropy_path, diffuse)

    @property
    def path(self) -> str:
        """Absolute path that was opened: of the directory, or of the file of reflectance and
        transmittance."""
        return self._path

    @property
    def diffuse(self) -> bool:
        """Whether the light is diffuse (isotropic)."""
        return self._diffuse

    @property
    def wavelengths_nm(self) -> NDArray[np.float64]:
        """Wavelengths of the spectra, nm, shape ``(l,)``, increasing."""
        return self._native.wavelengths_nm

    @property
    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Nodes of the axes by name, each ``(n,)`` and increasing, slowest first:
        view_deg and relative_azimuth_deg, then those of :attr:`Database.axes`."""
        return dict(self._native.axes)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the look-ups that the files can answer: ``"brf"``,
        ``"anisotropy_factor"`` and ``"btf"``, or with diffuse light ``"hdrf"``,
        ``"anisotropy_factor"`` and ``"hdtf"``."""
        return tuple(self._native.quantities)

    @former_name
    def brf(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike,
        *,
        view_deg: ArrayLike,
        relative_azimuth_deg: ArrayLike,
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Bidirectional reflectance factor (BRF): pi times the radiance of the reflected
        light over the irradiance, under collimated light. The shape is the broadcast shape
        of the arguments followed by ``(l,)``.

        The arguments are scalars or arrays that broadcast: those of
        :meth:`Database.transmittance`, the angle of the view from the normal in degrees,
        and its azimuth relative to the direction in which the light travels: 0 is forward,
        180 back toward the light. Azimuths phi, -phi and phi + 360 are the same.

        The factor may exceed 1. :func:`splitsnow.srgb` and :func:`splitsnow.lab` convert
        it to colours.

        Raises ``ValueError`` if a point is outside the axes; the message names the first
        such element, the axis and its range.
        """
        request = ("brf", condition_values(conditions, more_conditions))
        slab = (facetness, grain_size_um, density_kg_m3, thickness_cm)
        angles = (incidence_angle_deg, view_deg, relative_azimuth_deg)
        return self._spectra(request, slab + angles, wavelengths_nm, clamp)

    @former_name
    def hdrf(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike = 0.0,
        *,
        view_deg: ArrayLike,
        relative_azimuth_deg: ArrayLike = 0.0,
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Hemispherical-directional reflectance factor (HDRF): as :meth:`brf`, under
        diffuse light. This light has no direction: the incidence angle is 0, the one that
        stands for all directions, and the azimuth has no effect."""
        request = ("hdrf", condition_values(conditions, more_conditions))
        slab = (facetness, grain_size_um, density_kg_m3, thickness_cm)
        angles = (incidence_angle_deg, view_deg, relative_azimuth_deg)
        return self._spectra(request, slab + angles, wavelengths_nm, clamp)

    @former_name
    def btf(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike,
        *,
        view_deg: ArrayLike,
        relative_azimuth_deg: ArrayLike,
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Bidirectional transmittance factor (BTF): as :meth:`brf`, of the light that
        leaves the snow at the bottom. ``view_deg`` is the angle from the normal that points
        down."""
        request = ("btf", condition_values(conditions, more_conditions))
        slab = (facetness, grain_size_um, density_kg_m3, thickness_cm)
        angles = (incidence_angle_deg, view_deg, relative_azimuth_deg)
        return self._spectra(request, slab + angles, wavelengths_nm, clamp)

    @former_name
    def hdtf(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: ArrayLike = 0.0,
        *,
        view_deg: ArrayLike,
        relative_azimuth_deg: ArrayLike = 0.0,
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Hemispherical-directional transmittance factor (HDTF): as :meth:`btf`, under
        diffuse light, with the arguments of :meth:`hdrf`."""
        request = ("hdtf", condition_values(conditions, more_conditions))
        slab = (facetness, grain_size_um, density_kg_m3, thickness_cm)
        angles = (incidence_angle_deg, view_deg, relative_azimuth_deg)
        return self._spectra(request, slab + angles, wavelengths_nm, clamp)

    @former_name
    def anisotropy_factor(
        self,
        facetness: ArrayLike,
        grain_size_um: ArrayLike,
        density_kg_m3: ArrayLike,
        thickness_cm: ArrayLike,
        incidence_angle_deg: Optional[ArrayLike] = None,
        *,
        view_deg: ArrayLike,
        relative_azimuth_deg: Optional[ArrayLike] = None,
        wavelengths_nm: Optional[ArrayLike] = None,
        clamp: bool = True,
        conditions: Optional[Mapping[str, float]] = None,
        **more_conditions: float,
    ) -> NDArray[np.float32]:
        """Anisotropy factor of the reflected light: the reflectance factor toward the
        view over the reflectance. It is 1 in all directions for a Lambertian reflector.

        The arguments are those of :meth:`brf`, under diffuse light those of :meth:`hdrf`.
        Beyond the first and the last thickness of the file the factor is constant."""
        if self.diffuse:
            incidence_angle_deg = 0.0 if incidence_angle_deg is None else incidence_angle_deg
            relative_azimuth_deg = 0.0 if relative_azimuth_deg is None else relative_azimuth_deg
        if incidence_angle_deg is None or relative_azimuth_deg is None:
            raise TypeError(
                "anisotropy_factor under collimated light needs incidence_angle_deg and "
                "relative_azimuth_deg"
            )
        request = ("anisotropy_factor", condition_values(conditions, more_conditions))
        slab = (facetness, grain_size_um, density_kg_m3, thickness_cm)
        angles = (incidence_angle_deg, view_deg, relative_azimuth_deg)
        return self._spectra(request, slab + angles, wavelengths_nm, clamp)

    def __reduce__(self) -> tuple[type[Directions], tuple[str, Optional[str], bool]]:
        return type(self), (self._path, self._anisotropy_path, self._diffuse)

    def __repr__(self) -> str:
        axes = " x ".join(f"{len(values)} {name}" for name, values in self.axes.items())
        nm = self.wavelengths_nm
        light = "diffuse" if self._diffuse else "collimated"
        return (
            f"<splitsnow.Directions {self._path!r}: {light} light; {', '.join(self.quantities)}; "
            f"{axes}; {len(nm)} wavelengths, {nm[0]:g}-{nm[-1]:g} nm>"
        )

    def _spectra(
        self,
        request: tuple[str, list[tuple[str, float]]],
        points: tuple[ArrayLike, ...],
        wavelengths_nm: Optional[ArrayLike],
        clamp: bool,
    ) -> NDArray[np.float32]:
        requested_nm = requested_wavelengths(self.wavelengths_nm, wavelengths_nm, clamp)
        return spectra(self._native, request, points, requested_nm)
