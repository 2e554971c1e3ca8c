"""Compares the baked thickness, rendered by EEVEE, with the file.

Run by hand, because EEVEE needs a graphics card, or Mesa and minutes:

    SPLITSNOW_BLENDER=$PWD/target/blender/5.2/user target/blender-5.2/bin/python tests/blender/eevee.py
"""

import sys

from conftest import EXTENSION  # before bpy: it says where the extension is

import bpy
import stage


def main():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    scene = bpy.context.scene
    stage.prepare(scene)
    kinds = [e.identifier for e in bpy.types.RenderSettings.bl_rna.properties["engine"].enum_items]
    scene.render.engine = next(kind for kind in kinds if kind.startswith("BLENDER_EEVEE"))
    expected = stage.Expected(sys.modules[EXTENSION])
    stage.camera(0.05)
    stage.sun((0, 1, 0))
    worst = 0
    for cm in (5, 10, 15, 30):
        block = stage.box((-1.5, 0, -1.5), (1.5, cm / 100, 1.5))
        stage.select(block)
        bpy.ops.splitsnow.material(preset="file", filepath=str(stage.FILE))
        bpy.ops.splitsnow.bake()
        rgb = stage.render()[8:24, 8:24].mean((0, 1))
        difference = expected.difference(expected.xyz(cm, 1), rgb, False).max()
        print(f"EEVEE, Blender {bpy.app.version_string}, {cm} cm: {rgb}, Delta-E {difference:.3f}")
        worst = max(worst, difference)
        bpy.data.objects.remove(block)
    assert worst < 0.2, worst


main()
