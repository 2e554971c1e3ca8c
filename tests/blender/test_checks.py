"""Checks of meshes, and joining."""

import bmesh
import bpy
import numpy as np
import pytest
import stage


@pytest.fixture
def problems(snow):
    def problems():
        depsgraph = bpy.context.evaluated_depsgraph_get()
        depsgraph.update()
        return snow.interface.checks.problems(bpy.context.scene, depsgraph)

    return problems


def make_snow(*things, join=False):
    stage.select(*things)
    assert bpy.ops.splitsnow.material(preset="packed", join=join) == {"FINISHED"}


def edit(thing, change):
    mesh = bmesh.new()
    mesh.from_mesh(thing.data)
    mesh.faces.ensure_lookup_table()
    change(mesh)
    mesh.to_mesh(thing.data)
    mesh.free()
    bpy.context.view_layer.update()


def test_a_good_block_has_no_problem(problems):
    make_snow(stage.box((0, 0, 0), (1, 1, 1)))
    assert problems() == []
    assert bpy.context.window_manager.splitsnow_problems == ""


def test_open_mesh(problems):
    block = stage.box((0, 0, 0), (1, 1, 1))
    edit(block, lambda mesh: bmesh.ops.delete(mesh, geom=[mesh.faces[0]], context="FACES"))
    make_snow(block)
    (text,) = problems()
    assert text.startswith('"block" is not closed: 4 of 12 edges')
    assert bpy.context.window_manager.splitsnow_problems == text


def test_normals(problems):
    block = stage.box((0, 0, 0), (1, 1, 1))
    edit(block, lambda mesh: mesh.faces[0].normal_flip())
    make_snow(block)
    (text,) = problems()
    assert "normals that disagree at 4 edges" in text and "Recalculate Outside" in text
    edit(block, lambda mesh: [face.normal_flip() for face in list(mesh.faces)[1:]])
    (text,) = problems()
    assert "normals that point inwards" in text


def test_scale(problems):
    block = stage.box((0, 0, 0), (1, 1, 1))
    block.scale = (2, 1, 1)
    make_snow(block)
    (text,) = problems()
    assert "has the scale 2, 1, 1: apply it" in text


@pytest.mark.parametrize(
    "low, high, touch",
    [
        ((1, 0, 0), (2, 1, 1), True),
        ((1, -1, -1), (2, 2, 2), True),
        ((1, 0.4, -1), (2, 0.6, 2), True),
        ((0.5, 0.5, 0.5), (2, 2, 2), True),
        ((-1, 0.4, 0.4), (2, 0.6, 0.6), True),
        ((0.4, 0.4, 0.4), (0.6, 0.6, 0.6), True),
        ((1.01, 0, 0), (2, 1, 1), False),
    ],
)
def test_contact_and_overlap(problems, low, high, touch):
    make_snow(stage.box((0, 0, 0), (1, 1, 1), "first"), stage.box(low, high, "second"))
    *pairs, last = problems()
    assert last.startswith("2 objects are snow")
    if touch:
        (text,) = pairs
        assert text.startswith('"first" and "second" touch or overlap: no light passes')
    else:
        assert not pairs


def test_touching_meshes_are_joined(problems, scene):
    """Two blocks of 5 cm in contact have the colour of one of 10 cm; without joining they are black
    in direct light."""
    scene.cycles.max_bounces = 0
    first = stage.box((-1.5, 0, -1.5), (1.5, 0.05, 1.5), "first")
    second = stage.box((-1.5, 0.05, -1.5), (1.5, 0.1, 1.5), "second")
    apart = stage.box((5, 0, 0), (6, 1, 1), "apart")
    stage.camera(0.05)
    stage.sun((0, 1, 0))
    make_snow(first, second, join=False)
    assert stage.render().mean() < 1e-5
    make_snow(first, second, apart, join=True)
    assert "second" not in bpy.data.objects and "apart" in bpy.data.objects
    said = bpy.context.window_manager.splitsnow_problems
    assert '"first" was joined with ' in said and "second" in said
    assert problems() == [said.split("\n")[-1]]
    joined = stage.render().mean((0, 1))
    whole = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5), "whole")
    bpy.data.objects["first"].hide_render = True
    make_snow(whole)
    assert np.allclose(joined, stage.render().mean((0, 1)), rtol=2e-3)


def test_join_operator(problems):
    first = stage.box((0, 0, 0), (1, 1, 1), "first")
    second = stage.box((0.5, 0.5, 0.5), (2, 2, 2), "second")
    make_snow(first, second)
    stage.select(first, second)
    assert bpy.ops.splitsnow.join() == {"FINISHED"}
    assert problems() == []
    mesh = bmesh.new()
    mesh.from_mesh(bpy.data.objects["first"].data)
    assert np.isclose(mesh.calc_volume(), 1 + 1.5**3 - 0.5**3, rtol=1e-4)
    mesh.free()
