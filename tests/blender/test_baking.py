"""The baked thickness, whose material Cycles renders here as EEVEE would."""

import bpy
import numpy as np
import pytest
import stage
from mathutils import Vector


def bake(thing, stored=False):
    stage.select(thing)
    assert bpy.ops.splitsnow.material(preset="file", filepath=str(stage.FILE)) == {"FINISHED"}
    assert bpy.ops.splitsnow.bake(stored=stored) == {"FINISHED"}
    return thing.material_slots[0].material


def render_baked(material):
    """The picture of the output for EEVEE."""
    for node in material.node_tree.nodes:
        if node.type == "OUTPUT_MATERIAL":
            node.target = "ALL" if node.name == "Snow EEVEE" else "EEVEE"
            node.is_active_output = node.target == "ALL"
    return stage.render()


@pytest.mark.parametrize("thickness_cm", [5, 10, 15, 30])
def test_blocks(snow, record, thickness_cm):
    expected = stage.Expected(snow)
    block = stage.box((-1.5, 0, -1.5), (1.5, thickness_cm / 100, 1.5))
    stage.camera(0.05)
    sun = stage.sun((0, 1, 0))
    material = bake(block)
    xyz = expected.xyz(thickness_cm, 1)
    plain = expected.difference(xyz, render_baked(material).mean((0, 1)), False).max()
    record(f"baked, {thickness_cm} cm", plain)
    assert plain < 0.1
    # the light follows its settings
    before = stage.render().mean((0, 1))
    sun.data.energy *= 2
    sun.data.color = (1, 0.5, 0.25)
    bpy.context.view_layer.update()
    assert np.allclose(stage.render().mean((0, 1)), 2 * before * [1, 0.5, 0.25], rtol=1e-3)


def ball(subdivisions):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions, radius=0.15)
    thing = bpy.context.object
    thing.data.shade_smooth()
    return thing


def error(material):
    words = material.splitsnow.bake_error.split()
    return float(words[1]), float(words[5])


def test_the_error_is_measured_and_falls_with_finer_meshes(snow, record):
    stage.sun((0.2, 1, 0.3))
    found = []
    for subdivisions in (2, 4, 6):
        thing = ball(subdivisions)
        found.append(error(bake(thing)))
        bpy.data.objects.remove(thing)
    for subdivisions, (mean, most) in zip((2, 4, 6), found):
        record(f"baked ball of {20 * 4 ** (subdivisions - 1)} triangles, mean", mean)
        record(f"baked ball of {20 * 4 ** (subdivisions - 1)} triangles, largest", most)
    assert found[0][0] > found[1][0] > found[2][0] > 0 and found[2][0] < 3, found


def test_baked_and_traced_pictures_agree(snow, scene, record):
    scene.cycles.max_bounces = 0
    stage.camera(0.32)
    stage.sun((0.2, 1, 0.3))
    material = bake(ball(6))
    traced = stage.render()
    baked = render_baked(material)
    expected = stage.Expected(snow)
    white = np.linalg.solve(expected.matrix, np.ones(3))
    first, second = (
        np.linalg.solve(expected.matrix, c.reshape(-1, 3).mean(0)) / white for c in (traced, baked)
    )
    difference = expected.colour.delta_e(first, second)
    record("baked ball against the traced one", difference)
    assert traced.mean() > 1e-3 and difference < 0.2


def test_stored_thickness(snow):
    block = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    stage.sun((0, 1, 0))
    bake(block, stored=True)
    assert not block.modifiers
    mesh = block.data
    lengths = [corner.value for corner in mesh.attributes["snow_thickness_cm"].data]
    light = np.array([corner.color[:3] for corner in mesh.color_attributes["snow_transmitted"].data])
    dark_side = [k for p in mesh.polygons if p.normal.y < -0.9 for k in p.loop_indices]
    assert len(dark_side) == 4
    assert np.allclose([lengths[k] for k in dark_side], 10, rtol=1e-3)
    expected = stage.Expected(snow)
    rgb = expected.seen(expected.xyz(10, 1))[0]
    assert np.allclose(light[dark_side], rgb, rtol=5e-3)
    others = np.delete(light, dark_side, 0)
    assert np.allclose(others, 0, atol=1e-6)


def test_the_modifier_follows_the_sun(snow):
    block = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    sun = stage.sun((0, 1, 0))
    bake(block)

    def longest():
        bpy.context.view_layer.update()
        evaluated = block.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = evaluated.to_mesh()
        front = [k for p in mesh.polygons if p.normal.y < -0.9 for k in p.loop_indices]
        values = [mesh.attributes["snow_thickness_cm"].data[k].value for k in front]
        evaluated.to_mesh_clear()
        return max(values)

    assert abs(longest() - 10) < 0.02
    sun.rotation_euler = Vector((0, 1, 1)).to_track_quat("Z", "Y").to_euler()
    assert abs(longest() - 10 * 2**0.5) < 0.03


def test_baking_needs_a_sun_and_an_applied_scale(snow):
    block = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    stage.select(block)
    bpy.ops.splitsnow.material(preset="packed")
    with pytest.raises(RuntimeError, match="no sun: add one"):
        bpy.ops.splitsnow.bake()
    stage.sun((0, 1, 0))
    block.scale = (1, 2, 1)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="Apply the scale"):
        bpy.ops.splitsnow.bake()
