"""The texture `pcasnow`, the radiance of an area emitter."""

from __future__ import annotations

import math
import struct
from typing import Any, Optional

import numpy as np

from ._look_up import LookUp
from ._path import Body
from ._table import Material, Table

LIGHTS = ("directional", "sky")
EVEN = 0.25
"""Part of the directions toward a sky that are uniform over the hemisphere."""


def texture(mi: Any, dr: Any) -> type:
    """The texture class for the current variant of Mitsuba."""

    class PcaSnow(mi.Texture):  # type: ignore[misc]
        """Light transmitted by snow; see :func:`splitsnow.mitsuba.snow`."""

        def __init__(self, props: Any) -> None:
            mi.Texture.__init__(self, props)
            facetness, grain_size_um, density_kg_m3 = (
                float(props[name]) if name in props else None
                for name in ("facetness", "grain_size_um", "density_kg_m3")
            )
            if "filename" not in props:
                raise ValueError("pcasnow: filename is needed, the path of a compact file")
            filename = mi.file_resolver().resolve(props["filename"])
            metres_per_unit = float(props.get("metres_per_unit", 1.0))
            if not (math.isfinite(metres_per_unit) and metres_per_unit > 0):
                raise ValueError("pcasnow: metres_per_unit must be above 0")
            self.shadows = bool(props.get("shadows", True))
            self.kind = props.get("light", "directional")
            if self.kind not in LIGHTS:
                raise ValueError(f"pcasnow: light must be directional or sky, not {self.kind}")
            self.to_light = self._direction(props, "to_light", self.kind == "directional")
            self.up = self._direction(props, "up", False)
            curve = self._curve(props)
            self.irradiance = None
            if curve is None or mi.is_spectral:
                self.irradiance = props.get_emissive_texture("irradiance", 1.0)
            # All other properties are values on optional axes.
            conditions = {name: props[name] for name in props.unqueried()}
            for name, value in conditions.items():
                if not isinstance(value, (int, float)):
                    raise ValueError(f"pcasnow: {name} must be a number, not {value!r}")
            material = Material.from_file(
                str(filename), facetness, grain_size_um, density_kg_m3, conditions
            )
            self.key = material.key
            if mi.is_spectral:
                self.look_up = LookUp(mi, dr, Table.spectral(material))
            else:
                self.look_up = LookUp(mi, dr, Table.colour(material, curve))
            self.cm_per_unit = self.look_up.number(100 * metres_per_unit)
            self.body: Optional[Body] = None
            self.detached = False

        def eval(self, si: Any, active: Any = True) -> Any:
            if self.detached:  # LLVM variants compile all textures in memory
                return mi.UnpolarizedSpectrum(0)
            if self.body is None:
                raise RuntimeError(
                    "a pcasnow in memory is not attached to its scene: call "
                    "splitsnow.mitsuba.attach(scene) for each scene after loading it"
                )
            if self.kind == "sky":
                direction, weight = self._towards_sky(si)
            else:
                direction, weight = self.to_light, 1 / math.pi
            with dr.suspend_grad():
                path = self.body.path(si, direction, self.shadows, active)
                lit = path.free & self._covered(path.cosine)
                cm = path.thickness * self.cm_per_unit
                if mi.is_spectral:
                    radiance = self.look_up.spectrum(cm, path.cosine, si.wavelengths, lit)
                else:
                    radiance = self.look_up.colour(cm, path.cosine, lit)
                radiance = dr.select(lit, radiance * (path.cosine * weight), 0)
            if self.irradiance is not None:
                radiance = radiance * self.irradiance.eval(si, active)
            return radiance

        def eval_1(self, si: Any, active: Any = True) -> Any:
            """The mean over the wavelengths, or colours, of :meth:`eval`."""
            return dr.mean(self.eval(si, active))

        def eval_3(self, si: Any, active: Any = True) -> Any:
            if mi.is_spectral:
                raise RuntimeError("pcasnow gives no colours in spectral variants; evaluate spectra")
            return mi.Color3f(self.eval(si, active))

        def sample_spectrum(self, si: Any, sample: Any, active: Any = True) -> Any:
            if not mi.is_spectral:
                return sample, self.eval(si, active)
            wavelengths, weight = mi.sample_rgb_spectrum(sample)
            si.wavelengths = wavelengths
            return wavelengths, self.eval(si, active) * weight

        def is_spatially_varying(self) -> bool:
            """False, so that emitters sample their surface uniformly instead of by UV
            coordinates, which are not unique on many shapes."""
            return False

        def mean(self) -> Any:
            """Mean radiance of snow of thickness 0 at normal incidence."""
            return (1.0 if self.irradiance is None else self.irradiance.mean()) / math.pi

        def max(self) -> Any:
            return (1.0 if self.irradiance is None else self.irradiance.max()) / math.pi

        def traverse(self, callback: Any) -> None:
            if self.irradiance is not None:
                callback.put("irradiance", self.irradiance, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            path, snow, conditions = self.key
            return (
                f"PcaSnow[filename={path}, snow={snow}, conditions={conditions}, "
                f"light={self.kind}, attached={self.body is not None}]"
            )

        __repr__ = to_string

        def _covered(self, cosine: Any) -> Any:
            """Whether the database covers the angle, with a margin for rounding."""
            look_up = self.look_up
            return (cosine > look_up.min_cosine - 1e-6) & (cosine < look_up.max_cosine + 1e-6)

        def _towards_sky(self, si: Any) -> tuple[Any, Any]:
            """A direction into the inner hemisphere, and the weight that gives the mean over a
            uniform sky. Its density is :data:`EVEN` of a uniform one, which bounds the weight,
            and for the rest proportional to the squared cosine to the normal, as most of the
            light is. The direction is derived from the position, because textures have no
            random numbers."""
            first, second = mi.sample_tea_32(_bits(si.p.x), _bits(si.p.y))
            first, second = mi.sample_tea_32(first ^ _bits(si.p.z), second)
            u, v = mi.Float(first) * 2.0**-32, mi.Float(second) * 2.0**-32
            even = v < EVEN
            cosine = dr.select(even, v / EVEN, dr.cbrt((v - EVEN) / (1 - EVEN)))
            sine = dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
            sin, cos = dr.sincos(2 * math.pi * u)
            direction = mi.Frame3f(-si.n).to_world(mi.Vector3f(sine * cos, sine * sin, cosine))
            weight = 2 / math.pi / (EVEN + 3 * (1 - EVEN) * cosine * cosine)
            if self.up is not None:
                weight = dr.select(dr.dot(direction, self.up) > 0, weight, 0)
            return direction, weight

        def _direction(self, props: Any, name: str, needed: bool) -> Any:
            if name not in props:
                if needed:
                    raise ValueError(f"pcasnow: {name} is needed, the direction to the light")
                return None
            vector = np.array(props[name], float).ravel()
            length = float(np.linalg.norm(vector))
            if vector.size != 3 or not (math.isfinite(length) and length > 0):
                raise ValueError(f"pcasnow: {name} must be a non-zero vector of three numbers")
            unit = mi.Vector3f(*(vector / length).tolist())
            dr.make_opaque(unit)  # see LookUp.number
            return unit

        def _curve(self, props: Any) -> Any:
            """The light if it is given as a tabulated spectrum, ``(n, 2)``; else ``None``."""
            if "irradiance" not in props or props.type("irradiance") != mi.Properties.Type.Spectrum:
                return None
            given = props["irradiance"]
            values = np.array(given.values, float)
            if given.is_uniform():
                return np.array([[0.0, values[0]], [1e5, values[0]]])
            return np.stack([np.array(given.wavelengths, float), values], -1)

    def _bits(number: Any) -> Any:
        if isinstance(number, float):
            return struct.unpack("<I", struct.pack("<f", number))[0]
        return dr.reinterpret_array(mi.UInt32, number)

    return PcaSnow
