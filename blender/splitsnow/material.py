# SPDX-License-Identifier: MIT OR Apache-2.0
"""The material of snow, of stock nodes.

Front faces are diffuse and translucent. Light that a front face takes from behind has gone
through the back face of the far side, whose Transparent BSDF has the colour of the transmitted
light: on a shadow ray, Ray Length is the distance from the shaded point, which is the length in
the snow. So the material names no light and needs no script.
"""

from __future__ import annotations

import math

from . import colour, pictures

# Names of the nodes, by which an update finds them again.
PICTURE, LENGTH, ROW, COLUMN = "Snow Table", "Snow Centimetres", "Snow Row", "Snow Column"
DIFFUSE = "Snow Reflectance"
NAMES = (PICTURE, LENGTH, ROW, COLUMN, DIFFUSE)


def is_snow(material):
    """Whether a material has the nodes of snow."""
    tree = material and material.node_tree
    return bool(tree) and all(name in tree.nodes for name in NAMES)


def fill(material, table, cm_per_unit):
    """Makes ``material`` snow of this table, or updates it."""
    space, matrix = pictures.primaries()
    if not is_snow(material):
        _build(material)
    nodes = material.node_tree.nodes
    nodes[PICTURE].image = pictures.image_of(table, space, matrix)
    nodes[LENGTH].inputs[1].default_value = cm_per_unit
    set_mapping(nodes[ROW], nodes[COLUMN], table)
    reflected = colour.rgb(table.reflected, matrix).clip(0, 1)
    nodes[DIFFUSE].inputs["Color"].default_value = (*map(float, reflected), 1)


def set_mapping(row, column, table):
    """Sets the nodes from ln(1 + 2 h) and the cosine to the place in the image."""
    rows, columns = table.xyz.shape[:2]
    ends = [math.log1p(2 * cm) for cm in (table.first_cm, table.last_cm)]
    for node, first, last, count in ((row, *ends, rows), (column, *table.cosines, columns)):
        # from the centre of the first texel to that of the last
        scale = (count - 1) / count / (last - first)
        node.inputs[1].default_value = scale
        node.inputs[2].default_value = 0.5 / count - first * scale


class Builder:
    """Adds nodes to a tree and links them."""

    def __init__(self, tree):
        self.tree = tree

    def add(self, kind, place, name=None, **values):
        node = self.tree.nodes.new(kind)
        node.location = (place[0] * 200, place[1] * -180)
        if name:
            node.name = node.label = name
        for key, value in values.items():
            setattr(node, key, value)
        return node

    def math(self, operation, place, first, second=None, third=None, name=None):
        node = self.add("ShaderNodeMath", place, name, operation=operation)
        for socket, value in zip(node.inputs, (first, second, third)):
            if isinstance(value, (int, float)):
                socket.default_value = value
            elif value is not None:
                self.tree.links.new(value, socket)
        return node

    def link(self, output, socket):
        self.tree.links.new(output, socket)


def place_in_table(builder, thickness_cm, cosine, x, y, names=(None, None, None)):
    """Nodes that read the image at a thickness in cm and a cosine: row, column, picture."""
    shifted = builder.math("MULTIPLY_ADD", (x, y), thickness_cm, 2, 1)
    log = builder.math("LOGARITHM", (x + 1, y), shifted.outputs[0], math.e)
    row = builder.math("MULTIPLY_ADD", (x + 2, y), log.outputs[0], 1, 0, names[0])
    column = builder.math("MULTIPLY_ADD", (x + 2, y + 1), cosine, 1, 0, names[1])
    place = builder.add("ShaderNodeCombineXYZ", (x + 3, y))
    builder.link(column.outputs[0], place.inputs[0])
    builder.link(row.outputs[0], place.inputs[1])
    picture = builder.add(
        "ShaderNodeTexImage", (x + 4, y), names[2], interpolation="Linear", extension="EXTEND"
    )
    builder.link(place.outputs[0], picture.inputs[0])
    return row, column, picture


def _build(material):
    if material.node_tree is None:  # before Blender 5.0
        material.use_nodes = True
    if hasattr(material, "use_transparent_shadow"):
        material.use_transparent_shadow = True
    material.diffuse_color = (0.85, 0.92, 1, 1)
    tree = material.node_tree
    tree.nodes.clear()
    builder = Builder(tree)
    path = builder.add("ShaderNodeLightPath", (0, 0))
    surface = builder.add("ShaderNodeNewGeometry", (0, 2))
    length = builder.math("MULTIPLY", (1, 0), path.outputs["Ray Length"], 100, name=LENGTH)
    dot = builder.add("ShaderNodeVectorMath", (1, 1), operation="DOT_PRODUCT")
    builder.link(surface.outputs["Incoming"], dot.inputs[0])
    builder.link(surface.outputs["Normal"], dot.inputs[1])
    cosine = builder.math("ABSOLUTE", (2, 1), dot.outputs["Value"])
    *_, picture = place_in_table(
        builder, length.outputs[0], cosine.outputs[0], 2, 0, (ROW, COLUMN, PICTURE)
    )
    inner = builder.add("ShaderNodeBsdfTransparent", (8, 0))
    builder.link(picture.outputs["Color"], inner.inputs["Color"])
    diffuse = builder.add("ShaderNodeBsdfDiffuse", (7, 1), DIFFUSE)
    translucent = builder.add("ShaderNodeBsdfTranslucent", (7, 2))
    translucent.inputs["Color"].default_value = (1, 1, 1, 1)
    outer = builder.add("ShaderNodeAddShader", (8, 1))
    builder.link(diffuse.outputs[0], outer.inputs[0])
    builder.link(translucent.outputs[0], outer.inputs[1])
    mix = builder.add("ShaderNodeMixShader", (9, 1))
    builder.link(surface.outputs["Backfacing"], mix.inputs[0])
    builder.link(outer.outputs[0], mix.inputs[1])
    builder.link(inner.outputs[0], mix.inputs[2])
    output = builder.add("ShaderNodeOutputMaterial", (10, 1))
    builder.link(mix.outputs[0], output.inputs["Surface"])
