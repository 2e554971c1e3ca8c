"""A backlit block of snow 10 cm thick, compared with Mitsuba's volumetric path tracer.

    python examples/mitsuba/reference.py --size 384 --spp 64 --out out/reference

writes out/reference.png and out/reference.exr. The left panel shows the block rendered
with `splitsnow.mitsuba`; the middle panel shows a homogeneous medium in which light is
traced from event to event; the right panel shows the middle panel averaged over tiles.
kernel.csv, made by
`cargo run --release --example kernel -- examples/mitsuba/kernel.toml`, gives the
scattering properties of a grain of the same snow. The medium has the single-scattering
albedo, the effective free path and the asymmetry parameter of this grain, with the phase
function of Henyey and Greenstein. The program also prints the colours of the middle of
the block, including those of a medium 3 m wide, which loses hardly any light through its
sides.
"""

import argparse
import csv
import math
import time
from pathlib import Path

import mitsuba as mi
import numpy as np
import stage

import splitsnow
import splitsnow.mitsuba

FILE = stage.HERE / "snow.safetensors"
TO_LAMP = (0.0, 1.0, 0.0)
WIDTH, DEPTH, DISTANCE = 0.3, 0.1, 4.0
"""In metres, like all lengths in the scene. The height of the block equals its width."""
TILES = 8
FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def grains():
    """Columns of kernel.csv."""
    with open(stage.HERE / "kernel.csv") as file:
        rows = list(csv.DictReader(line for line in file if line[0] != "#"))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def medium():
    """Entries of a shape that contains a homogeneous scattering medium. The free path and the
    asymmetry parameter hardly depend on wavelength and are those of the middle wavelength."""
    grain = grains()
    middle = len(grain["albedo"]) // 2
    albedo = list(zip(grain["wavelength_nm"].tolist(), grain["albedo"].tolist()))
    per_m = 1 / float(grain["effective_free_path_m"][middle])
    volumes = {
        name: {"type": "constvolume", "value": {"type": "spectrum", "value": value}}
        for name, value in (("sigma_t", per_m), ("albedo", albedo))
    }
    phase = {"type": "hg", "g": float(grain["p1"][middle])}
    return {
        "bsdf": {"type": "null"},
        "interior": {"type": "homogeneous", "phase": phase, **volumes},
    }


def scene(integrator, entries, width, view, size, spp):
    """A block seen from y < 0. ``view`` is the side of the square field of view, in metres."""
    fov = math.degrees(2 * math.atan(view / 2 / DISTANCE))
    lamp = {"type": "d65"}
    return {
        "type": "scene",
        "integrator": integrator,
        "sensor": stage.camera([0, -DISTANCE, 0], [0, 0, 0], fov, size, size, spp),
        "lamp": {"type": "directional", "direction": [-x for x in TO_LAMP], "irradiance": lamp},
        "block": stage.box([0, DEPTH / 2, 0], [width, DEPTH, width], **entries),
    }


def ours(width, view, size, spp):
    snow = splitsnow.mitsuba.snow(
        FILE, to_light=TO_LAMP, irradiance={"type": "d65"}, reflected=False
    )
    return scene({"type": "path", "max_depth": 1}, snow, width, view, size, spp)


def volume(width, view, size, spp):
    """The scene with a medium. Paths have thousands of events, so neither Russian roulette nor
    a maximum depth ends them."""
    integrator = {"type": "volpath", "max_depth": -1, "rr_depth": 1_000_000}
    return scene(integrator, medium(), width, view, size, spp)


def render(describe, width, view, size, spp):
    """The image in linear sRGB, and the time of rendering in seconds."""
    loaded = mi.load_dict(describe(width, view, size, spp))
    if describe is ours:
        splitsnow.mitsuba.attach(loaded)
    start = time.perf_counter()
    image = np.array(mi.render(loaded))
    seconds = time.perf_counter() - start
    if describe is ours:
        splitsnow.mitsuba.detach(loaded)
    return image, seconds


def delta_e(first, second, exposure):
    """Delta-E (CIE 1976) of two colours in linear sRGB, relative to the lamp's light as white."""
    to_xyz = np.linalg.inv(FROM_XYZ)
    ratios = exposure * np.pi * np.stack([first, second]) @ to_xyz.T / to_xyz.sum(1)
    f = np.where(ratios > (6 / 29) ** 3, np.cbrt(ratios), ratios * (29 / 6) ** 2 / 3 + 4 / 29)
    lab = np.stack([116 * f[:, 1], 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], -1)
    return float(np.linalg.norm(lab[0] - lab[1]))


def compare(size, spp):
    """Prints the colours of the middle third of the block in width and height."""
    print("block\tred\tgreen\tblue\tdelta_e\tdelta_e_exposed\tseconds")
    colour, exposure = None, 1.0
    for name, describe, width in (
        ("splitsnow.mitsuba", ours, WIDTH),
        ("volpath", volume, WIDTH),
        ("volpath, 3 m wide", volume, 3.0),
    ):
        image, seconds = render(describe, width, WIDTH / 3, size, spp)
        mean = image.mean((0, 1))
        if colour is None:
            colour = mean
            exposure = 0.5 / (np.pi * colour @ np.linalg.inv(FROM_XYZ)[1])
        differences = [delta_e(colour, mean, factor) for factor in (1.0, exposure)]
        numbers = (f"{number:.4g}" for number in (*mean, *differences, seconds))
        print(name, *numbers, sep="\t", flush=True)


def panels(smooth, traced):
    """The two images side by side, and ``traced`` averaged over tiles, which reduces its noise."""
    length = len(traced) // TILES
    tiles = traced.reshape(TILES, length, TILES, length, 3).mean((1, 3))
    tiles = tiles.repeat(length, 0).repeat(length, 1)
    return np.concatenate([smooth, traced, tiles], 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=384, help="width of the three panels in pixels")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel")
    parser.add_argument("--variant", default="llvm_ad_spectral", help="Mitsuba variant")
    parser.add_argument(
        "--out", type=Path, default=Path("out/reference"), help="output file without suffix"
    )
    options = parser.parse_args()
    mi.set_variant(options.variant)
    splitsnow.mitsuba.register()
    side = options.size // (3 * TILES) * TILES
    compare(side // 2, options.spp)
    smooth, traced = (
        render(describe, WIDTH, 1.12 * WIDTH, side, options.spp)[0]
        for describe in (ours, volume)
    )
    stage.write(panels(smooth, traced), options.out, 90)


if __name__ == "__main__":
    main()
