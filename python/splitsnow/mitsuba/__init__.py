"""Translucent snow in Mitsuba 3 (the method PCASnow, Varsa 2025).

::

    import mitsuba as mi
    import splitsnow.mitsuba

    mi.set_variant("llvm_ad_spectral")
    splitsnow.mitsuba.register()
    block = splitsnow.mitsuba.snow("snow.safetensors", to_light=[0, 0, 1])
    scene = mi.load_dict({"type": "scene", "block": {"type": "cube", **block}, ...})
    splitsnow.mitsuba.attach(scene)
    image = mi.render(scene)

:func:`register` adds the texture ``pcasnow``, the radiance of an ``area`` emitter on
shapes of snow. From a visible surface point, a straight ray continues through the snow
towards the light. ``d`` is its total length in snow, and ``theta`` is the angle between
the ray and the normal where it leaves the snow. The radiance is
``E cos(theta) T(d, theta) / pi``, with the irradiance ``E`` of the light on a plane
perpendicular to the beam and the transmittance ``T`` of the database. With
``light="sky"``, each evaluation samples one direction of a uniform sky, in the inner
hemisphere.

Neglected are: all light paths but the straight one, whose length is taken as the
thickness of the snow; lateral spreading of light; the angular distribution of the light
that leaves the snow (taken as Lambertian); refraction at the surface; light that leaves
the snow and enters it again.

Shapes must be closed, with outward normals. All shapes of one material (same file and
same snow) form one body; other shapes are opaque.
"""

from __future__ import annotations

from ._llvm import check_llvm
from ._scene import attach, detach, register
from ._snow import snow

__all__ = ["attach", "check_llvm", "detach", "register", "snow"]
