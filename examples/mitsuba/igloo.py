"""Inside an igloo under a uniform sky of CIE D55, in Mitsuba 3.

    python examples/mitsuba/igloo.py --size 600 --spp 128 --out out/igloo

writes out/igloo.png and out/igloo.exr. The blocks are 15 cm thick. The seams between them
are 4 cm thick and let more light through. All blocks are one mesh, because every shape of
snow adds compilation time.
`splitsnow tailor configs/scenes/dome.toml` makes dome.safetensors.
"""

import mitsuba as mi
import numpy as np
import stage

import splitsnow.mitsuba

FILE = stage.HERE / "dome.safetensors"
RADIUS, THICKNESS, SEAM = 1.5, 0.15, 0.04
ROWS, BLOCK = 7, 0.5
"""Number of rows of blocks below the key block, and approximate length of a block."""
SEAM_WIDTH = 0.03
"""In metres, like all lengths in the scene."""


def seams(elevation, azimuth):
    """Depth of the groove, relative to that in the middle of a seam: 1 there, 0 inside
    blocks."""
    position = elevation / (np.pi / 2) * (ROWS + 0.5)
    row = np.minimum(np.floor(position), ROWS)
    row_height = RADIUS * np.pi / 2 / (ROWS + 0.5)
    to_row = np.abs(position - np.clip(np.round(position), 1, ROWS)) * row_height
    girth = 2 * np.pi * RADIUS * np.cos((row + 0.5) / (ROWS + 0.5) * np.pi / 2)
    blocks = np.maximum(np.round(girth / BLOCK), 3)
    turn = azimuth / (2 * np.pi) * blocks + 0.5 * (row % 2)
    to_side = np.abs(turn - np.round(turn)) / blocks * 2 * np.pi * RADIUS * np.cos(elevation)
    distance = np.where(row < ROWS, np.minimum(to_row, to_side), to_row)
    return np.exp(-((distance / SEAM_WIDTH) ** 2))


def dome(rings=240, sides=900):
    """Vertices and faces of a shell with grooves; inside and outside join at the foot."""
    elevation = np.linspace(0, np.pi / 2, rings + 1)[:-1, None]
    azimuth = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    unit = np.stack(
        np.broadcast_arrays(
            np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ), -1,
    )  # fmt: skip
    groove = (THICKNESS - SEAM) * seams(elevation, azimuth)[..., None]
    inner = unit * (RADIUS + 0.2 * groove)
    outer = unit * (RADIUS + THICKNESS - 0.8 * groove)
    # Rows of vertices run from the top down the inside and up the outside.
    rows = np.concatenate([inner[::-1], outer]).reshape(-1, 3)
    vertices = np.concatenate([rows, [[0, 0, RADIUS], [0, 0, RADIUS + THICKNESS]]])
    i = np.arange((2 * rings - 1) * sides)
    right = i - i % sides + (i + 1) % sides
    walls = [(i, right, right + sides), (i, right + sides, i + sides)]
    k, low, high = np.arange(sides), len(rows), len(rows) + 1
    after, last = (k + 1) % sides, (2 * rings - 1) * sides
    ends = [(np.full(sides, low), after, k), (np.full(sides, high), last + k, last + after)]
    return vertices, np.concatenate([np.stack(corners, -1) for corners in walls + ends])


def scene(size, spp):
    """The dome stands on z = 0; z is up. The picture shows the light through the wall, plus
    one reflection. The reflection samples the BSDF only, because there is snow in all
    directions."""
    snow = splitsnow.mitsuba.snow(FILE, light="sky", up=[0, 0, 1], irradiance=stage.d55())
    floor = mi.ScalarTransform4f().translate([0, 0, 0.01]).scale(RADIUS)
    return {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1},
        "sensor": stage.camera([0, -1.2, 0.75], [0, 0.5, 0.95], 85, size, size * 3 // 4, spp),
        "dome": stage.mesh(*dome(), True, **snow),
        "floor": {"type": "disk", "to_world": floor, "bsdf": snow["bsdf"]},
    }


PICTURE = ("igloo", __doc__, scene, 600, 128, 99)

if __name__ == "__main__":
    stage.main(*PICTURE)
