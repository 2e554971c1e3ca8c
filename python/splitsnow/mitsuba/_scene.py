"""Registering the plugin and telling it its scene."""

from __future__ import annotations

import importlib
from collections import defaultdict
from typing import Any

from ._llvm import check_llvm
from ._path import Body
from ._texture import texture

_classes: dict[str, type] = {}
"""By variant."""


def register() -> None:
    """Adds the texture ``pcasnow`` to the variant of Mitsuba that is set.

    After ``mitsuba.set_variant``, again for each variant. Raises ``ImportError`` where
    Mitsuba is missing and ``RuntimeError`` where no variant is set, it is a
    polarised one, or its LLVM cannot be used (:func:`check_llvm`).
    """
    mi, dr = _modules()
    variant = mi.variant()
    if variant is None:
        raise RuntimeError('set a variant first: mitsuba.set_variant("llvm_ad_spectral")')
    if mi.is_polarized:
        raise RuntimeError(f"pcasnow has no polarisation, as {variant} asks for")
    if variant in _classes:
        return
    if variant.startswith("llvm"):
        check_llvm()
    _classes[variant] = texture(mi, dr)
    mi.register_texture("pcasnow", _classes[variant])


def attach(scene: Any) -> int:
    """Tells all ``pcasnow`` of a loaded scene what surrounds them; the number of shapes
    that are snow. Again after a shape was added. Raises ``ValueError`` if it is none.
    """
    mi, dr = _modules()
    kind = _classes.get(mi.variant())
    if kind is None:
        raise RuntimeError("call splitsnow.mitsuba.register() after mitsuba.set_variant")
    bodies = defaultdict(list)
    for shape in scene.shapes():
        if shape.is_emitter():
            for found in _textures(mi, shape.emitter(), kind):
                bodies[found.key].append((shape, found))
    for members in bodies.values():
        body = Body(mi, dr, scene, [shape for shape, _ in members])
        for _, found in members:
            found.body = body
    if not bodies:
        raise ValueError("no shape of the scene is snow: none has an emitter with pcasnow")
    return sum(len(members) for members in bodies.values())


def _textures(mi: Any, emitter: Any, kind: type) -> list[Any]:
    found = []

    class Seek(mi.TraversalCallback):  # type: ignore[misc]
        def put(self, name: str, value: Any, *_: Any) -> None:
            if isinstance(value, kind):
                found.append(value)

        put_value = put_object = put

    emitter.traverse(Seek())
    return found


def _modules() -> tuple[Any, Any]:
    try:
        return importlib.import_module("mitsuba"), importlib.import_module("drjit")
    except ImportError as error:
        raise ImportError("splitsnow.mitsuba needs Mitsuba 3: pip install mitsuba") from error
