"""Checks that the OSL shader of docs/c.md compiles in Blender.

After compilation, the parameters of the shader are sockets of the shader node. `.ci/full`
runs this script with the package bpy, which contains Blender.
"""

import pathlib

import bpy

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "c.md"


def main():
    page = PAGE.read_text()
    shader = page[page.index("shader snow(") :]
    shader = shader[: shader.index("\n```")]
    bpy.context.scene.render.engine = "CYCLES"
    bpy.context.scene.cycles.shading_system = True
    material = bpy.data.materials.new("snow")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeScript")
    text = bpy.data.texts.new("snow.osl")
    text.write(shader)
    # the assignment compiles the shader
    node.script = text
    inputs = [socket.name for socket in node.inputs]
    outputs = [socket.name for socket in node.outputs]
    assert {"table", "light", "thickness_cm", "first_row_below"} <= set(inputs), inputs
    assert outputs == ["result"], outputs
    print(f"Blender {bpy.app.version_string} compiles the shader: {', '.join(inputs)}")


main()
