"""A backlit body with twisted fins, made of seven different snows, in Mitsuba 3.

    python examples/mitsuba/sculpture.py --size 1400 --spp 64 --out out/sculpture

writes out/sculpture.png and out/sculpture.exr. From left to right: the base snow, smaller
grains, larger grains, lower density, higher density, small grains at low density, and
large grains at high density. The lamp is behind the bodies at their height; its light
crosses 0 to 77 cm of snow.
`splitsnow tailor configs/scenes/snows.toml` makes snows.safetensors.
"""

import numpy as np
import stage

import splitsnow.mitsuba

FILE = stage.HERE / "snows.safetensors"
SNOWS = [
    {"facetness": 0.3, "grain_size_um": size, "density_kg_m3": density}
    for size, density in (
        (250, 300), (100, 300), (500, 300), (250, 200), (250, 400), (100, 200), (500, 400),
    )
]  # fmt: skip
TO_LAMP = (0.0, 1.0, 0.0)
HEIGHT, RADIUS, STEP = 2.2, 0.74, 1.56
"""In metres, like all lengths in the scene. STEP is the distance between the bodies."""


def body(rings=160, sides=240):
    """Vertices and faces of a closed body on z = 0 with three fins that turn with height."""
    up = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, rings + 2)[1:-1])[:, None]
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    # The profile is round at the bottom, with a waist and a pointed top.
    profile = RADIUS * up**0.35 * (1 - up) ** 0.6 * (1.15 + 0.35 * np.cos(9 * up + 0.4))
    fins = 0.22 + 0.78 * np.cos(1.5 * (around - 2.2 * up)) ** 4
    radius = profile * fins
    z = np.broadcast_to(HEIGHT * up, radius.shape)
    side = np.stack([radius * np.cos(around), radius * np.sin(around), z], -1).reshape(-1, 3)
    vertices = np.concatenate([side, [[0, 0, 0], [0, 0, HEIGHT]]])
    i = np.arange((rings - 1) * sides)
    right = i - i % sides + (i + 1) % sides
    walls = [(i, right, right + sides), (i, right + sides, i + sides)]
    k, low, high = np.arange(sides), rings * sides, rings * sides + 1
    after, top = (k + 1) % sides, (rings - 1) * sides
    ends = [(np.full(sides, low), after, k), (np.full(sides, high), top + k, top + after)]
    faces = np.concatenate([np.stack(corners, -1) for corners in walls + ends])
    return vertices, faces


def scene(size, spp):
    """Bodies along x; z is up. The picture shows transmitted light only: no lit side is
    visible, and light between the bodies is neglected."""
    vertices, faces = body()
    bodies = {}
    for i, parameters in enumerate(SNOWS):
        snow = splitsnow.mitsuba.snow(
            FILE, **parameters, to_light=TO_LAMP, irradiance={"type": "d65"}, reflected=False
        )
        moved = vertices + [(i - 3) * STEP, 0, 0]
        bodies[f"body_{i}"] = stage.mesh(moved, faces, True, **snow)
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 1},
        "sensor": stage.camera([0, -26, 2.9], [0, 0, 1.06], 24, size, size // 4, spp),
        **bodies,
    }


PICTURE = ("sculpture", __doc__, scene, 1400, 64)

if __name__ == "__main__":
    stage.main(*PICTURE)
