"""Functions shared by the scenes: simple shapes, meshes, rendering and the command line."""

import argparse
from pathlib import Path

import mitsuba as mi
import numpy as np

import splitsnow.mitsuba

HERE = Path(__file__).parent


def box(middle, size, **entries):
    """A box with this centre and these side lengths."""
    half = [length / 2 for length in size]
    to_world = mi.ScalarTransform4f().translate(middle).scale(half)
    return {"type": "cube", "to_world": to_world, **entries}


def grey(reflectance):
    """A diffuse BSDF with the same reflectance at all wavelengths."""
    return {"type": "diffuse", "reflectance": {"type": "spectrum", "value": reflectance}}


def d55():
    """CIE illuminant D55: daylight with the sun lower than for D65."""
    file = HERE.parents[1] / "crates/spectra/data/illuminant_d55.csv"
    rows = [line.split(",") for line in file.read_text().splitlines() if line[:1].isdigit()]
    return {"type": "spectrum", "value": [(float(nm), float(power) / 100) for nm, power in rows]}


def mesh(vertices, faces, smooth, bsdf, emitter=None):
    """A mesh from ``(n, 3)`` vertex positions and ``(m, 3)`` vertex indices of the faces, which
    are anticlockwise seen from outside."""
    entries = mi.Properties()
    entries["bsdf"] = mi.load_dict(bsdf)
    if emitter is not None:
        entries["emitter"] = mi.load_dict(emitter)
    entries["face_normals"] = not smooth
    shape = mi.Mesh("mesh", len(vertices), len(faces), entries, has_vertex_normals=smooth)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    parameters.update()
    return shape


def camera(origin, target, fov, width, height, spp):
    """A perspective camera with a horizontal field of view of ``fov`` degrees; z is up.
    Its pixels have independent noise, as denoising needs."""
    return {
        "type": "perspective",
        "fov": fov,
        "to_world": mi.ScalarTransform4f().look_at(origin, target, [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": spp},
    }


def render(scene, variant, size, spp):
    """Renders the scene described by ``scene(size, spp)``. Returns linear sRGB,
    ``(height, width, 3)``."""
    mi.set_variant(variant)
    splitsnow.mitsuba.register()
    loaded = mi.load_dict(scene(size, spp))
    splitsnow.mitsuba.attach(loaded)
    image = np.array(mi.render(loaded))
    splitsnow.mitsuba.detach(loaded)
    return image


def main(name, doc, scene, size, spp, white_percentile=97):
    """Renders and writes a picture with the options of the command line."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--size", type=int, default=size, help="width in pixels")
    parser.add_argument("--spp", type=int, default=spp, help="samples per pixel")
    parser.add_argument("--variant", default="llvm_ad_spectral", help="Mitsuba variant")
    parser.add_argument(
        "--out", type=Path, default=Path("out") / name, help="output file without suffix"
    )
    parser.add_argument(
        "--denoise", action="store_true", help="denoise the PNG; needs the package pyoidn"
    )
    options = parser.parse_args()
    image = render(scene, options.variant, options.size, options.spp)
    write(image, options.out, white_percentile, denoised if options.denoise else None)


def denoised(image):
    """The image after Intel's Open Image Denoise, on the processor."""
    import pyoidn

    return pyoidn.denoise(np.ascontiguousarray(image, np.float32), hdr=True)


def write(image, out, white_percentile, retouch=None):
    """Writes the image as EXR, and as PNG, after ``retouch``, exposed so that the percentile
    ``white_percentile`` of the values is 80 % of white."""
    out.parent.mkdir(parents=True, exist_ok=True)
    mi.Bitmap(image).write(str(out.with_suffix(".exr")))
    image = retouch(image) if retouch else image
    exposed = 0.8 * image / np.percentile(image, white_percentile)
    mi.util.write_bitmap(str(out.with_suffix(".png")), exposed)
