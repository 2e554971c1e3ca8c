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
    that are snow. The scene stays in memory until :func:`detach`. Raises
    ``ValueError`` if none is.
    """
    mi, dr = _modules()
    bodies = defaultdict(list)
    for shape, found in _snow(mi, scene):
        bodies[found.key].append((shape, found))
    for members in bodies.values():
        body = Body(mi, dr, scene, [shape for shape, _ in members])
        for _, found in members:
            found.body, found.detached = body, False
    if not bodies:
        raise ValueError("no shape of the scene is snow: none has an emitter with pcasnow")
    return sum(len(members) for members in bodies.values())


def detach(scene: Any) -> None:
    """Undoes :func:`attach`, so that the scene can be freed; its snow is dark."""
    mi, _ = _modules()
    for _, found in _snow(mi, scene):
        found.body, found.detached = None, True


def _snow(mi: Any, scene: Any) -> list[tuple[Any, Any]]:
    """Shapes and what is ``pcasnow`` in their emitters."""
    if mi.variant() not in _classes:
        raise RuntimeError("call splitsnow.mitsuba.register() after mitsuba.set_variant")
    kind = _classes[mi.variant()]
    found: list[tuple[Any, Any]] = []

    class Seek(mi.TraversalCallback):  # type: ignore[misc]
        def put(self, name: str, value: Any, *_: Any) -> None:
            if isinstance(value, kind):
                found.append((shape, value))

        put_value = put_object = put

    for shape in scene.shapes():
        if shape.is_emitter():
            shape.emitter().traverse(Seek())
    return found


def _modules() -> tuple[Any, Any]:
    try:
        return importlib.import_module("mitsuba"), importlib.import_module("drjit")
    except ImportError as error:
        raise ImportError("splitsnow.mitsuba needs Mitsuba 3: pip install mitsuba") from error
