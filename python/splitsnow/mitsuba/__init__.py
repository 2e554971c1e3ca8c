"""Snow that lets light through, in Mitsuba 3 (the method PCASnow, Varsa 2025).

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
the shapes that are snow. Where a surface is seen, a straight ray goes on through the
snow towards the light: ``d`` is the length in snow, all pieces added up, ``theta`` the
angle between the ray and the normal where it leaves the snow. The radiance there is
``E cos(theta) T(d, theta) / pi`` with the light's irradiance ``E`` on a plane across
the beam and the database's transmittance ``T``. Under ``light="sky"`` each evaluation
takes one direction, uniform over the inner hemisphere, of a uniform sky.

Neglected are: every way of light but the straight one, as which the snow is as thick as
the ray is long; light that spreads sideways; directions in which light leaves (all
alike, Lambertian); refraction at the surface; light that leaves snow and enters it again.

Shapes must be closed with their normals outwards; snow of one material (file and
place in it) is one body, other shapes are opaque.
"""

from __future__ import annotations

from ._llvm import check_llvm
from ._scene import attach, detach, register
from ._snow import snow

__all__ = ["attach", "check_llvm", "detach", "register", "snow"]
