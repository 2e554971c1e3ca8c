# SPDX-License-Identifier: MIT OR Apache-2.0
"""Thickness toward one sun, stored in the mesh: for EEVEE, which has no length of shadow rays,
and for export.

A modifier of Geometry Nodes casts a ray from every corner of every face toward the sun, and
stores at the corner the thickness in cm, the cosine where the light enters, and the cosine where
it leaves. A second output of the material, for EEVEE alone, emits the light of the sun that the
table lets through. Between the corners the renderer interpolates; `error` measures what that costs.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector

from . import checks, colour, material

MODIFIER, GROUP = "Snow Thickness", "Snow Thickness"
LENGTH, ENTRY, EXIT = "snow_thickness_cm", "snow_entry_cosine", "snow_exit_cosine"
LIGHT = "snow_transmitted"
"""Colour attribute for export: transmitted light where the sun gives white 1."""
OUTPUT, ROW, COLUMN, PICTURE = "Snow EEVEE", "Snow EEVEE Row", "Snow EEVEE Column", "Snow EEVEE Table"
DIFFUSE, SUN, POWER = "Snow EEVEE Reflectance", "Snow EEVEE Sun", "Snow EEVEE Power"
INWARD = 1e-3
"""Part of the way from a corner to the middle of its face at which its ray begins."""
LIFT = 1e-4
"""Distance along the ray at which it begins, relative to the size of the mesh."""
BLOCKED_CM = 1e5
"""Stored where the ray meets snow again: Cycles shows no light there either."""
MOST_SAMPLES = 4000


def group():
    """The group of nodes that stores thicknesses."""
    found = bpy.data.node_groups.get(GROUP)
    if found is not None:
        return found
    tree = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    tree.is_modifier = True
    face = tree.interface
    face.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    face.new_socket("Sun", in_out="INPUT", socket_type="NodeSocketObject")
    scale = face.new_socket("Centimetres per Unit", in_out="INPUT", socket_type="NodeSocketFloat")
    scale.default_value = 100
    face.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    build = material.Builder(tree)

    def vector(operation, place, first, second=None, scale=None):
        node = build.add("ShaderNodeVectorMath", place, operation=operation)
        build.link(first, node.inputs[0])
        if second is not None:
            build.link(second, node.inputs[1])
        if scale is not None:
            build.link(scale, node.inputs["Scale"])
        return node

    given = build.add("NodeGroupInput", (0, 0))
    mesh = given.outputs["Geometry"]
    sun = build.add("GeometryNodeObjectInfo", (0, 2), transform_space="RELATIVE")
    build.link(given.outputs["Sun"], sun.inputs["Object"])
    turned = build.add("FunctionNodeRotateVector", (1, 2))
    turned.inputs["Vector"].default_value = (0, 0, 1)
    build.link(sun.outputs["Rotation"], turned.inputs["Rotation"])
    toward = turned.outputs[0]
    box = build.add("GeometryNodeBoundBox", (0, 4))
    build.link(mesh, box.inputs[0])
    size = vector("DISTANCE", (1, 4), box.outputs["Min"], box.outputs["Max"]).outputs["Value"]
    lift = build.math("MULTIPLY", (2, 4), size, LIFT).outputs[0]
    far = build.math("MULTIPLY", (2, 5), size, 2).outputs[0]
    step = vector("SCALE", (3, 4), toward, scale=lift).outputs[0]

    corner = build.add("GeometryNodeInputPosition", (0, 6)).outputs[0]
    middle = build.add("GeometryNodeFieldOnDomain", (1, 6), domain="FACE", data_type="FLOAT_VECTOR")
    build.link(corner, middle.inputs[0])
    inner = build.add("ShaderNodeMix", (2, 6), data_type="VECTOR")
    inner.inputs[0].default_value = INWARD
    build.link(corner, inner.inputs[4])
    build.link(middle.outputs[0], inner.inputs[5])
    start = vector("ADD", (3, 6), inner.outputs[1], step).outputs[0]

    def cast(place, source):
        node = build.add("GeometryNodeRaycast", place)
        build.link(mesh, node.inputs["Target Geometry"])
        build.link(source, node.inputs["Source Position"])
        build.link(toward, node.inputs["Ray Direction"])
        build.link(far, node.inputs["Ray Length"])
        return node

    through = cast((4, 5), start)
    beyond = vector("ADD", (5, 4), through.outputs["Hit Position"], step).outputs[0]
    again = cast((6, 4), beyond)
    length = build.math("ADD", (5, 6), through.outputs["Hit Distance"], lift).outputs[0]
    cm = build.math("MULTIPLY", (6, 6), length, given.outputs["Centimetres per Unit"]).outputs[0]
    blocked = build.math("MULTIPLY", (7, 5), again.outputs["Is Hit"], BLOCKED_CM).outputs[0]
    stored_cm = build.math("MAXIMUM", (8, 6), cm, blocked).outputs[0]
    entry = vector("DOT_PRODUCT", (6, 7), through.outputs["Hit Normal"], toward).outputs["Value"]
    normal = build.add("GeometryNodeInputNormal", (6, 8)).outputs[0]
    away = vector("DOT_PRODUCT", (7, 8), normal, toward).outputs["Value"]
    # only where the face looks away from the sun and the ray leaves the snow
    leaving = build.math("GREATER_THAN", (7, 7), entry, 0).outputs[0]
    behind = build.math("MAXIMUM", (9, 8), build.math("MULTIPLY", (8, 8), away, -1).outputs[0], 0)
    shining = build.math("MULTIPLY", (10, 8), behind.outputs[0], leaving).outputs[0]
    for k, (name, value) in enumerate(((LENGTH, stored_cm), (ENTRY, entry), (EXIT, shining))):
        store = build.add(
            "GeometryNodeStoreNamedAttribute", (11 + k, 0), data_type="FLOAT", domain="CORNER"
        )
        store.inputs["Name"].default_value = name
        build.link(mesh, store.inputs["Geometry"])
        build.link(value, store.inputs["Value"])
        mesh = store.outputs[0]
    output = build.add("NodeGroupOutput", (15, 0))
    build.link(mesh, output.inputs[0])
    return tree


def add_modifier(thing, sun, cm_per_unit):
    """Adds the modifier to a mesh, or sets that which is there."""
    modifier = thing.modifiers.get(MODIFIER) or thing.modifiers.new(MODIFIER, "NODES")
    modifier.node_group = group()
    for item in modifier.node_group.interface.items_tree:
        value = {"Sun": sun, "Centimetres per Unit": float(cm_per_unit)}.get(item.name)
        if value is None:
            continue
        if hasattr(modifier, "properties"):  # since Blender 5.2
            getattr(modifier.properties.inputs, item.identifier).value = value
        else:
            modifier[item.identifier] = value
    # makes Blender aware that the mesh depends on the sun
    modifier.node_group = modifier.node_group
    thing.update_tag()
    return modifier


def add_output(thing, sun, table):
    """Adds the output for EEVEE to a material of snow, or renews it."""
    tree = thing.node_tree
    nodes = tree.nodes
    if OUTPUT not in nodes:
        _build_output(tree)
    nodes[PICTURE].image = nodes[material.PICTURE].image
    material.set_mapping(nodes[ROW], nodes[COLUMN], table)
    reflected = nodes[material.DIFFUSE].inputs["Color"].default_value
    nodes[DIFFUSE].inputs["Color"].default_value = reflected
    # the light of the sun, in step with its settings
    for k in range(3):
        _drive(nodes[SUN].inputs[k], "value", sun.data, f"color[{k}]")
    exposure = hasattr(sun.data, "exposure")
    _drive(nodes[POWER].inputs[0], f"value / {math.pi}" + (" * 2 ** stops" if exposure else ""),
           sun.data, "energy", "exposure" if exposure else None)  # fmt: skip


def _drive(socket, expression, source, path, exposure=None):
    socket.driver_remove("default_value")
    driver = socket.driver_add("default_value").driver
    driver.type = "SCRIPTED"
    for name, each in (("value", path), ("stops", exposure)):
        if each:
            variable = driver.variables.new()
            variable.name = name
            variable.targets[0].id_type = "LIGHT"
            variable.targets[0].id = source
            variable.targets[0].data_path = each
    driver.expression = expression


def _build_output(tree):
    build = material.Builder(tree)
    fields = []
    for k, name in enumerate((LENGTH, ENTRY, EXIT)):
        node = build.add("ShaderNodeAttribute", (0, 5 + k), attribute_type="GEOMETRY")
        node.attribute_name = name
        fields.append(node.outputs["Fac"])
    *_, picture = material.place_in_table(
        build, fields[0], fields[1], 2, 5, (ROW, COLUMN, PICTURE)
    )
    colour_of_sun = build.add("ShaderNodeCombineXYZ", (6, 7), SUN)
    power = build.math("MULTIPLY", (6, 8), 1, fields[2], name=POWER)
    lit = build.add("ShaderNodeVectorMath", (7, 5), operation="MULTIPLY")
    build.link(picture.outputs["Color"], lit.inputs[0])
    build.link(colour_of_sun.outputs[0], lit.inputs[1])
    through = build.add("ShaderNodeEmission", (8, 5))
    build.link(lit.outputs[0], through.inputs["Color"])
    build.link(power.outputs[0], through.inputs["Strength"])
    diffuse = build.add("ShaderNodeBsdfDiffuse", (8, 6), DIFFUSE)
    both = build.add("ShaderNodeAddShader", (9, 5))
    build.link(diffuse.outputs[0], both.inputs[0])
    build.link(through.outputs[0], both.inputs[1])
    output = build.add("ShaderNodeOutputMaterial", (10, 5), OUTPUT, target="EEVEE")
    build.link(both.outputs[0], output.inputs["Surface"])


def _attribute(mesh, name):
    values = np.empty(len(mesh.loops), np.float32)
    mesh.attributes[name].data.foreach_get("value", values)
    return values


def error(thing, sun, table, cm_per_unit, depsgraph):
    """Delta-E between the light as interpolated and as cast, in the middles of triangles.

    Returns the mean and the largest, of colours on a scale where the brightest has half the
    luminance of white, and the number of triangles.
    """
    evaluated = thing.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), int)
    mesh.loop_triangles.foreach_get("loops", corners)
    corners = corners.reshape(-1, 3)
    length, entry, leaving = (_attribute(mesh, name) for name in (LENGTH, ENTRY, EXIT))
    evaluated.to_mesh_clear()
    shape = checks.Shape(thing, depsgraph)
    toward = sun.matrix_world.to_quaternion() @ Vector((0, 0, 1))
    middles = shape.vertices[shape.faces].mean(1)
    steps = shape.vertices[shape.faces]
    normals = np.cross(steps[:, 1] - steps[:, 0], steps[:, 2] - steps[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    away = np.flatnonzero(normals @ np.array(toward) < 0)
    away = away[:: max(1, -(-len(away) // MOST_SAMPLES))]
    if not len(away):
        return 0.0, 0.0, 0
    exact, baked = [], []
    lift = LIFT * shape.size
    for k in away:
        cm, enters = _cast(shape, Vector(middles[k]), toward, lift, cm_per_unit)
        exact.append((cm, enters, leaving[corners[k]].mean() if enters > 0 else 0))
        baked.append([values[corners[k]].mean() for values in (length, entry, leaving)])
    exact, baked = np.array(exact), np.array(baked)
    # the light that leaves, which is the same function of both
    first, second = (table.at(v[:, 0], np.maximum(v[:, 1], 0)) * v[:, 2:] for v in (exact, baked))
    scale = 0.5 / max(first[:, 1].max(), second[:, 1].max(), 1e-30)
    differences = colour.delta_e(scale * first, scale * second)
    return float(differences.mean()), float(differences.max()), len(away)


def _cast(shape, start, toward, lift, cm_per_unit):
    place, normal, _, far = shape.tree.ray_cast(start + lift * toward, toward)
    if place is None or normal.dot(toward) <= 0:
        return 0.0, 0.0
    again = shape.tree.ray_cast(place + lift * toward, toward)[0]
    cm = BLOCKED_CM if again is not None else (far + lift) * cm_per_unit
    return cm, normal.dot(toward)


def store(context, thing, table, matrix):
    """Applies the modifier, and stores the transmitted colours for export."""
    with context.temp_override(object=thing, active_object=thing, selected_objects=[thing]):
        bpy.ops.object.modifier_apply(modifier=MODIFIER)
    mesh = thing.data
    length, entry, leaving = (_attribute(mesh, name) for name in (LENGTH, ENTRY, EXIT))
    light = colour.rgb(table.at(length, np.maximum(entry, 0)) * leaving[:, None], matrix).clip(0)
    if LIGHT not in mesh.color_attributes:
        mesh.color_attributes.new(LIGHT, "FLOAT_COLOR", "CORNER")
    rgba = np.concatenate([light, np.ones((len(light), 1))], 1).astype(np.float32)
    mesh.color_attributes[LIGHT].data.foreach_set("color", rgba.ravel())
