"""Scene entries for shapes of snow."""

from __future__ import annotations

import os
from typing import Any, Optional, Sequence, Union

import numpy as np

from ._table import VISIBLE_NM, Material


def snow(
    filename: Union[str, os.PathLike[str]],
    *,
    facetness: Optional[float] = None,
    grain_size_um: Optional[float] = None,
    density_kg_m3: Optional[float] = None,
    to_light: Optional[Sequence[float]] = None,
    irradiance: Any = 1.0,
    light: str = "directional",
    up: Optional[Sequence[float]] = None,
    metres_per_unit: float = 1.0,
    shadows: bool = True,
    transmitted: bool = True,
    reflected: bool = True,
    reflectance: Any = None,
    reflectance_angle_deg: float = 45.0,
    **conditions: float,
) -> dict[str, Any]:
    """Entries that make a shape snow: ``{"type": "cube", **snow(...)}``.

    ``filename`` is a compact file, or a directory with one. Facetness, grain size and
    density select the snow, and may be omitted if the database has a single value.
    ``conditions``, such as ``black_carbon_ng_g=50``, set the values on optional axes.

    ``to_light`` is the direction to a distant light. ``irradiance`` is its irradiance on
    a plane perpendicular to the beam, as for emitters of Mitsuba: a number (D65), or any
    spectrum. It gives only the light transmitted by snow; add a ``directional`` emitter
    for other light. With ``light="sky"`` a uniform sky has ``irradiance`` on a plane
    under a full hemisphere; ``up``, if given, restricts the sky to directions above the
    horizon. At angles outside the database the transmitted light is 0.

    ``metres_per_unit`` is the length of the scene unit. ``shadows=False`` ignores
    objects between snow and light. ``transmitted`` and ``reflected`` switch the two
    kinds of light on and off. ``reflectance`` replaces the reflectance of the database,
    which is that of its thickest slab at ``reflectance_angle_deg``, taken as the same in
    all directions.
    """
    material = Material.from_file(
        os.fspath(filename), facetness, grain_size_um, density_kg_m3, conditions
    )
    if not reflected:
        reflectance = 0.0
    elif reflectance is None:
        reflectance = _reflectance(material, reflectance_angle_deg)
    if isinstance(reflectance, (int, float)):
        reflectance = {"type": "spectrum", "value": float(reflectance)}
    entries: dict[str, Any] = {"bsdf": {"type": "diffuse", "reflectance": reflectance}}
    if transmitted:
        radiance: dict[str, Any] = {
            "type": "pcasnow",
            "filename": material.database.path,
            "facetness": material.snow[0],
            "grain_size_um": material.snow[1],
            "density_kg_m3": material.snow[2],
            "irradiance": irradiance,
            "light": light,
            "metres_per_unit": float(metres_per_unit),
            "shadows": bool(shadows),
            **{name: float(value) for name, value in conditions.items()},
        }
        for name, vector in (("to_light", to_light), ("up", up)):
            if vector is not None:
                radiance[name] = [float(number) for number in vector]
        entries["emitter"] = {"type": "area", "radiance": radiance}
    return entries


def _reflectance(material: Material, angle_deg: float) -> dict[str, Any]:
    database = material.database
    if "reflectance" not in database.quantities:
        raise ValueError(
            f"{database.path} has no reflectance: set reflectance=0.9 or reflected=False, or "
            'tailor it with quantities = ["transmittance", "reflectance"]'
        )
    angles = database.axes["angle_deg"]
    low, high = VISIBLE_NM
    nm = np.unique([low, *material.wavelengths_nm(), high])
    spectrum = database.reflectance(
        *material.snow,
        database.axes["thickness_cm"][-1],
        np.clip(angle_deg, angles[0], angles[-1]),
        wavelengths_nm=nm,
        conditions=material.conditions,
    )
    pairs = [(float(wavelength), float(value)) for wavelength, value in zip(nm, spectrum)]
    return {"type": "spectrum", "value": pairs}
