"""Four backlit blocks of snow, 5, 10, 15 and 30 cm thick, in Mitsuba 3.

    python examples/mitsuba/blocks.py --size 800 --spp 256 --out out/blocks

writes out/blocks.png and out/blocks.exr. A distant lamp is behind the blocks at their
height; the ground in front is lit only by light from the snow.
`splitsnow tailor configs/scenes/blocks.toml` makes snow.safetensors.
"""

import mitsuba as mi
import stage

import splitsnow.mitsuba

FILE = stage.HERE / "snow.safetensors"
THICKNESSES_CM = (5, 10, 15, 30)
TO_LAMP = (0.0, 1.0, 0.0)
WIDTH, HEIGHT, BOARD = 0.3, 0.35, 0.02
"""In metres, like all lengths in the scene. BOARD is the width of the black boards between
the blocks."""


def scene(size, spp):
    """Blocks along x with their fronts at y = 0; z is up."""
    lamp = {"type": "d65"}
    snow = splitsnow.mitsuba.snow(FILE, to_light=TO_LAMP, irradiance=lamp)
    shapes = {}
    step = WIDTH + BOARD
    for i, thickness_cm in enumerate(THICKNESSES_CM):
        depth = thickness_cm / 100
        middle = [(i - 1.5) * step, depth / 2, HEIGHT / 2]
        shapes[f"block_{i}"] = stage.box(middle, [WIDTH, depth, HEIGHT], **snow)
    for i in range(len(THICKNESSES_CM) + 1):
        middle = [(i - 2) * step, 0.15, HEIGHT / 2]
        shapes[f"board_{i}"] = stage.box(middle, [BOARD, 0.36, HEIGHT], bsdf=stage.grey(0.0))
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "sensor": stage.camera([0, -2.4, 0.5], [0, 0, 0.08], 34, size, size // 2, spp),
        "lamp": {"type": "directional", "direction": [-x for x in TO_LAMP], "irradiance": lamp},
        "ground": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, -2, 0]).scale(2),
            "bsdf": stage.grey(0.3),
        },
        **shapes,
    }


PICTURE = ("blocks", __doc__, scene, 800, 256)

if __name__ == "__main__":
    stage.main(*PICTURE)
