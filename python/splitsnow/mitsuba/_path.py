"""The straight way through the snow towards the light."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

MOST_HITS = 256
"""A way of more surfaces gives no light."""

_STEP = 1e-5
"""Beyond a surface, the next ray begins so far on, of one unit and the coordinates."""


class Path(NamedTuple):
    """Where a way led."""

    thickness: Any
    """Length in snow, in units of the scene."""
    cosine: Any
    """Of the angle with the normal where it left snow last."""
    free: Any
    """Whether it went through snow and reached the light."""


class Body:
    """The shapes that are one snow, in a scene."""

    def __init__(self, mi: Any, dr: Any, scene: Any, shapes: list[Any]) -> None:
        self.mi, self.dr, self.scene = mi, dr, scene
        self.scalar = not dr.is_array_v(mi.Float)
        if self.scalar:
            self.own = {shape.ptr for shape in shapes}
            return
        # Shapes are numbers in the registry of Dr.Jit.
        numbers = [self._number(mi.ShapePtr(shape))[0] for shape in shapes]
        own = np.zeros(max(numbers) + 1, bool)
        own[numbers] = True
        self.own, self.beyond = mi.Bool(own), dr.opaque(mi.UInt32, len(own))

    def path(self, si: Any, to_light: Any, shadows: bool, active: Any) -> Path:
        """From a point on a surface, whether of this body or not."""
        mi, dr = self.mi, self.dr

        def onwards(si: Any) -> Any:
            # Along the way, so that its length is kept. To hit a surface once more on
            # the way out of it does no harm, as there is next to nothing between.
            ahead = _STEP * (1 + dr.max(dr.abs(si.p)))
            ray = si.spawn_ray(to_light)
            ray.o = si.p + ahead * to_light
            return ray

        def going(active: Any, *_: Any) -> Any:
            return active

        def step(
            active: Any, ray: Any, last: Any, inside: Any, thickness: Any,
            cosine: Any, free: Any, hits: Any,
        ) -> tuple[Any, ...]:  # fmt: skip
            hit = self.scene.ray_intersect(ray, mi.RayFlags.ShadingFrame, False, active)
            active = active & hit.is_valid()
            snow = active & self._is_own(hit.shape, active)
            leaving = snow & (dr.dot(hit.n, to_light) > 0)
            # Behind a surface that leaves snow there was snow, even where shapes touch
            # and the surface into the second was stepped over.
            crossed = snow & (inside | leaving)
            # Of large triangles places are less exact than distances.
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
            ray = dr.select(active, onwards(hit), ray)
            return active, ray, last, inside, thickness, cosine, free, hits

        inside = dr.dot(si.n, to_light) < 0
        # A surface that faces the light must not be hit once more: there was no snow.
        start = dr.select(inside, onwards(si), si.spawn_ray(to_light))
        state = (
            mi.Bool(active), start, mi.Point3f(si.p), inside,
            mi.Float(0), mi.Float(0), mi.Bool(active), mi.UInt32(0),
        )  # fmt: skip
        if self.scalar:
            while state[0]:
                state = step(*state)
        else:
            state = dr.while_loop(state, going, step)
        _, _, _, _, thickness, cosine, free, _ = state
        return Path(thickness, cosine, free & (thickness > 0) & (cosine > 0))

    def _is_own(self, shape: Any, active: Any) -> Any:
        if self.scalar:
            return bool(active) and shape is not None and shape.ptr in self.own
        number = self._number(shape)
        known = active & (number < self.beyond)
        return known & self.dr.gather(self.mi.Bool, self.own, number, known)

    def _number(self, shape: Any) -> Any:
        return self.dr.reinterpret_array(self.mi.UInt32, shape)
