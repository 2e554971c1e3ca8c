# SPDX-License-Identifier: MIT OR Apache-2.0
"""Writes OpenEXR images: scan lines of 32-bit red, green and blue, not compressed.

Blender ignores the colour space of a float image made in memory until the file is saved and
opened again, and encodes float images that it saves itself. Files made here do neither.
"""

from __future__ import annotations

import struct

import numpy as np

FLOAT = 2


def encoded(rgb):
    """The bytes of a file from ``(height, width, 3)``, the top row first."""
    pixels = np.ascontiguousarray(np.asarray(rgb, "<f4")[..., ::-1])  # blue, green, red
    height, width, _ = pixels.shape
    channel = struct.pack("<iB3xii", FLOAT, 0, 1, 1)
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = (
        ("channels", "chlist", b"".join(name + b"\0" + channel for name in (b"B", b"G", b"R")) + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    )
    header = struct.pack("<ii", 20000630, 2)
    for name, kind, value in attributes:
        header += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    lines = []
    for top, line in enumerate(pixels.transpose(0, 2, 1)):
        # the three channels one after the other
        data = line.tobytes()
        lines.append(struct.pack("<ii", top, len(data)) + data)
    begin = len(header) + 8 * height
    offsets = [begin + top * len(lines[0]) for top in range(height)]
    return header + struct.pack(f"<{height}Q", *offsets) + b"".join(lines)
