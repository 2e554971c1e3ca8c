"""Registration of the plugin, and attaching it to a scene."""

from __future__ import annotations

import importlib
from collections import defaultdict
from typing import Any

from ._llvm import check_llvm
from ._path import Body
from ._texture import texture

_classes: dict[str, type] = {}
"""Texture class by variant."""


def register() -> None:
    """Adds the texture ``pcasnow`` to the current variant of Mitsuba.

    Call it after ``mitsuba.set_variant``, once for each variant. Raises ``ImportError``
    if Mitsuba is not installed, and ``RuntimeError`` if no variant is set, the variant
    is polarised, or its LLVM cannot be used (:func:`check_llvm`).
    """
    mi, dr = _modules()
    variant = mi.variant()
    if variant is None:
        raise RuntimeError('set a variant first: mitsuba.set_variant("llvm_ad_spectral")')
    if mi.is_polarized:
        raise RuntimeError(
            f"pcasnow does not support polarisation; set a variant other than {variant}"
        )
    if variant in _classes:
        return
    if variant.startswith("llvm"):
        check_llvm()
    _classes[variant] = texture(mi, dr)
    mi.register_texture("pcasnow", _classes[variant])


def attach(scene: Any) -> int:
    """Connects every ``pcasnow`` of a loaded scene to the scene, and returns the number
    of shapes of snow. The scene stays in memory until :func:`detach`. Raises
    ``ValueError`` if no shape is snow.
    """
    mi, dr = _modules()
    bodies = defaultdict(list)
    for shape, snow in _snow(mi, scene):
        bodies[snow.key].append((shape, snow))
    for members in bodies.values():
        body = Body(mi, dr, scene, [shape for shape, _ in members])
        for _, snow in members:
            snow.body, snow.detached = body, False
    if not bodies:
        raise ValueError("no shape of the scene is snow: no shape has an emitter with pcasnow")
    return sum(len(members) for members in bodies.values())


def detach(scene: Any) -> None:
    """Reverses :func:`attach`, so that the scene can be freed. Its snow becomes dark."""
    mi, _ = _modules()
    for _, snow in _snow(mi, scene):
        snow.body, snow.detached = None, True


def _snow(mi: Any, scene: Any) -> list[tuple[Any, Any]]:
    """Shapes of snow, each with the ``pcasnow`` of its emitter."""
    if mi.variant() not in _classes:
        raise RuntimeError("call splitsnow.mitsuba.register() after mitsuba.set_variant")
    kind = _classes[mi.variant()]
    pairs: list[tuple[Any, Any]] = []

    class FindSnow(mi.TraversalCallback):  # type: ignore[misc]
        def put(self, name: str, value: Any, *_: Any) -> None:
            if isinstance(value, kind):
                pairs.append((shape, value))

        put_value = put_object = put

    for shape in scene.shapes():
        if shape.is_emitter():
            shape.emitter().traverse(FindSnow())
    return pairs


def _modules() -> tuple[Any, Any]:
    try:
        return importlib.import_module("mitsuba"), importlib.import_module("drjit")
    except ImportError as error:
        raise ImportError("splitsnow.mitsuba needs Mitsuba 3: pip install mitsuba") from error
