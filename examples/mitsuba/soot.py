"""Blocks of snow with 0, 20, 100 and 400 ng/g of black carbon, lit from both sides, in
Mitsuba 3.

    python examples/mitsuba/soot.py --size 640 --spp 512 --out out/soot

writes out/soot.png and out/soot.exr. The blocks are 10 cm thick. One lamp is behind the
blocks. A second lamp, with 1/50 of the irradiance of the first, is in front of and above
them. A card shades the lower halves of the blocks from the second lamp: they show
transmitted light only, the upper halves transmitted and reflected light.
`splitsnow tailor configs/scenes/sooty.toml` makes sooty.safetensors.
"""

import math

import mitsuba as mi
import stage

import splitsnow.mitsuba

FILE = stage.HERE / "sooty.safetensors"
SOOT_NG_G = (0, 20, 100, 400)
TO_BACK, TO_FRONT = (0.0, 1.0, 0.0), (0.0, -math.sqrt(0.5), math.sqrt(0.5))
FRONT = 0.02
"""Irradiance of the lamp in front, perpendicular to the beam, relative to that of the lamp
behind."""
WIDTH, HEIGHT, DEPTH, BOARD = 0.3, 0.35, 0.1, 0.02
"""In metres, like all lengths in the scene. BOARD is the width of the black boards between
the blocks."""


def lamp(to_lamp, irradiance):
    direction = [-x for x in to_lamp]
    return {"type": "directional", "direction": direction, "irradiance": irradiance}


def scene(size, spp):
    """Blocks along x with their fronts at y = 0; z is up."""
    behind, in_front = ({"type": "d65", "scale": scale} for scale in (1.0, FRONT))
    shapes = {}
    step = WIDTH + BOARD
    for i, soot_ng_g in enumerate(SOOT_NG_G):
        snow = splitsnow.mitsuba.snow(
            FILE, black_carbon_ng_g=soot_ng_g, to_light=TO_BACK, irradiance=behind
        )
        middle = [(i - 1.5) * step, DEPTH / 2, HEIGHT / 2]
        shapes[f"block_{i}"] = stage.box(middle, [WIDTH, DEPTH, HEIGHT], **snow)
    for i in range(len(SOOT_NG_G) + 1):
        middle = [(i - 2) * step, DEPTH / 2, HEIGHT / 2]
        board_size = [BOARD, DEPTH + 0.02, HEIGHT]
        shapes[f"board_{i}"] = stage.box(middle, board_size, bsdf=stage.grey(0.0))
    # The upper edge of the card shades everything below the middle of the blocks.
    card = [0, -1, 1 + HEIGHT / 2 - 0.25]
    shapes["card"] = stage.box(card, [3, 0.001, 0.5], bsdf=stage.grey(0.0))
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sensor": stage.camera([0, -2.4, 0.3], [0, 0, 0.17], 32, size, size * 3 // 8, spp),
        "behind": lamp(TO_BACK, behind),
        # nearly all of the light that is reflected comes from here
        "before": {"sampling_weight": 50.0, **lamp(TO_FRONT, in_front)},
        **shapes,
    }


PICTURE = ("soot", __doc__, scene, 640, 512)

if __name__ == "__main__":
    stage.main(*PICTURE)
