"""Bakes light through snow into the vertex colours of a mesh, for engines that cannot trace rays.

    splitsnow export FILE --format lut ... --out snow
    python examples/lut/bake.py MESH.obj snow.json --to-light 0 1 0.5 --cm-per-unit 100 --out MESH.gltf

A ray goes from every corner of every face toward the light. Its length in the mesh is the
thickness, and the normal of the face where it leaves toward the light gives the cosine. The
attribute COLOR_0 of the file written is the radiance of the transmitted light where the light
gives a white surface that faces it the radiance 1: cosine at the corner x transmittance, linear
Rec.709 times the exposure, float. Show it unlit, or add it to the reflected light. It holds for
one direction of the light; faces that see the light, and those behind other snow, have 0. Meshes must be closed. Needs numpy.
"""

import argparse
import base64
import json
from pathlib import Path

import numpy as np

from table import Table

INWARD = 1e-3
"""Part of the way from a corner to the middle of its face at which its ray begins: a ray along an
edge would leave the mesh."""


def read_obj(path):
    """Corners of triangles, ``(triangles, 3, 3)``; polygons are cut into fans."""
    vertices, triangles = [], []
    for line in Path(path).read_text(encoding="utf-8").splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(value) for value in rest[:3]])
        elif word == "f":
            corners = [int(corner.split("/")[0]) for corner in rest]
            corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
            triangles += [[corners[0], *pair] for pair in zip(corners[1:], corners[2:])]
    return np.array(vertices)[np.array(triangles)]


def normals_of(triangles):
    """Unit normals of the faces, outwards if corners are counter-clockwise."""
    first, second, third = triangles.swapaxes(0, 1)
    normals = np.cross(second - first, third - first)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def crossings(origin, direction, triangles):
    """Distances at which a ray crosses triangles; infinite where it misses (Moeller, Trumbore)."""
    first, second, third = triangles.swapaxes(0, 1)
    along, across = second - first, third - first
    normal = np.cross(direction, across)
    scale = (along * normal).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        start = origin - first
        u = (start * normal).sum(1) / scale
        turned = np.cross(start, along)
        v = turned @ direction / scale
        distance = (across * turned).sum(1) / scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 1e-9)
    return np.where(hit, distance, np.inf)


def bake(triangles, table, to_light, cm_per_unit):
    """Transmitted light at the corners, ``(triangles, 3, 3)``, in the primaries of the table."""
    to_light = np.asarray(to_light, float) / np.linalg.norm(to_light)
    normals = normals_of(triangles)
    leaving = normals @ to_light
    thickness, entry = np.zeros(triangles.shape[:2]), np.zeros(triangles.shape[:2])
    middles = triangles.mean(1)
    for face in np.flatnonzero(leaving < 0):
        for corner in range(3):
            origin = triangles[face, corner] + INWARD * (middles[face] - triangles[face, corner])
            distance = crossings(origin, to_light, triangles)
            nearest = np.where(leaving > 0, distance, np.inf).argmin()
            again = (leaving < 0) & np.isfinite(distance) & (distance > distance[nearest])
            # snow behind snow stays dark, as in the Blender extension
            if np.isfinite(distance[nearest]) and not again.any():
                thickness[face, corner] = cm_per_unit * distance[nearest]
                entry[face, corner] = leaving[nearest]
    light = table.transmittance(thickness, entry) * np.maximum(-leaving, 0)[:, None, None]
    return np.where(entry[..., None] > 0, light, 0)


def gltf(triangles, colours):
    """A glTF document with positions, normals and float colours."""
    normals = np.repeat(normals_of(triangles)[:, None], 3, axis=1)
    parts = [np.ascontiguousarray(part.reshape(-1, 3), "<f4") for part in (triangles, normals, colours)]
    size = parts[0].nbytes
    accessors = [
        {"bufferView": i, "componentType": 5126, "count": len(part), "type": "VEC3"}
        for i, part in enumerate(parts)
    ]
    accessors[0] |= {"min": parts[0].min(0).tolist(), "max": parts[0].max(0).tolist()}
    data = base64.b64encode(b"".join(part.tobytes() for part in parts)).decode()
    return {
        "asset": {"version": "2.0", "generator": "SPLITSnow examples/lut/bake.py"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "material": 0}]}
        ],
        "materials": [{"extensions": {"KHR_materials_unlit": {}}}],
        "extensionsUsed": ["KHR_materials_unlit"],
        "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteOffset": i * size, "byteLength": size} for i in range(3)],
        "buffers": [{"byteLength": 3 * size, "uri": f"data:application/octet-stream;base64,{data}"}],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", help="closed mesh, OBJ")
    parser.add_argument("table", help="sidecar of the table, JSON")
    parser.add_argument("--to-light", nargs=3, type=float, default=[0, 1, 0], help="direction to the light")
    parser.add_argument("--cm-per-unit", type=float, default=100, help="default: the mesh is in metres")
    parser.add_argument("--exposure", type=float, default=1)
    parser.add_argument("--out", required=True, help="file to write, glTF")
    args = parser.parse_args()
    triangles, table = read_obj(args.mesh), Table(args.table)
    light = bake(triangles, table, args.to_light, args.cm_per_unit)
    colours = np.maximum(args.exposure * light @ table.to_linear_rec709.T, 0)
    Path(args.out).write_text(json.dumps(gltf(triangles, colours)), encoding="utf-8")
    print(f"{args.out}: {len(triangles)} triangles, brightest {colours.max():.4g}")


if __name__ == "__main__":
    main()
