# SPDX-License-Identifier: MIT OR Apache-2.0
"""Operators and the panel in the sidebar of the 3D view, tab Snow."""

from __future__ import annotations

import math

import bpy

from . import baking, checks, joining, material, pictures, settings
from .presets import PRESETS

CHOICES = [(name, preset.label, preset.description) for name, preset in PRESETS.items()]
CHOICES.append((settings.FILE, "File...", "A compact file of the program splitsnow"))
GREY = 0.18


def snow_of(thing):
    """The material of snow of an object, or None."""
    slots = thing.material_slots if thing else ()
    return next((slot.material for slot in slots if material.is_snow(slot.material)), None)


def _selected(context):
    return [thing for thing in context.selected_objects if thing.type == "MESH"]


def _say(operator, context, problems):
    for text in problems:
        operator.report({"WARNING"}, text)
    context.window_manager.splitsnow_problems = "\n".join(problems)


class _OfSnow:
    """Base of operators on the material of snow of the active object."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if snow_of(context.object) is None:
            cls.poll_message_set("The active object has no material of snow: use Snow Material first")
            return False
        return True


class SPLITSNOW_OT_material(bpy.types.Operator):
    """Make the selected closed meshes snow"""

    bl_idname = "splitsnow.material"
    bl_label = "Snow Material"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.EnumProperty(name="Snow", items=CHOICES, default="settled")
    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH")
    join: bpy.props.BoolProperty(
        name="Join Touching Meshes",
        description="Join meshes that touch or overlap, because no light passes from one to the other",
        default=True,
    )

    @classmethod
    def poll(cls, context):
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave edit mode first")
            return False
        return True

    def invoke(self, context, _event):
        if self.preset == settings.FILE and not self.filepath:
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        return self.execute(context)

    def execute(self, context):
        things = _selected(context)
        if not things:
            self.report({"ERROR"}, "No mesh is selected: select one or more closed meshes")
            return {"CANCELLED"}
        made = bpy.data.materials.new("Snow")
        try:
            settings.choose(made.splitsnow, self.preset, self.filepath)
            ready = settings.renew(made, context.scene)
            message = made.splitsnow.message
        except ValueError as error:
            ready, message = False, str(error)
        if not ready:
            bpy.data.materials.remove(made)
            self.report({"ERROR"}, message)
            return {"CANCELLED"}
        made.name = "Snow" if self.preset == settings.FILE else PRESETS[self.preset].label
        problems = []
        if self.join and len(things) > 1:
            pairs = checks.touching(things, context.evaluated_depsgraph_get())
            for target, *others in checks.groups(things, pairs):
                problems.append(
                    f'"{target.name}" was joined with {", ".join(repr(o.name) for o in others)}: '
                    "between meshes that touch or overlap no light passes"
                )
                things = [thing for thing in things if thing not in others]
                joining.join(context, target, others)
        for thing in things:
            thing.data.materials.clear()
            thing.data.materials.append(made)
        context.view_layer.update()
        problems += checks.problems(context.scene, context.evaluated_depsgraph_get())
        if not settings.table_of(made.splitsnow).has_reflectance:
            problems.append("The file has no reflectance: lit faces reflect 0.9 of the light")
        if context.scene.render.engine != "CYCLES":
            problems.append("Snow needs Cycles: set Render Engine, or use Bake Thickness for EEVEE")
        _say(self, context, problems)
        return {"FINISHED"}


class SPLITSNOW_OT_preset(_OfSnow, bpy.types.Operator):
    """Choose another snow for the material"""

    bl_idname = "splitsnow.preset"
    bl_label = "Snow"

    preset: bpy.props.EnumProperty(name="Snow", items=CHOICES)

    def execute(self, context):
        made = snow_of(context.object)
        try:
            settings.choose(made.splitsnow, self.preset, made.splitsnow.filepath)
        except ValueError as error:
            made.splitsnow.message = str(error)
            self.report({"ERROR"}, str(error))
            # the choice of a file stays, so that the panel asks for it
            return {"FINISHED" if self.preset == settings.FILE else "CANCELLED"}
        return _renewed(self, context, made)


def _renewed(operator, context, made):
    if not settings.renew(made, context.scene):
        operator.report({"ERROR"}, made.splitsnow.message)
        return {"CANCELLED"}
    if baking.OUTPUT in made.node_tree.nodes and made.splitsnow.sun:
        baking.add_output(made, made.splitsnow.sun, settings.table_of(made.splitsnow))
    return {"FINISHED"}


class SPLITSNOW_OT_update(_OfSnow, bpy.types.Operator):
    """Renew the material after a change of the unit scale, of the colour management or of the file"""

    bl_idname = "splitsnow.update"
    bl_label = "Update Snow"

    def execute(self, context):
        return _renewed(self, context, snow_of(context.object))


class SPLITSNOW_OT_check(bpy.types.Operator):
    """Check all snow of the scene: closed meshes, normals, scale, contact"""

    bl_idname = "splitsnow.check"
    bl_label = "Check Snow"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        problems = checks.problems(context.scene, context.evaluated_depsgraph_get())
        _say(self, context, problems)
        if not problems:
            self.report({"INFO"}, "No problem was found")
        return {"FINISHED"}


class SPLITSNOW_OT_join(bpy.types.Operator):
    """Join the selected meshes with the active one, without the faces between them"""

    bl_idname = "splitsnow.join"
    bl_label = "Join Snow"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if context.mode != "OBJECT" or len(_selected(context)) < 2:
            cls.poll_message_set("Select two or more meshes in object mode")
            return False
        return True

    def execute(self, context):
        things = _selected(context)
        target = context.object if context.object in things else things[0]
        joining.join(context, target, [thing for thing in things if thing is not target])
        context.view_layer.update()
        problems = checks.problems_of(target, context.evaluated_depsgraph_get())
        _say(self, context, problems)
        return {"FINISHED"}


class SPLITSNOW_OT_expose(_OfSnow, bpy.types.Operator):
    """Raise the exposure of the scene so that snow of this thickness, lit from behind, is grey"""

    bl_idname = "splitsnow.expose"
    bl_label = "Set Exposure"

    thickness_cm: bpy.props.FloatProperty(name="Thickness (cm)", default=10, min=0, max=1000)

    def execute(self, context):
        passed = passed_part(snow_of(context.object).splitsnow, self.thickness_cm)
        context.scene.view_settings.exposure = stops(passed)
        return {"FINISHED"}


def passed_part(snow, thickness_cm):
    """Part of the light, as luminance, that goes straight through."""
    import numpy as np

    return float(settings.table_of(snow).at(np.array(thickness_cm), np.array(1.0))[1])


def stops(passed):
    """Exposure that makes light of this part of white a middle grey."""
    return min(32.0, math.log2(GREY / max(passed, 1e-9)))


def least_cm(thing, snow, scene):
    """Smallest side of the box around an object, cm."""
    return min(thing.dimensions) * settings.scale_of(snow, scene)


class SPLITSNOW_OT_bake(_OfSnow, bpy.types.Operator):
    """Store the thickness toward a sun in the mesh, for EEVEE and for export"""

    bl_idname = "splitsnow.bake"
    bl_label = "Bake Thickness"

    stored: bpy.props.BoolProperty(
        name="Apply",
        description="Apply the modifier and add a colour attribute of the transmitted light, for export",
        default=False,
    )

    def execute(self, context):
        thing = context.object
        made = snow_of(thing)
        snow = made.splitsnow
        suns = [o for o in context.scene.objects if o.type == "LIGHT" and o.data.type == "SUN"]
        sun = snow.sun or next(iter(suns), None)
        if sun is None:
            self.report({"ERROR"}, "The scene has no sun: add one, a baked thickness is toward a sun")
            return {"CANCELLED"}
        scale = thing.matrix_world.to_scale()
        if max(abs(part - 1) for part in scale) > 1e-4:
            self.report({"ERROR"}, "Apply the scale of the object first: Object > Apply > Scale")
            return {"CANCELLED"}
        try:
            table = settings.table_of(snow)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        snow.sun = sun
        cm = settings.scale_of(snow, context.scene)
        baking.add_modifier(thing, sun, cm)
        baking.add_output(made, sun, table)
        context.view_layer.update()
        depsgraph = context.evaluated_depsgraph_get()
        mean, most, count = baking.error(thing, sun, table, cm, depsgraph)
        snow.bake_error = (
            f"Delta-E {mean:.2f} in the mean, {most:.2f} at most, of {count} triangles"
        )
        if self.stored:
            baking.store(context, thing, table, pictures.primaries()[1])
        self.report({"INFO"}, f"Baked for EEVEE: {snow.bake_error}")
        return {"FINISHED"}


class SPLITSNOW_PT_panel(bpy.types.Panel):
    bl_label = "Snow"
    bl_idname = "SPLITSNOW_PT_panel"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Snow"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.operator_menu_enum("splitsnow.material", "preset", text="Snow Material")
        row = layout.row(align=True)
        row.operator("splitsnow.check")
        row.operator("splitsnow.join")
        made = snow_of(context.object)
        if made is not None:
            self._snow(layout, context, made)
        problems = context.window_manager.splitsnow_problems
        if problems:
            box = layout.box()
            for text in problems.split("\n"):
                _wrapped(box, text, context, "ERROR")

    def _snow(self, layout, context, made):
        snow, scene = made.splitsnow, context.scene
        label = PRESETS[snow.preset].label if snow.preset in PRESETS else "File" if (
            snow.preset == settings.FILE) else f"missing: {snow.preset}"  # fmt: skip
        layout.separator()
        layout.label(text=made.name, icon="MATERIAL")
        layout.operator_menu_enum("splitsnow.preset", "preset", text=label)
        if snow.preset == settings.FILE:
            layout.prop(snow, "filepath")
        if snow.message:
            _wrapped(layout.box(), snow.message, context, "ERROR")
        try:
            file = settings.file_of(snow)
            column = layout.column(align=True)
            for name in settings.open_axes(file):
                column.prop(snow, name)
                low, high = file.axes[name][[0, -1]]
                column.label(text=f"{low:g} to {high:g}")
        except ValueError:
            file = None
        layout.prop(snow, "illuminant")
        layout.prop(snow, "own_scale")
        if snow.own_scale:
            layout.prop(snow, "cm_per_unit")
        else:
            layout.label(text=f"{settings.scale_of(snow, scene):g} cm per unit, of the scene")
        picture = made.node_tree.nodes[material.PICTURE].image
        if picture:
            layout.label(text=f"Primaries: {picture.colorspace_settings.name}")
        stored = made.node_tree.nodes[material.LENGTH].inputs[1].default_value
        if not math.isclose(stored, settings.scale_of(snow, scene), rel_tol=1e-5):
            _wrapped(layout.box(), "The unit scale has changed: use Update Snow", context, "ERROR")
        layout.operator("splitsnow.update")
        if file is not None and not snow.message:
            self._exposure(layout, context, snow)
        layout.separator()
        layout.prop(snow, "sun")
        row = layout.row(align=True)
        row.operator("splitsnow.bake").stored = False
        row.operator("splitsnow.bake", text="Apply").stored = True
        if snow.bake_error:
            _wrapped(layout, f"Baked: {snow.bake_error}", context, "INFO")

    def _exposure(self, layout, context, snow):
        cm = least_cm(context.object, snow, context.scene)
        try:
            passed = passed_part(snow, cm)
        except ValueError:
            return
        text = f"{cm:.3g} cm let {passed:.2g} of the light through: exposure {stops(passed):+.1f}"
        _wrapped(layout, text, context, "LIGHT_SUN")
        layout.operator("splitsnow.expose").thickness_cm = cm


def _wrapped(layout, text, context, icon):
    """A label of several lines."""
    scale = context.preferences.system.ui_scale or 1  # 0 without windows
    width = max(20, int(context.region.width / 7 / scale))
    column = layout.column(align=True)
    line = ""
    for word in text.split():
        if line and len(line) + len(word) + 1 > width:
            column.label(text=line, icon=icon)
            line, icon = word, "BLANK1"
        else:
            line = f"{line} {word}".strip()
    column.label(text=line, icon=icon)


CLASSES = (
    settings.SnowSettings,
    SPLITSNOW_OT_material,
    SPLITSNOW_OT_preset,
    SPLITSNOW_OT_update,
    SPLITSNOW_OT_check,
    SPLITSNOW_OT_join,
    SPLITSNOW_OT_expose,
    SPLITSNOW_OT_bake,
    SPLITSNOW_PT_panel,
)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Material.splitsnow = bpy.props.PointerProperty(type=settings.SnowSettings)
    bpy.types.WindowManager.splitsnow_problems = bpy.props.StringProperty(options={"SKIP_SAVE"})
    bpy.app.handlers.load_post.append(settings.after_load)


def unregister():
    bpy.app.handlers.load_post.remove(settings.after_load)
    del bpy.types.WindowManager.splitsnow_problems
    del bpy.types.Material.splitsnow
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
