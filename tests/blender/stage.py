"""Scenes and renders of the tests. Lengths are in Blender units, which are metres."""

import math
import tempfile
from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Vector

FILE = Path(__file__).parents[2] / "examples/mitsuba/snow.safetensors"


def prepare(scene, size=32):
    """Small linear pictures without denoising."""
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 64
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.world = bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs[0].default_value = (1, 1, 1, 1)
    background.inputs[1].default_value = 0


def add(name, data):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def mesh(name, vertices, faces, smooth=False):
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    if smooth:
        data.shade_smooth()
    return add(name, data)


def box(low, high, name="block"):
    """A closed box with normals outwards."""
    data = bmesh.new()
    bmesh.ops.create_cube(data, size=1)
    size, middle = np.subtract(high, low), np.add(high, low) / 2
    for vertex in data.verts:
        vertex.co = Vector(np.array(vertex.co) * size + middle)
    target = bpy.data.meshes.new(name)
    data.to_mesh(target)
    data.free()
    return add(name, target)


def camera(scale, distance=3.0):
    """An orthographic camera that looks along y."""
    eye = add("camera", bpy.data.cameras.new("camera"))
    eye.location, eye.rotation_euler = (0, -distance, 0), (math.pi / 2, 0, 0)
    eye.data.type, eye.data.ortho_scale = "ORTHO", scale
    bpy.context.scene.camera = eye
    return eye


def sun(toward, energy=math.pi):
    """A sun without extent; a white surface that faces it has the radiance 1 at energy pi."""
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy, lamp.angle = energy, 0
    thing = add("sun", lamp)
    thing.rotation_euler = Vector(toward).to_track_quat("Z", "Y").to_euler()
    return thing


def select(*things):
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[0]


def render():
    """The picture as linear colours, ``(height, width, 3)``, the bottom row first."""
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.array(image.pixels[:]).reshape(height, width, 4)[..., :3]
        bpy.data.images.remove(image)
    return pixels


class Expected:
    """What the file of the tests says, as colours on the primaries of the scene."""

    def __init__(self, snow, path=FILE, values=None):
        self.colour = snow.interface.settings.colour
        file = snow.interface.settings.compact.CompactFile(path)
        self.snow = file.snow("transmittance", values or {})
        self.weights = self.colour.weights(file.wavelengths_nm, "D65")
        self.last_deg = file.axes["angle_deg"][-1]
        _, self.matrix = snow.interface.pictures.primaries()

    def xyz(self, thickness_cm, cosine):
        """X, Y and Z relative to white of the transmitted light at pairs."""
        deg = np.degrees(np.arccos(np.clip(cosine, 0, 1))).clip(0, self.last_deg)
        pairs = zip(np.ravel(thickness_cm), np.ravel(deg))
        spectra = np.array([self.snow.spectra(cm, angle)[0, 0] for cm, angle in pairs])
        return spectra @ self.weights.T

    def seen(self, xyz):
        """Without what the primaries cannot show."""
        return np.maximum(self.colour.rgb(xyz, self.matrix), 0)

    def difference(self, xyz, rgb, exposed=True):
        """Delta-E of rendered colours; exposed, so that the expected ones have half the luminance of
        white at most."""
        white = np.linalg.solve(self.matrix, np.ones(3))
        first, second = (
            np.linalg.solve(self.matrix, np.moveaxis(np.atleast_2d(c), -1, 0).reshape(3, -1)).T / white
            for c in (self.seen(xyz), rgb)
        )
        scale = 0.5 / first[:, 1].max() if exposed else 1
        return self.colour.delta_e(scale * first, scale * second)
