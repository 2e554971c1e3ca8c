# SPDX-License-Identifier: MIT OR Apache-2.0
"""What a material of snow was made of, stored with the material."""

from __future__ import annotations

from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import bpy

from . import colour, compact, material, table
from .presets import PRESETS

FILE = "file"  # in place of the name of a preset
_quiet = []


class MissingError(ValueError):
    """A preset or a file that is not there."""


@contextmanager
def at_once():
    """Within it, changes of settings do not renew the material."""
    _quiet.append(True)
    try:
        yield
    finally:
        _quiet.pop()


def _changed(self, _context):
    if not _quiet:
        renew(self.id_data)


def _axis(name, description, default, low, high, **more):
    return bpy.props.FloatProperty(
        name=name, description=description, default=default, min=low, max=high, update=_changed, **more
    )


class SnowSettings(bpy.types.PropertyGroup):
    """The snow of a material; the names of axes are those of compact files."""

    preset: bpy.props.StringProperty(description="Name of the preset, or `file`; empty: not snow")
    filepath: bpy.props.StringProperty(
        name="File",
        description="Compact file of `splitsnow tailor` or `build`, or its folder",
        subtype="FILE_PATH",
        update=_changed,
    )
    facetness: _axis("Facetness", "From smooth grains, 0, to rough ones, 1", 0.3, 0, 1)
    grain_size_um: _axis(
        "Grain Size (um)", "Mean length of the grains. Fine grains let less light through",
        250, 0.001, 1e6, precision=0, step=1000,
    )  # fmt: skip
    density_kg_m3: _axis(
        "Density (kg/m3)", "Of the dry snow: 100 is powder, 400 packed. Dense snow is darker",
        300, 1, 999, precision=0, step=1000,
    )  # fmt: skip
    black_carbon_ng_g: _axis("Soot (ng/g)", "Mass of black carbon per mass of snow", 0, 0, 1e9)
    absorber_ug_g: _axis("Dust (ug/g)", "Mass of the listed absorber per mass of snow", 0, 0, 1e6)
    water_saturation: _axis("Water", "Part of the pores that is filled with water", 0, 0, 0.5)
    temperature_c: _axis("Temperature (C)", "Of the snow", -1, -40, 0)
    sphericity: _axis("Sphericity", "Mean sphericity of the grains; 1 is a sphere", 0.8, 0.01, 1)
    substrate_reflectance: _axis("Ground", "Reflectance of the ground under the snow", 0, 0, 1)
    illuminant: bpy.props.EnumProperty(
        name="Light",
        description="Spectrum with which the colours are computed. White lamps of the scene stand for it",
        items=[(name, name, text) for name, (_, text) in colour.ILLUMINANTS.items()],
        default="D65",
        update=_changed,
    )
    own_scale: bpy.props.BoolProperty(
        name="Own Scale",
        description="Set centimetres per unit here instead of by the unit scale of the scene",
        update=_changed,
    )
    cm_per_unit: bpy.props.FloatProperty(
        name="Centimetres per Unit",
        description="Length of a Blender unit in the snow, cm",
        default=100,
        min=1e-6,
        max=1e6,
        update=_changed,
    )
    sun: bpy.props.PointerProperty(
        name="Sun",
        description="The sun whose light is baked",
        type=bpy.types.Object,
        poll=lambda _self, thing: thing.type == "LIGHT" and thing.data.type == "SUN",
    )
    bake_error: bpy.props.StringProperty(description="Error of the baked thickness")
    message: bpy.props.StringProperty(description="Why the material could not be renewed")


def scale_of(settings, scene):
    """Centimetres per unit."""
    return settings.cm_per_unit if settings.own_scale else 100 * scene.unit_settings.scale_length


@lru_cache(maxsize=8)
def _file(path, _modified):
    return compact.CompactFile(path)


def file_of(settings):
    """The compact file of the settings."""
    if settings.preset == FILE:
        if not settings.filepath:
            raise MissingError("no file of snow is chosen: set File")
        path = Path(bpy.path.abspath(settings.filepath))
        if path.is_dir():
            path = path / "snow.safetensors"
        if not path.is_file():
            raise MissingError(
                f"the file {path} is missing: set File to a compact file, or choose a preset. The "
                "material keeps its look until then"
            )
    elif settings.preset in PRESETS:
        path = PRESETS[settings.preset].path
        if not path.is_file():
            raise MissingError(f"the file {path} of the extension is missing: install it again")
    else:
        raise MissingError(
            f"the preset `{settings.preset}` is missing in this version of the extension: choose one "
            f"of {', '.join(PRESETS)}, or a file. The material keeps its look until then"
        )
    return _file(str(path), path.stat().st_mtime_ns)


def open_axes(file):
    """Names of the axes on which the settings choose a value."""
    names = (*file.conditions, *compact.CORE[:3])
    return [name for name in names if len(file.axes[name]) > 1]


@lru_cache(maxsize=16)
def _table(file, values, illuminant):
    return table.make(file, dict(values), illuminant)


def table_of(settings):
    """The table of the settings. Raises ``ValueError`` with a message for the user."""
    file = file_of(settings)
    values = tuple((name, float(getattr(settings, name))) for name in open_axes(file))
    # single precision of Blender: 0.3 is 0.30000001
    values = tuple((name, float(f"{value:.6g}")) for name, value in values)
    return _table(file, values, settings.illuminant)


def choose(settings, preset, filepath=""):
    """Sets a preset or a file, with a value on each axis; does not renew the material."""
    with at_once():
        settings.preset = preset
        if preset == FILE:
            settings.filepath = filepath
            file = file_of(settings)
            for name in open_axes(file):
                low, high = file.axes[name][[0, -1]]
                setattr(settings, name, min(max(getattr(settings, name), low), high))
        elif preset in PRESETS:
            file_of(settings)
            for name, value in PRESETS[preset].values.items():
                setattr(settings, name, value)


def renew(thing, scene=None):
    """Renews the picture of a material. Returns whether it could, and says why not in the panel."""
    settings = thing.splitsnow
    try:
        made = table_of(settings)
    except ValueError as error:
        settings.message = str(error)
        return False
    material.fill(thing, made, scale_of(settings, scene or bpy.context.scene))
    settings.message = ""
    return True


@bpy.app.handlers.persistent
def after_load(*_):
    """Says which materials of an opened file cannot be changed because something is missing."""
    for thing in bpy.data.materials:
        settings = thing.splitsnow
        if not settings.preset or not thing.is_editable:
            continue
        try:
            file_of(settings)
            settings.message = ""
        except ValueError as error:
            settings.message = str(error)
            print(f'SPLITSnow: material "{thing.name}": {error}')
