"""What makes a shape snow."""

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

    ``filename`` is a compact file, or a directory with one; facetness, grain size and
    density say where in it the snow is, and may be left out where it has one value
    alone; ``conditions``, such as ``black_carbon_ng_g=50``, do so on further axes.

    ``to_light`` is the direction to a distant light, ``irradiance`` that of a plane
    across its beam, as Mitsuba's emitters have it: a number (D65), or any spectrum. Set
    a ``directional`` emitter beside it: this is what passes through snow alone. With
    ``light="sky"`` a uniform sky gives ``irradiance`` to a plane that sees all of a
    hemisphere of it; ``up``, if given, leaves of the sky what is above the horizon.
    Outside the database's angles there is no light.

    ``metres_per_unit`` is the length of the scene's unit. ``shadows=False`` ignores what
    stands between snow and light. ``transmitted`` and ``reflected`` are what the snow
    does; ``reflectance`` is used instead of the database's, which is that of
    its thickest slab at ``reflectance_angle_deg``, the same in all directions.
    """
    material = Material.of(
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
            f"{database.path} has no reflectance: say reflectance=0.9, or reflected=False, or make "
            'it with quantities = ["transmittance", "reflectance"]'
        )
    angles = database.axes["angle_deg"]
    low, high = VISIBLE_NM
    nm = np.unique([low, *material.wavelengths_nm(), high])
    found = database.reflectance(
        *material.snow,
        database.axes["thickness_cm"][-1],
        np.clip(angle_deg, angles[0], angles[-1]),
        wavelengths_nm=nm,
        conditions=material.conditions,
    )
    pairs = [(float(at), float(value)) for at, value in zip(nm, found)]
    return {"type": "spectrum", "value": pairs}
