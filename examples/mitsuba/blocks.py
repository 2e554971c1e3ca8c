"""Four backlit blocks of snow, 5, 10, 15 and 30 cm thick, in Mitsuba 3.

    python examples/mitsuba/blocks.py --size 800 --spp 256 --out out/blocks

writes out/blocks.png and out/blocks.exr. A distant lamp stands behind the blocks, level
with them; the ground in front is lit by the snow alone.
snow.safetensors is made by `splitsnow fit configs/scenes/blocks.toml`.
"""

import argparse
from pathlib import Path

import mitsuba as mi
import numpy as np

import splitsnow.mitsuba

FILE = Path(__file__).parent / "snow.safetensors"
THICKNESSES_CM = (5, 10, 15, 30)
TO_LAMP = (0.0, 1.0, 0.0)
WIDTH, HEIGHT, BOARD = 0.3, 0.35, 0.02
"""Metres, as all lengths of the scene."""


def box(middle, size, **entries):
    half = [length / 2 for length in size]
    place = mi.ScalarTransform4f().translate(middle).scale(half)
    return {"type": "cube", "to_world": place, **entries}


def grey(reflectance):
    return {"type": "diffuse", "reflectance": {"type": "spectrum", "value": reflectance}}


def scene(size, spp):
    """Blocks along x with their fronts at y = 0; z is up."""
    lamp = {"type": "d65"}
    snow = splitsnow.mitsuba.snow(FILE, to_light=TO_LAMP, irradiance=lamp)
    shapes = {}
    step = WIDTH + BOARD
    for i, thickness_cm in enumerate(THICKNESSES_CM):
        depth = thickness_cm / 100
        middle = [(i - 1.5) * step, depth / 2, HEIGHT / 2]
        shapes[f"block_{i}"] = box(middle, [WIDTH, depth, HEIGHT], **snow)
    for i in range(len(THICKNESSES_CM) + 1):
        middle = [(i - 2) * step, 0.15, HEIGHT / 2]
        shapes[f"board_{i}"] = box(middle, [BOARD, 0.36, HEIGHT], bsdf=grey(0.0))
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "sensor": {
            "type": "perspective",
            "fov": 34,
            "to_world": mi.ScalarTransform4f().look_at([0, -2.4, 0.5], [0, 0, 0.08], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": size, "height": size // 2},
            "sampler": {"type": "independent", "sample_count": spp},
        },
        "lamp": {"type": "directional", "direction": [-x for x in TO_LAMP], "irradiance": lamp},
        "ground": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, -2, 0]).scale(2),
            "bsdf": grey(0.3),
        },
        **shapes,
    }


def render(variant, size, spp):
    """Linear sRGB, ``(size / 2, size, 3)``; the lamp's irradiance is 1."""
    mi.set_variant(variant)
    splitsnow.mitsuba.register()
    loaded = mi.load_dict(scene(size, spp))
    splitsnow.mitsuba.attach(loaded)
    image = np.array(mi.render(loaded))
    splitsnow.mitsuba.detach(loaded)
    return image


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=800, help="width in pixels")
    parser.add_argument("--spp", type=int, default=256, help="samples per pixel")
    parser.add_argument("--variant", default="llvm_ad_spectral", help="of Mitsuba")
    parser.add_argument("--out", type=Path, default=Path("out/blocks"), help="without suffix")
    options = parser.parse_args()
    image = render(options.variant, options.size, options.spp)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    mi.Bitmap(image).write(str(options.out.with_suffix(".exr")))
    # Exposed for the thinnest block, the brightest thing that is seen.
    exposed = 0.8 * image / np.percentile(image, 97)
    mi.util.write_bitmap(str(options.out.with_suffix(".png")), exposed)


if __name__ == "__main__":
    main()
