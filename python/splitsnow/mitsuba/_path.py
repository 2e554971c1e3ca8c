"""The straight path through the snow towards the light."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

MOST_HITS = 256
"""A path with more surfaces carries no light."""

_STEP = 1e-5
"""Offset of the next ray beyond a surface, relative to 1 + the largest coordinate."""


class Path(NamedTuple):
    """The result of tracing a path."""

    thickness: Any
    """Length in snow, in scene units."""
    cosine: Any
    """Cosine of the angle with the normal where the path last left snow."""
    free: Any
    """Whether the path passed through snow and reached the light."""


class Body:
    """The shapes of one body of snow in a scene."""

    def __init__(self, mi: Any, dr: Any, scene: Any, shapes: list[Any]) -> None:
        self.mi, self.dr, self.scene = mi, dr, scene
        self.scalar = not dr.is_array_v(mi.Float)
        if self.scalar:
            self.own = {shape.ptr for shape in shapes}
            return
        # Dr.Jit identifies shapes by numbers in its registry.
        numbers = [self._number(mi.ShapePtr(shape))[0] for shape in shapes]
        own = np.zeros(max(numbers) + 1, bool)
        own[numbers] = True
        self.own, self.own_length = mi.Bool(own), dr.opaque(mi.UInt32, len(own))

    def path(self, si: Any, to_light: Any, shadows: bool, active: Any) -> Path:
        """Traces the path from a surface point, which may belong to any shape."""
        mi, dr = self.mi, self.dr

        def next_ray(si: Any) -> Any:
            # The offset is along the path, so that its length is unchanged. Hitting a
            # surface twice on leaving it is harmless: the length in between is negligible.
            offset = _STEP * (1 + dr.max(dr.abs(si.p)))
            ray = si.spawn_ray(to_light)
            ray.o = si.p + offset * to_light
            return ray

        def is_active(active: Any, *_: Any) -> Any:
            return active

        def step(
            active: Any, ray: Any, last: Any, inside: Any, thickness: Any,
            cosine: Any, free: Any, hits: Any,
        ) -> tuple[Any, ...]:  # fmt: skip
            hit = self.scene.ray_intersect(ray, mi.RayFlags.ShadingFrame, False, active)
            active = active & hit.is_valid()
            snow = active & self._is_own(hit.shape, active)
            leaving = snow & (dr.dot(hit.n, to_light) > 0)
            # The path before an exit surface was in snow, even if shapes touch and the
            # entry surface of the second was skipped by the offset.
            crossed = snow & (inside | leaving)
            # On large triangles, positions are less accurate than distances.
            length = hit.t + dr.dot(ray.o - last, to_light)
            thickness = thickness + dr.select(crossed, length, 0)
            last = dr.select(snow, hit.p, last)
            cosine = dr.select(leaving, dr.dot(hit.sh_frame.n, to_light), cosine)
            inside = dr.select(snow, snow ^ leaving, inside)
            if shadows:
                free = free & (snow | (active ^ True))
                active = snow
            hits = hits + 1
            free = free & ((hits < MOST_HITS) | (active ^ True))
            active = active & (hits < MOST_HITS)
            ray = dr.select(active, next_ray(hit), ray)
            return active, ray, last, inside, thickness, cosine, free, hits

        inside = dr.dot(si.n, to_light) < 0
        # A surface that faces the light must not be hit again: there is no snow between.
        start = dr.select(inside, next_ray(si), si.spawn_ray(to_light))
        state = (
            mi.Bool(active), start, mi.Point3f(si.p), inside,
            mi.Float(0), mi.Float(0), mi.Bool(active), mi.UInt32(0),
        )  # fmt: skip
        if self.scalar:
            while state[0]:
                state = step(*state)
        else:
            state = dr.while_loop(state, is_active, step)
        _, _, _, _, thickness, cosine, free, _ = state
        return Path(thickness, cosine, free & (thickness > 0) & (cosine > 0))

    def _is_own(self, shape: Any, active: Any) -> Any:
        if self.scalar:
            return bool(active) and shape is not None and shape.ptr in self.own
        number = self._number(shape)
        known = active & (number < self.own_length)
        return known & self.dr.gather(self.mi.Bool, self.own, number, known)

    def _number(self, shape: Any) -> Any:
        return self.dr.reinterpret_array(self.mi.UInt32, shape)
