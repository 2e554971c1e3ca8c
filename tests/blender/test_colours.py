"""Pictures agree with the file: blocks under sun, sky and a lamp, a sphere and a torus."""

import math

import bpy
import numpy as np
import pytest
import stage
from mathutils import Vector
from mathutils.bvhtree import BVHTree

THICKNESSES_CM = (5, 10, 15, 30)


def make_snow(*things):
    stage.select(*things)
    result = bpy.ops.splitsnow.material(preset="file", filepath=str(stage.FILE))
    assert result == {"FINISHED"}
    return things[0].material_slots[0].material


def block(thickness_cm):
    made = stage.box((-1.5, 0, -1.5), (1.5, thickness_cm / 100, 1.5))
    stage.camera(0.05)
    make_snow(made)
    return made


def compared(record, name, expected, xyz, rgb, allowed):
    """Delta-E as rendered, and exposed so that the block has half the luminance of white."""
    plain, exposed = (expected.difference(xyz, rgb, e).max() for e in (False, True))
    record(name, plain)
    record(f"{name}, exposed", exposed)
    assert plain < allowed and exposed < 1, (name, plain, exposed)


@pytest.mark.parametrize("thickness_cm", THICKNESSES_CM)
@pytest.mark.parametrize("angle_deg", [0, 40])
def test_sun(snow, record, thickness_cm, angle_deg):
    expected = stage.Expected(snow)
    cosine = math.cos(math.radians(angle_deg))
    block(thickness_cm)
    stage.sun((0, cosine, math.sin(math.radians(angle_deg))))
    xyz = cosine * expected.xyz(thickness_cm / cosine, cosine)
    rgb = stage.render().mean((0, 1))
    name = f"sun, {angle_deg} degrees, {thickness_cm} cm"
    compared(record, name, expected, xyz, rgb, 0.02)


@pytest.mark.parametrize("thickness_cm", THICKNESSES_CM)
def test_uniform_sky_behind(snow, record, scene, thickness_cm):
    expected = stage.Expected(snow)
    block(thickness_cm)
    tree = scene.world.node_tree
    direction = tree.nodes.new("ShaderNodeTexCoord")
    parts = tree.nodes.new("ShaderNodeSeparateXYZ")
    behind = tree.nodes.new("ShaderNodeMath")
    behind.operation = "GREATER_THAN"
    behind.inputs[1].default_value = 0
    tree.links.new(direction.outputs["Generated"], parts.inputs[0])
    tree.links.new(parts.outputs["Y"], behind.inputs[0])
    tree.links.new(behind.outputs[0], tree.nodes["Background"].inputs[1])
    scene.cycles.samples = 1024
    nodes, weights = np.polynomial.legendre.leggauss(64)
    cosine, weights = (nodes + 1) / 2, weights / 2
    light = expected.xyz(thickness_cm / cosine, cosine)
    xyz = (2 * weights * cosine) @ light
    compared(record, f"sky, {thickness_cm} cm", expected, xyz, stage.render().mean((0, 1)), 0.07)


@pytest.mark.parametrize("thickness_cm", THICKNESSES_CM)
def test_area_lamp(snow, record, scene, thickness_cm):
    expected = stage.Expected(snow)
    made = block(thickness_cm)
    lamp = bpy.data.lights.new("lamp", "AREA")
    lamp.size, lamp.energy = 0.5, 10
    thing = stage.add("lamp", lamp)
    distance = 2.0
    thing.location, thing.rotation_euler = (0, distance, 0), (-math.pi / 2, 0, 0)
    scene.cycles.samples = 512
    rgb = stage.render().mean((0, 1))
    # the same lamp on a translucent white sheet gives the scale
    made.hide_render = True
    corners = [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]
    sheet = stage.mesh("sheet", corners, [(0, 1, 2, 3)])
    white = bpy.data.materials.new("white")
    if white.node_tree is None:
        white.use_nodes = True
    white.node_tree.nodes.clear()
    shader = white.node_tree.nodes.new("ShaderNodeBsdfTranslucent")
    shader.inputs["Color"].default_value = (1, 1, 1, 1)
    output = white.node_tree.nodes.new("ShaderNodeOutputMaterial")
    white.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    sheet.data.materials.append(white)
    plain = stage.render().mean((0, 1))
    places = (np.arange(40) + 0.5) / 40 - 0.5
    x, z = np.meshgrid(places * lamp.size, places * lamp.size)
    far = np.sqrt(x**2 + z**2 + distance**2).ravel()
    cosine = distance / far
    weight = cosine**2 / far**2
    xyz = (weight / weight.sum()) @ expected.xyz(thickness_cm / cosine, cosine)
    compared(record, f"lamp, {thickness_cm} cm", expected, xyz, rgb / plain, 0.005)


def sphere(radius, rings=256, sides=512):
    up = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    points = np.stack(
        np.broadcast_arrays(np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)), -1
    )
    vertices = radius * np.concatenate([points.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    k, low = np.arange(sides), (rings - 2) * sides
    after, top, bottom = (k + 1) % sides, len(vertices) - 2, len(vertices) - 1
    faces = [(top, a, b) for a, b in zip(k, after)]
    faces += [(bottom, low + b, low + a) for a, b in zip(k, after)]
    for ring in range(rings - 2):
        a = ring * sides
        faces += [(a + i, a + sides + i, a + sides + j, a + j) for i, j in zip(k, after)]
    return stage.mesh("sphere", vertices, faces, smooth=True)


def torus(large, small, tilt, rings=384, sides=192):
    """The axis is tilted from y toward z."""
    turn = np.linspace(0, 2 * np.pi, rings, endpoint=False)[:, None]
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    radius = large + small * np.cos(around)
    x, y, z = np.broadcast_arrays(radius * np.cos(turn), small * np.sin(around), radius * np.sin(turn))
    c, s = math.cos(tilt), math.sin(tilt)
    vertices = np.stack([x, c * y - s * z, s * y + c * z], -1).reshape(-1, 3)
    i, j = np.arange(rings)[:, None], np.arange(sides)
    a, b = i * sides + j, i * sides + (j + 1) % sides
    c, d = (i + 1) % rings * sides + (j + 1) % sides, (i + 1) % rings * sides + j
    faces = np.stack(np.broadcast_arrays(a, b, c, d), -1).reshape(-1, 4)
    return stage.mesh("torus", vertices, faces.tolist(), smooth=True)


def cast_picture(expected, reflected, thing, normal, toward, scale, size, parts=4):
    """The reference: E cos T(d, cos) / pi along straight rays toward the light, summed over each
    pixel, and E cos R / pi on lit faces; where a ray meets snow again it is dark. ``normal`` is
    exact at a point."""
    mesh = thing.data
    tree = BVHTree.FromPolygons([v.co for v in mesh.vertices], [p.vertices for p in mesh.polygons])
    places = ((np.arange(size * parts) + 0.5) / (size * parts) - 0.5) * scale
    toward, lift = Vector(toward), 1e-5
    found, where, lit = [], [], []
    for row, z in enumerate(places):
        for column, x in enumerate(places):
            seen, _, _, _ = tree.ray_cast(Vector((x, -3, z)), Vector((0, 1, 0)))
            if seen is None:
                continue
            leaves = -normal(seen).dot(toward)
            if leaves <= 0:
                # a lit face, unless snow is before it
                if tree.ray_cast(seen + lift * toward, toward)[0] is None:
                    lit.append((row // parts, column // parts, -leaves))
                continue
            place, _, _, far = tree.ray_cast(seen + lift * toward, toward)
            if place is None:
                continue
            if tree.ray_cast(place + lift * toward, toward)[0] is not None:
                continue
            found.append((100 * (far + lift), abs(normal(place).dot(toward)), leaves))
            where.append((row // parts, column // parts))
    cm, enters, leaves = np.array(found).T
    # through a fine table: there are many rays
    steps = np.linspace(0, np.log1p(cm.max()), 600), np.linspace(0, 1, 120)
    grid = np.stack([expected.xyz(np.expm1(steps[0]), np.full(600, c)) for c in steps[1]], 1)
    u, v = np.log1p(cm) / steps[0][1], enters / steps[1][1]
    i, j = np.minimum(u.astype(int), 598), np.minimum(v.astype(int), 118)
    u, v = (u - i)[:, None], (v - j)[:, None]
    light = (grid[i, j] * (1 - u) + grid[i + 1, j] * u) * (1 - v)
    light += (grid[i, j + 1] * (1 - u) + grid[i + 1, j + 1] * u) * v
    picture = np.zeros((size, size, 3))
    np.add.at(picture, tuple(np.array(where).T), leaves[:, None] * expected.seen(light))
    for row, column, cosine in lit:
        picture[row, column] += cosine * reflected
    return picture / parts**2


def reflectance(material):
    """The colour of the lit faces."""
    return np.array(material.node_tree.nodes["Snow Reflectance"].inputs["Color"].default_value[:3])


def bodies_agree(record, name, expected, picture, rendered):
    """Over the body and pixel by pixel, in pixels that are not dark or at the rim."""
    to_xyz = np.linalg.inv(expected.matrix)
    first, second = ((c.reshape(-1, 3) @ to_xyz.T) for c in (picture, rendered))
    white = to_xyz @ np.ones(3)
    first, second = first / white, second / white
    whole = expected.colour.delta_e(first.mean(0), second.mean(0))
    record(f"{name}, whole", whole)
    bright = first[:, 1] > 0.02 * first[:, 1].max()
    each = expected.colour.delta_e(first[bright], second[bright])
    record(f"{name}, pixels, mean", each.mean())
    assert bright.sum() > 100
    assert whole < 0.1 and each.mean() < 0.3, (name, whole, each.mean(), each.max())


def test_sphere(snow, scene, record):
    expected, size, scale = stage.Expected(snow), 32, 0.32
    stage.prepare(scene, size)
    scene.cycles.samples, scene.cycles.max_bounces = 256, 0
    made = sphere(0.15)
    reflected = reflectance(make_snow(made))
    stage.camera(scale)
    toward = Vector((0, 1, 0))
    stage.sun(toward)
    picture = cast_picture(expected, reflected, made, lambda p: p.normalized(), toward, scale, size)
    bodies_agree(record, "sphere", expected, picture, stage.render())


def test_torus(snow, scene, record):
    expected, size, scale = stage.Expected(snow), 32, 0.8
    stage.prepare(scene, size)
    scene.cycles.samples, scene.cycles.max_bounces = 256, 0
    large, small, tilt = 0.25, 0.08, math.radians(60)
    made = torus(large, small, tilt)
    reflected = reflectance(make_snow(made))
    stage.camera(scale)
    toward = Vector((0, 1, 0.1)).normalized()
    stage.sun(toward)
    axis = Vector((0, math.cos(tilt), math.sin(tilt)))

    def normal(point):
        flat = point - point.dot(axis) * axis
        return (point - large * flat.normalized()).normalized()

    picture = cast_picture(expected, reflected, made, normal, toward, scale, size)
    bodies_agree(record, "torus", expected, picture, stage.render())


def test_lit_faces_reflect_what_the_file_says(snow, scene):
    made = stage.box((-1.5, 0, -1.5), (1.5, 0.3, 1.5))
    material = make_snow(made)
    stage.camera(0.05)
    stage.sun((0, -1, 0))
    settings = snow.interface.settings
    table = settings.table_of(material.splitsnow)
    _, matrix = snow.interface.pictures.primaries()
    reflected = settings.colour.rgb(table.reflected, matrix)
    assert 0.9 < reflected.min() < 1
    assert np.allclose(stage.render().mean((0, 1)), reflected, rtol=5e-3)


def test_snow_behind_snow_is_dark(snow):
    """The limit that the page states."""
    blocks = [stage.box((-1.5, y, -1.5), (1.5, y + 0.05, 1.5)) for y in (0, 0.2)]
    make_snow(*blocks)
    stage.camera(0.05)
    stage.sun((0, 1, 0))
    both = stage.render().mean()
    blocks[1].hide_render = True
    assert both < 0.1 * stage.render().mean()
