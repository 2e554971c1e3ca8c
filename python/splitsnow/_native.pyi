"""The compiled part of ``splitsnow``; use the package itself."""

from typing import Any, Final, Optional, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Database",
    "Directions",
    "VERSION",
    "bands",
    "colours",
    "illuminant",
    "parameters",
    "profile",
    "retrieve",
    "simd",
    "simulate",
]

VERSION: Final[str]

def simd() -> str:
    """The instruction set in use: ``SPLITSNOW_SIMD`` or the best of this processor."""

def bands(
    sensor: str, wavelengths_nm: list[float], sun: str
) -> list[tuple[str, float, float, float, list[float]]]: ...
def parameters() -> list[tuple[str, str, str]]: ...

_Viewing = tuple[str, Any]  # colour space; name of an illuminant, or wavelengths and power
_Request = tuple[str, str, list[tuple[str, float]]]

@final
class Database:
    def __new__(cls, path: str) -> Database: ...
    @property
    def wavelengths_nm(self) -> NDArray[np.float64]: ...
    @property
    def axes(self) -> list[tuple[str, NDArray[np.float64]]]: ...
    @property
    def components(self) -> list[tuple[str, int]]: ...
    @property
    def basis(self) -> str: ...
    @property
    def precision(self) -> str: ...
    @property
    def metadata(self) -> dict[str, str]: ...
    def spectra(
        self,
        request: _Request,
        points: list[NDArray[np.float64]],
        shape: tuple[int, ...],
        wavelengths_nm: Optional[list[float]],
        out: NDArray[np.float32],
    ) -> None: ...
    def colours(
        self,
        request: _Request,
        points: list[NDArray[np.float64]],
        shape: tuple[int, ...],
        viewing: _Viewing,
        out: NDArray[np.float64],
    ) -> None: ...
    def nodes(self, name: str, out: NDArray[np.float32]) -> None: ...

@final
class Directions:
    def __new__(cls, path: str, anisotropy_path: Optional[str], diffuse: bool) -> Directions: ...
    @property
    def wavelengths_nm(self) -> NDArray[np.float64]: ...
    @property
    def axes(self) -> list[tuple[str, NDArray[np.float64]]]: ...
    @property
    def quantities(self) -> list[str]: ...
    def spectra(
        self,
        request: tuple[str, list[tuple[str, float]]],
        points: list[NDArray[np.float64]],
        shape: tuple[int, ...],
        wavelengths_nm: Optional[list[float]],
        out: NDArray[np.float32],
    ) -> None: ...

def colours(
    spectra: NDArray[np.float64],
    wavelengths_nm: list[float],
    viewing: _Viewing,
    out: NDArray[np.float64],
) -> None: ...
def illuminant(path: str) -> tuple[list[float], list[float], str]: ...
def retrieve(
    database: Database,
    quantity_name: str,
    indices: list[int],
    bands: Optional[tuple[str, str]],
    spectra: NDArray[np.float64],
    sigma: Optional[NDArray[np.float64]],
    knowledge: tuple[list[str], list[str], list[tuple[str, NDArray[np.float64]]]],
    noise: tuple[float, float, float, float],
    grid: bool,
    jacobian: bool,
) -> tuple[
    tuple[list[str], int], list[tuple[str, NDArray[np.float64]]], list[bool]
]: ...
def profile(
    file: tuple[str, str, bool],
    depths_cm: list[float],
    engine: str,
    rays: Optional[int],
    seed: int,
) -> dict[str, Any]: ...
def simulate(
    file: tuple[str, str, bool],
    engine: str,
    rays: Optional[int],
    seed: int,
    max_error: Optional[tuple[Optional[float], Optional[float]]],
) -> dict[str, Any]: ...
