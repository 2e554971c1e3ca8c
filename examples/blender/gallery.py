"""The pictures of docs/blender.md, rendered by Cycles with the extension.

    target/blender-5.2/bin/python examples/blender/gallery.py --out out/gallery [NAME ...]

NAME is blocks, igloo, sculpture or lantern; all of them without a name. Needs the packages bpy
(tests/blender/requirements-5.2.txt) and Pillow. All take half an hour on two cores. Lengths are in
metres; z is up.
"""

import argparse
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector, noise
from PIL import Image

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "blender")]
import splitsnow  # noqa: E402  the extension


def add(name, data):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def mesh(name, vertices, faces, smooth=True):
    """A mesh from vertices and faces, which are anticlockwise seen from outside."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(np.asarray(vertices).tolist(), [], np.asarray(faces).tolist())
    if smooth:
        data.shade_smooth()
    return add(name, data)


def box(name, low, high):
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(name, np.array(low) + corners * np.subtract(high, low), faces, smooth=False)


def snow(preset, *things):
    """Makes closed meshes snow, as the operator of the panel does."""
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[0]
    assert bpy.ops.splitsnow.material(preset=preset) == {"FINISHED"}


def matte(name, colour, *things):
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = (*colour, 1)
    material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    for thing in things:
        thing.data.materials.append(material)


def sky(strength, horizon, zenith=None):
    """Light of the sky: one colour, or from that of the horizon to that of the zenith."""
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = nodes["Background"]
    background.inputs[0].default_value = (*horizon, 1)
    background.inputs[1].default_value = strength
    if zenith is None:
        return
    place, parts = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeSeparateXYZ")
    ramp = nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.interpolation = "EASE"
    ramp.color_ramp.elements[0].color = (*horizon, 1)
    ramp.color_ramp.elements[1].color = (*zenith, 1)
    ramp.color_ramp.elements[1].position = 0.35
    links.new(place.outputs["Generated"], parts.inputs[0])
    links.new(parts.outputs["Z"], ramp.inputs[0])
    links.new(ramp.outputs[0], background.inputs[0])


def lamp(kind, power, colour=(1, 1, 1), place=(0, 0, 0), toward=None, size=0.0):
    data = bpy.data.lights.new(kind.title(), kind)
    data.energy, data.color = power, colour
    if kind == "SUN":
        data.angle = size
    elif kind == "AREA":
        data.size = size
    else:
        data.shadow_soft_size = size
    thing = add(kind.title(), data)
    thing.location = place
    if toward is not None:
        thing.rotation_euler = Vector(toward).to_track_quat("-Z", "Y").to_euler()
    return thing


def camera(place, target, lens):
    eye = add("Camera", bpy.data.cameras.new("Camera"))
    eye.location = place
    eye.rotation_euler = (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    eye.data.lens = lens
    bpy.context.scene.camera = eye


def lathe(rings, sides):
    """Faces of rings of vertices, closed by a point at either end: first all rings, from the first
    end to the last, then the two points."""
    i = np.arange((rings - 1) * sides)
    right = i - i % sides + (i + 1) % sides
    walls = [(i, right, right + sides), (i, right + sides, i + sides)]
    k, low = np.arange(sides), rings * sides
    after, last = (k + 1) % sides, (rings - 1) * sides
    ends = [(np.full(sides, low), after, k), (np.full(sides, low + 1), last + k, last + after)]
    return np.concatenate([np.stack(corners, -1) for corners in walls + ends])


def blocks():
    """Blocks of 5, 10, 15 and 30 cm before a low sun, between black boards."""
    width, height, board = 0.3, 0.36, 0.02
    step = width + board
    made = []
    for k, cm in enumerate((5, 10, 15, 30)):
        x = (k - 2) * step + board / 2
        made.append(box(f"Block {cm} cm", (x, 0, 0), (x + width, cm / 100, height)))
    snow("packed", *made)
    boards = [
        box(f"Board {k}", ((k - 2) * step - board / 2, -0.01, 0), ((k - 2) * step + board / 2, 0.4, height + 0.01))
        for k in range(5)
    ]
    matte("Black", (0.0, 0.0, 0.0), *boards)
    # the ground ends where the sun would light it
    ground = box("Ground", (-4, -4, -0.02), (4, 0, 0))
    matte("Ground", (0.6, 0.6, 0.6), ground)
    sky(0, (1, 1, 1))
    lamp("SUN", math.pi, toward=(0, -1, 0))
    camera((0, -2.3, 0.5), (0, 0, 0.11), 58)
    return {"size": (1920, 1080), "samples": 128, "exposure": 6.4}


def seams(elevation, azimuth, radius, rows, block, width):
    """Depth of the groove between the blocks of an igloo, 1 in the middle of a seam."""
    position = elevation / (np.pi / 2) * (rows + 0.5)
    row = np.minimum(np.floor(position), rows)
    height = radius * np.pi / 2 / (rows + 0.5)
    to_row = np.abs(position - np.clip(np.round(position), 1, rows)) * height
    girth = 2 * np.pi * radius * np.cos((row + 0.5) / (rows + 0.5) * np.pi / 2)
    count = np.maximum(np.round(girth / block), 3)
    turn = azimuth / (2 * np.pi) * count + 0.5 * (row % 2)
    to_side = np.abs(turn - np.round(turn)) / count * 2 * np.pi * radius * np.cos(elevation)
    distance = np.where(row < rows, np.minimum(to_row, to_side), to_row)
    return np.exp(-((distance / width) ** 2))


def igloo(rings=200, sides=800, radius=1.5, thickness=0.15, seam=0.06):
    """Inside an igloo: blocks of 15 cm, 6 cm at the seams, under a clear sky with the sun."""
    elevation = np.linspace(0, np.pi / 2, rings + 1)[:-1, None]
    azimuth = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    unit = np.stack(
        np.broadcast_arrays(
            np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
        ), -1,
    )  # fmt: skip
    groove = (thickness - seam) * seams(elevation, azimuth, radius, 7, 0.5, 0.03)[..., None]
    inner = unit * (radius + 0.25 * groove)
    outer = unit * (radius + thickness - 0.75 * groove)
    # rows of vertices run from the top down the inside and up the outside
    rows = np.concatenate([inner[::-1], outer]).reshape(-1, 3)
    vertices = np.concatenate([rows, [[0, 0, radius], [0, 0, radius + thickness]]])
    snow("packed", mesh("Igloo", vertices, lathe(2 * rings, sides)))
    floor = mesh("Floor", [(-1.6, -1.6, 0.02), (1.6, -1.6, 0.02), (1.6, 1.6, 0.02), (-1.6, 1.6, 0.02)], [(0, 1, 2, 3)])
    matte("Floor", (0.35, 0.36, 0.38), floor)
    sky(0.35, (0.75, 0.87, 1.0))
    lamp("SUN", 6, (1.0, 0.95, 0.88), toward=(-0.45, -1, -0.7), size=math.radians(0.5))
    camera((0.1, -1.28, 0.62), (0.0, 0.6, 0.98), 17)
    return {"size": (1440, 1080), "samples": 48, "exposure": 4.4, "look": "AgX - Very High Contrast", "bounces": 3}


def sculpture(rings=220, sides=400, height=2.2, radius=0.62):
    """A body with three fins that turn with height, under an evening sky, before a lamp."""
    up = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, rings + 2)[1:-1])[:, None]
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    profile = radius * up**0.3 * (1 - up) ** 0.55 * (1.15 + 0.3 * np.cos(9 * up + 0.4))
    fins = 0.3 + 0.7 * np.cos(1.5 * (around - 2.2 * up)) ** 2
    reach = profile * fins
    z = np.broadcast_to(height * up, reach.shape)
    side = np.stack([reach * np.cos(around), reach * np.sin(around), z], -1).reshape(-1, 3)
    vertices = np.concatenate([side, [[0, 0, 0], [0, 0, height]]])
    snow("packed", mesh("Sculpture", vertices, lathe(rings, sides)))
    plinth = box("Plinth", (-0.5, -0.5, -0.2), (0.5, 0.5, -0.003))
    ground = box("Ground", (-60, -60, -0.4), (60, 60, -0.2))
    matte("Stone", (0.03, 0.03, 0.033), plinth)
    matte("Ground", (0.009, 0.0095, 0.011), ground)
    sky(0.006, (0.2, 0.27, 0.5), (0.04, 0.09, 0.3))
    lamp("POINT", 700, (1.0, 0.95, 0.88), (0.9, 2.4, 2.1), size=0.15).visible_camera = False
    camera((0, -5.9, 1.2), (0, 0, 1.0), 66)
    return {"size": (1200, 1080), "samples": 96, "exposure": 4.9}


def carving(around, up):
    """Depth of the lozenges cut into the wall of the lantern, 0 to 1."""
    deepest = np.zeros(np.broadcast(around, up).shape)
    for k, (level, size) in enumerate(((0.25, 0.125), (0.49, 0.11), (0.71, 0.085))):
        count = 8
        turn = around / (2 * np.pi) * count + 0.5 * (k % 2)
        aside = np.abs(turn - np.round(turn)) / 0.42
        above = np.abs(up - level) / size
        inside = np.clip((1 - aside - above) / 0.35, 0, 1)
        deepest = np.maximum(deepest, inside**2 * (3 - 2 * inside))
    return deepest


def lantern(rings=260, sides=720, height=0.42, wall=0.09):
    """A lantern of packed snow with a carved wall of 9 to 2 cm, a candle in it, at dusk."""
    up = np.linspace(0, 1, rings)[:, None]
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    profile = 0.18 * (1 - 0.55 * up**2.2) + 0 * around
    rough = np.array(
        [
            [noise.noise(Vector((9 * math.cos(a), 9 * math.sin(a), 22 * z))) for a in around]
            for z in up[:, 0]
        ]
    )
    outer = profile + 0.002 * rough
    inner = profile - wall + 0.068 * carving(around, up)
    z = height * up - 0.01 + 0 * around
    # rows run up the outside and down the inside, rounded at the rim
    rim = 0.5 * (outer[-1] + inner[-1])
    radius = np.concatenate([outer, [rim], inner[::-1]])
    levels = np.concatenate([z, [z[-1] + 0.012], z[::-1]])
    vertices = np.stack([radius * np.cos(around), radius * np.sin(around), levels], -1)
    count = len(vertices)
    i, j = np.arange(count)[:, None], np.arange(sides)
    right, above = (j + 1) % sides, (i + 1) % count
    corners = (i * sides + j, i * sides + right, above * sides + right, above * sides + j)
    faces = np.stack(np.broadcast_arrays(*corners), -1).reshape(-1, 4)
    snow("packed", mesh("Lantern", vertices.reshape(-1, 3), faces))
    points, corners = field(200, 12.0)
    matte("Field of snow", (0.9, 0.93, 0.97), mesh("Field", points, corners))
    sky(0.022, (1.0, 0.62, 0.45), (0.1, 0.17, 0.4))
    lamp("POINT", 6, (1.0, 0.42, 0.1), (0, 0, 0.19), size=0.01)
    camera((0, -1.8, 0.34), (0, 0, 0.22), 60)
    return {"size": (1440, 1080), "samples": 56, "exposure": 4.0}


def field(count, size):
    """A snow field with soft waves; flat under the lantern."""
    line = np.sinh(np.linspace(-4, 4, count)) / np.sinh(4) * size
    x, y = np.meshgrid(line, line)
    far = np.hypot(x, y)
    wave = np.array([noise.noise(Vector((0.9 * a, 0.9 * b, 3.0))) for a, b in zip(x.ravel(), y.ravel())])
    z = 0.18 * wave.reshape(x.shape) * np.clip((far - 0.35) / 1.5, 0, 1)
    i = np.arange(count * count).reshape(count, count)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], -1).reshape(-1, 4)
    return np.stack([x, y, z], -1).reshape(-1, 3), faces


MOST_BYTES = 500_000
PICTURES = {"blocks": blocks, "igloo": igloo, "sculpture": sculpture, "lantern": lantern}


def render(name, out, height, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    splitsnow.register()
    settings = PICTURES[name]()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples or settings["samples"]
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = 0.01
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.cycles.max_bounces = settings.get("bounces", 8)
    scene.cycles.diffuse_bounces = 8
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = settings.get("look", "None")
    scene.view_settings.exposure = settings["exposure"]
    width, full = settings["size"]
    scene.render.resolution_x, scene.render.resolution_y = width * height // full, height
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.compression = 100
    scene.render.dither_intensity = 0
    scene.render.filepath = str(out.resolve() / f"{name}.png")
    bpy.ops.render.render(write_still=True)
    splitsnow.unregister()
    shrink(Path(scene.render.filepath))


def shrink(path):
    """Keeps a picture below 500 kB: if needed, levels are rounded to even numbers, which no eye sees."""
    with Image.open(path) as image:
        levels = np.array(image)
    for step in (1, 2, 3):
        Image.fromarray(levels // step * step).save(path, optimize=True)
        if path.stat().st_size < MOST_BYTES:
            return


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    parser.add_argument("--out", type=Path, default=Path("out/gallery"), help="folder")
    parser.add_argument("--height", type=int, default=1080, help="pixels")
    parser.add_argument("--samples", type=int, help="per pixel")
    options = parser.parse_args()
    for name in options.names or PICTURES:
        if name not in PICTURES:
            parser.error(f"no picture is named {name}; choose from {', '.join(PICTURES)}")
        render(name, options.out, options.height, options.samples)


if __name__ == "__main__":
    main()
