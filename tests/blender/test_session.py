"""Saving, undo, missing presets, units and primaries."""

import sys

import bpy
import numpy as np
import pytest
import stage
from conftest import EXTENSION


@pytest.fixture
def block(snow):
    made = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    stage.camera(0.05)
    stage.sun((0, 1, 0))
    stage.select(made)
    assert bpy.ops.splitsnow.material(preset="packed") == {"FINISHED"}
    return made


def material():
    return bpy.data.objects["block"].material_slots[0].material


def test_presets_differ(scene, snow):
    colours = {}
    made = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    stage.camera(0.05)
    stage.sun((0, 1, 0))
    for name, preset in snow.interface.PRESETS.items():
        stage.select(made)
        assert bpy.ops.splitsnow.material(preset=name) == {"FINISHED"}
        colours[name] = stage.render().mean((0, 1))
        expected = stage.Expected(snow, preset.path, chosen(snow, made))
        assert expected.difference(expected.xyz(10, 1), colours[name], False).max() < 0.02, name
    brightness = {name: colour.mean() for name, colour in colours.items()}
    assert brightness["packed"] < brightness["settled"] < brightness["new"]
    assert brightness["settled"] < brightness["old"]


def chosen(snow, made):
    settings = snow.interface.settings
    own = made.material_slots[0].material.splitsnow
    names = settings.open_axes(settings.file_of(own))
    return {name: float(f"{getattr(own, name):.6g}") for name in names}


@pytest.mark.parametrize("enabled", [True, False])
def test_the_picture_survives_saving(block, tmp_path, enabled):
    before = stage.render()
    assert before.max() > 1e-3
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)  # also disables the extension
    assert not bpy.data.materials
    if enabled:
        bpy.ops.preferences.addon_enable(module=EXTENSION)
    bpy.ops.wm.open_mainfile(filepath=path)
    picture = next(i for i in bpy.data.images if i.name.startswith("snow "))
    assert picture.packed_file is not None
    assert np.array_equal(stage.render(), before)
    if enabled:
        assert material().splitsnow.preset == "packed"
        # and it can be changed
        material().splitsnow.density_kg_m3 = 200
        assert material().splitsnow.message == ""
        assert stage.render().mean() > before.mean()


def push(text):
    assert bpy.ops.ed.undo_push(message=text) == {"FINISHED"}


def test_undo(block):
    push("made")
    before = stage.render()
    material().splitsnow.density_kg_m3 = 150
    after = stage.render()
    assert after.mean() > 1.2 * before.mean()
    push("changed")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert material().splitsnow.density_kg_m3 == 400
    assert np.array_equal(stage.render(), before)
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert material().splitsnow.density_kg_m3 == 150
    assert np.array_equal(stage.render(), after)


def test_undo_of_the_operator(scene, snow):
    made = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    push("block")
    stage.select(made)
    push("selected")
    assert bpy.ops.splitsnow.material(preset="new") == {"FINISHED"}
    push("snow")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not bpy.data.objects["block"].material_slots
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert snow.interface.snow_of(bpy.data.objects["block"]) is not None


def test_a_missing_preset_gives_a_message_and_keeps_its_look(block, snow, tmp_path, capfd):
    before = stage.render()
    material().splitsnow.preset = "glacier"
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    said = capfd.readouterr().out
    assert 'material "Packed Snow": the preset `glacier` is missing' in said, said
    assert "choose one of new, settled" in material().splitsnow.message
    assert np.array_equal(stage.render(), before)
    with pytest.raises(RuntimeError, match="preset `glacier` is missing"):
        bpy.ops.splitsnow.update()
    # a change does not break the material either
    material().splitsnow.density_kg_m3 = 200
    assert np.array_equal(stage.render(), before)
    assert bpy.ops.splitsnow.preset(preset="old") == {"FINISHED"}
    assert material().splitsnow.message == ""
    assert stage.render().mean() > before.mean()


def test_a_missing_file_gives_a_message(block, snow, tmp_path):
    copy = tmp_path / "mine.safetensors"
    copy.write_bytes(stage.FILE.read_bytes())
    stage.select(block)
    assert bpy.ops.splitsnow.material(preset="file", filepath=str(copy)) == {"FINISHED"}
    before = stage.render()
    copy.unlink()
    with pytest.raises(RuntimeError, match="mine.safetensors is missing: set File to"):
        bpy.ops.splitsnow.update()
    assert np.array_equal(stage.render(), before)


def test_errors_say_what_to_do(block, snow, tmp_path):
    bpy.ops.object.select_all(action="DESELECT")
    with pytest.raises(RuntimeError, match="select one or more closed meshes"):
        bpy.ops.splitsnow.material(preset="new")
    stage.select(block)
    other = tmp_path / "other.safetensors"
    other.write_bytes(b"no snow at all")
    count = len(bpy.data.materials)
    with pytest.raises(RuntimeError, match="not a safetensors file"):
        bpy.ops.splitsnow.material(preset="file", filepath=str(other))
    assert len(bpy.data.materials) == count
    own = material().splitsnow
    own.grain_size_um = 5000
    assert own.message == (
        "grain_size_um = 5000 is outside dry.safetensors, which covers 100 to 1000"
    )
    own.grain_size_um = 300
    assert own.message == ""


def test_the_unit_scale_is_that_of_the_scene(scene, snow):
    """A block of 10 units of a centimetre has the colour of 10 cm."""
    expected = stage.Expected(snow)
    scene.unit_settings.scale_length = 0.01
    made = stage.box((-150, 0, -150), (150, 10, 150))
    stage.camera(5, distance=300)
    stage.sun((0, 1, 0))
    stage.select(made)
    bpy.ops.splitsnow.material(preset="file", filepath=str(stage.FILE))
    xyz = expected.xyz(10, 1)
    assert expected.difference(xyz, stage.render().mean((0, 1)), False).max() < 0.02
    # own scale: the same block taken as 20 cm
    own = made.material_slots[0].material.splitsnow
    own.own_scale, own.cm_per_unit = True, 2
    xyz = expected.xyz(20, 1)
    assert expected.difference(xyz, stage.render().mean((0, 1)), False).max() < 0.02


def test_primaries_are_those_of_the_scene(snow):
    name, matrix = snow.interface.pictures.primaries()
    assert name == "Linear Rec.709"
    assert np.allclose(matrix, snow.interface.settings.colour.REC709, atol=2e-3)
    assert not [image for image in bpy.data.images if "probe" in image.name]


# since Blender 5.0 a file can have another working space than Rec.709
if bpy.app.version >= (5, 0):

    def test_wide_primaries_keep_the_blue_of_deep_snow(block, snow):
        bpy.ops.wm.set_working_color_space(working_space="Linear Rec.2020")
        name, matrix = snow.interface.pictures.primaries()
        assert name == "Linear Rec.2020"
        bpy.ops.splitsnow.update()
        picture = material().node_tree.nodes["Snow Table"].image
        assert picture.colorspace_settings.name == "Linear Rec.2020"
        expected = stage.Expected(snow)
        blue = snow.interface.settings.colour.rgb(expected.xyz(30, 1), matrix)
        assert blue.min() > 0


def test_exposure(block, scene):
    bpy.ops.splitsnow.expose(thickness_cm=30)
    thick = scene.view_settings.exposure
    bpy.ops.splitsnow.expose(thickness_cm=5)
    assert 5 < thick < 10 and 1 < scene.view_settings.exposure < thick


def test_the_extension_can_be_disabled_and_enabled(scene, snow):
    bpy.ops.preferences.addon_disable(module=EXTENSION)
    assert not hasattr(bpy.types.Material, "splitsnow")
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    assert hasattr(bpy.types.Material, "splitsnow") and EXTENSION in sys.modules
