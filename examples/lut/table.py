"""Reads the tables of `splitsnow export --format lut`, with numpy alone."""

import json
import struct
from pathlib import Path

import numpy as np


def read_exr(path):
    """The pixels of an uncompressed EXR file of half floats, ``(rows, columns, 3)``, top row first."""
    data = Path(path).read_bytes()
    if data[:4] != b"\x76\x2f\x31\x01":
        raise ValueError(f"{path} is not an EXR file")
    place, attributes = 8, {}
    while data[place]:
        name, kind, rest = data[place:].split(b"\0", 2)
        size = struct.unpack("<i", rest[:4])[0]
        attributes[name.decode()] = rest[4 : 4 + size]
        place += len(name) + len(kind) + 6 + size
    if attributes["compression"] != b"\0":
        raise ValueError(f"{path} is compressed; use the file as the program wrote it")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    offsets = np.frombuffer(data, "<u8", height, place + 1)
    # a line is its number, its size, then the channels B, G and R
    lines = [np.frombuffer(data, "<f2", 3 * width, int(offset) + 8).reshape(3, width) for offset in offsets]
    return np.array(lines, float)[:, ::-1].transpose(0, 2, 1)


class Table:
    """Transmitted and reflected colours, in the primaries of the table."""

    def __init__(self, sidecar):
        sidecar = Path(sidecar)
        self.about = json.loads(sidecar.read_text(encoding="utf-8"))
        part = self.about["transmittance"]
        self.image = read_exr(sidecar.with_name(part["file"])) / part["scale"]
        self.u, self.v = part["u"], part["v"]
        self.strip = None
        if self.about["reflectance"]:
            self.strip = read_exr(sidecar.with_name(self.about["reflectance"]["file"]))
        self.to_linear_rec709 = np.array(self.about["primaries"]["to_linear_rec709"])

    def transmittance(self, thickness_cm, cosine):
        """Interpolated as samplers do; arrays are allowed."""
        u, v = self.u, self.v
        h = np.clip(thickness_cm, u["first"], u["last"])
        column = u["scale"] * h**0.25 + u["offset"]
        row = v["scale"] * np.clip(cosine, v["first"], v["last"]) + v["offset"]
        return _sampled(self.image, column, row)

    def reflectance(self, cosine):
        """That of the thickest snow of the file."""
        if self.strip is None:
            raise ValueError("the table has no reflectance")
        u = self.about["reflectance"]["u"]
        column = u["scale"] * np.clip(cosine, u["first"], u["last"]) + u["offset"]
        return _sampled(self.strip, column, 0.5 * np.ones_like(column))


def _sampled(image, u, v):
    """Linear between the centres of texels, held beyond the outer ones."""
    total = 0
    for i, share in _sides(v, image.shape[0]):
        for j, part in _sides(u, image.shape[1]):
            total = total + (share * part)[..., None] * image[i, j]
    return total


def _sides(coordinate, count):
    """The texels on both sides of a coordinate of 0 to 1, with their shares."""
    place = np.clip(np.asarray(coordinate) * count - 0.5, 0, count - 1)
    below = place.astype(int)
    return (below, 1 - (place - below)), (np.minimum(below + 1, count - 1), place - below)
