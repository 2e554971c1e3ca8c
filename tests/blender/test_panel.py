"""The panel draws in every state, with properties and operators that exist."""

from types import SimpleNamespace

import bpy
import stage


class Layout:
    """Records what a panel draws."""

    def __init__(self, texts):
        self.texts = texts

    def _same(self, **_):
        return Layout(self.texts)

    row = column = box = _same

    def separator(self):
        pass

    def label(self, text, icon="NONE"):
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        self.texts.append(text)

    def prop(self, data, name):
        assert name in data.bl_rna.properties
        self.texts.append(name)

    def operator(self, name, text=""):
        group, own = name.split(".")
        kind = getattr(getattr(bpy.ops, group), own).get_rna_type()
        self.texts.append(text or kind.name)
        return SimpleNamespace()

    def operator_menu_enum(self, name, choice, text=""):
        group, own = name.split(".")
        kind = getattr(getattr(bpy.ops, group), own).get_rna_type()
        assert kind.properties[choice].type == "ENUM"
        self.texts.append(text)


def drawn(snow):
    kind = snow.interface.SPLITSNOW_PT_panel
    texts = []
    panel = SimpleNamespace(layout=Layout(texts))
    for name in ("_snow", "_exposure"):
        setattr(panel, name, getattr(kind, name).__get__(panel))
    context = SimpleNamespace(
        object=bpy.context.object,
        scene=bpy.context.scene,
        window_manager=bpy.context.window_manager,
        region=SimpleNamespace(width=2000),
        preferences=bpy.context.preferences,
    )
    kind.draw(panel, context)
    return texts


def test_states(snow, scene):
    block = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    stage.select(block)
    assert drawn(snow) == ["Snow Material", "Check Snow", "Join Snow"]
    bpy.ops.splitsnow.material(preset="town")
    own = block.material_slots[0].material.splitsnow
    texts = drawn(snow)
    assert {"Town Snow", "black_carbon_ng_g", "0 to 1000", "100 cm per unit, of the scene"} <= set(texts)
    assert "Primaries: Linear Rec.709" in texts and "grain_size_um" not in texts
    (hint,) = [text for text in texts if "of the light through" in text]
    assert hint.startswith("10 cm let 0.00") and "exposure +" in hint
    scene.unit_settings.scale_length = 0.01
    assert "The unit scale has changed: use Update Snow" in drawn(snow)
    bpy.ops.splitsnow.update()
    assert "The unit scale has changed: use Update Snow" not in drawn(snow)
    own.own_scale = True
    assert "cm_per_unit" in drawn(snow)
    own.preset = "glacier"
    own.density_kg_m3 = 200  # asks for a renewal
    assert any("preset `glacier` is missing" in text for text in drawn(snow))
    assert "missing: glacier" in drawn(snow)
    own.preset, own.message = "file", ""
    assert "filepath" in drawn(snow)


def test_hint_of_a_thin_block_and_baking(snow):
    block = stage.box((-1.5, 0, -1.5), (1.5, 0.1, 1.5))
    stage.sun((0, 1, 0))
    stage.select(block)
    bpy.ops.splitsnow.material(preset="packed")
    bpy.ops.splitsnow.bake()
    assert any(text.startswith("Baked: Delta-E 0.0") for text in drawn(snow))
