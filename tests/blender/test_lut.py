"""The OSL of `splitsnow export --format lut`, compiled and run by Blender, reads the table as the sidecar
describes it."""

import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import stage

ROOT = Path(__file__).parents[2]
PROGRAM = os.environ.get("SPLITSNOW_BIN", ROOT / "target/release/splitsnow")
SIZE, MOST_CM = 32, 80
sys.path.insert(0, str(ROOT / "examples/lut"))
# as a module, Blender does not find its own package `oslquery`
VERSION = f"python{sys.version_info.major}.{sys.version_info.minor}"
sys.path.append(str(Path(bpy.utils.resource_path("LOCAL"), "python/lib", VERSION, "site-packages")))
from table import Table  # noqa: E402


def test_osl_reads_the_table(scene, tmp_path):
    """A plane that emits: thickness along its width, cosine along its height, in steps of a pixel."""
    snow = ("--facetness=0.3", "--grain-size-um=300", "--density-kg-m3=275")
    command = [str(PROGRAM), "export", str(stage.FILE), "--format=lut", *snow, f"--out={tmp_path / 'snow'}"]
    subprocess.run(command, check=True, capture_output=True)
    scene.cycles.shading_system = True
    scene.cycles.samples = 1
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    stage.camera(1)
    plane = stage.mesh("plane", [(-0.5, 0, -0.5), (0.5, 0, -0.5), (0.5, 0, 0.5), (-0.5, 0, 0.5)], [(0, 1, 2, 3)])
    layer = plane.data.uv_layers.new()
    for corner, place in zip(layer.data, [(0, 0), (1, 0), (1, 1), (0, 1)]):
        corner.uv = place
    material = bpy.data.materials.new("table")
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    place = nodes.new("ShaderNodeSeparateXYZ")
    links.new(nodes.new("ShaderNodeTexCoord").outputs["UV"], place.inputs[0])
    script = nodes.new("ShaderNodeScript")
    text = bpy.data.texts.new("snow.osl")
    text.write((tmp_path / "snow.osl").read_text())
    # the assignment compiles it
    script.script = text
    assert [socket.name for socket in script.outputs] == ["reflectance", "transmittance"]
    script.inputs["table"].default_value = str(tmp_path / "snow.exr")
    script.inputs["reflectance_table"].default_value = str(tmp_path / "snow_reflectance.exr")
    script.inputs["first_row_at_0"].default_value = bpy.app.version < (5, 2)
    for name, output, factor in (("thickness_cm", 0, MOST_CM), ("cosine", 1, 1)):
        snapped = nodes.new("ShaderNodeMath")
        snapped.operation = "SNAP"
        links.new(place.outputs[output], snapped.inputs[0])
        snapped.inputs[1].default_value = 1 / SIZE
        scaled = nodes.new("ShaderNodeMath")
        scaled.operation = "MULTIPLY"
        links.new(snapped.outputs[0], scaled.inputs[0])
        scaled.inputs[1].default_value = factor
        links.new(scaled.outputs[0], script.inputs[name])
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    links.new(emission.outputs[0], output.inputs["Surface"])
    plane.data.materials.append(material)
    table = Table(tmp_path / "snow.json")
    part = np.arange(SIZE) / SIZE
    for name, expected in (
        ("transmittance", table.transmittance(MOST_CM * part[None], part[:, None])),
        ("reflectance", table.reflectance(np.repeat(part[:, None], SIZE, 1))),
    ):
        links.new(script.outputs[name], emission.inputs["Color"])
        found = stage.render()
        error = np.abs(found - expected) / expected.max(-1, keepdims=True)
        print(f"{name}: relative error {error.max():.2e}")
        # A place in the table is exact to 256 x 6e-8 texels in single precision, and neighbours
        # differ by at most 0.16 of the brightest colour: 2.5e-6, and a few roundings.
        assert error.max() < 1e-5
