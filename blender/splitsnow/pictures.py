# SPDX-License-Identifier: MIT OR Apache-2.0
"""Packed images of tables, and the primaries of the scene's colour management."""

from __future__ import annotations

import hashlib
import os
import tempfile

import bpy
import numpy as np

from . import colour, exr

PREFIX = "snow "
XYZ = "Linear CIE-XYZ D65"


def loaded(pixels, name, space):
    """A packed image of ``(height, width, 3)``, the bottom row first, in a colour space."""
    folder = bpy.app.tempdir or tempfile.gettempdir()
    handle, path = tempfile.mkstemp(suffix=".exr", dir=folder)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(exr.encoded(pixels[::-1]))
        image = bpy.data.images.load(path)
        image.name = name
        image.colorspace_settings.name = space
        image.use_half_precision = False
        image.pack()
        # reads the pixels before the file is removed
        image.pixels[0]
    finally:
        os.unlink(path)
    return image


def spaces():
    """Names of the colour spaces that the colour management knows."""
    kinds = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties["name"]
    return [item.identifier for item in kinds.enum_items]


def _converted(space):
    """Colours of the scene that the unit vectors of ``space`` become, as columns."""
    image = loaded(np.eye(3)[None], "snow probe", space)
    try:
        return np.array(image.pixels[:]).reshape(3, 4)[:, :3].T
    finally:
        bpy.data.images.remove(image)


def primaries():
    """The colour space in which the scene is rendered, and the matrix to it from XYZ (D65)."""
    known = spaces()
    likely = [name for name in ("Linear Rec.709", "Linear Rec.2020", "ACEScg") if name in known]
    others = [name for name in known if name not in likely and name.startswith(("Linear", "ACES"))]
    space = next(
        (name for name in likely + others if np.allclose(_converted(name), np.eye(3), atol=1e-5)),
        "Non-Color",
    )
    matrix = _converted(XYZ) if XYZ in known else colour.REC709
    return space, matrix


def image_of(table, space, matrix):
    """The image of a table; an equal one is used again.

    The name follows from the content, so that undo returns to the former image.
    """
    pixels = np.maximum(colour.rgb(table.xyz, matrix), 0).astype(np.float32)
    digest = hashlib.sha256(pixels.tobytes() + space.encode()).hexdigest()[:12]
    name = PREFIX + digest
    image = bpy.data.images.get(name)
    if image is None or image.packed_file is None:
        image = loaded(pixels, name, space)
    return image
