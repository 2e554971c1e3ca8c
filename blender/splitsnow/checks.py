# SPDX-License-Identifier: MIT OR Apache-2.0
"""Checks of objects that are to be snow."""

from __future__ import annotations

import itertools

import bmesh
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from . import material

CONTACT = 1e-4
"""Distance that counts as contact, relative to the size of the smaller object."""
MOST_POINTS = 20_000


def snow_objects(scene):
    """Visible meshes of the scene with a material of snow."""
    return [
        thing
        for thing in scene.objects
        if thing.type == "MESH"
        and not thing.hide_render
        and any(material.is_snow(slot.material) for slot in thing.material_slots)
    ]


def problems_of(thing, depsgraph):
    """What is wrong with one object, as texts that say what to do."""
    found = []
    mesh = bmesh.new()
    mesh.from_object(thing, depsgraph)
    try:
        if not mesh.faces:
            return [f'"{thing.name}" has no faces: snow must be a closed mesh']
        open_edges = sum(not edge.is_manifold for edge in mesh.edges)
        turned = sum(edge.is_manifold and not edge.is_contiguous for edge in mesh.edges)
        if open_edges:
            found.append(
                f'"{thing.name}" is not closed: {open_edges} of {len(mesh.edges)} edges do not have '
                "two faces. Select them in edit mode with Select > All by Trait > Non Manifold, then "
                "fill the holes and remove inner faces"
            )
        if turned:
            found.append(
                f'"{thing.name}" has normals that disagree at {turned} edges: in edit mode select '
                "all, then Mesh > Normals > Recalculate Outside"
            )
        elif not open_edges and mesh.calc_volume(signed=True) <= 0:
            found.append(
                f'"{thing.name}" has normals that point inwards: in edit mode select all, then '
                "Mesh > Normals > Recalculate Outside"
            )
    finally:
        mesh.free()
    scale = thing.matrix_world.to_scale()
    if any(abs(part - 1) > 1e-4 for part in scale) or thing.matrix_world.determinant() < 0:
        numbers = ", ".join(f"{part:.4g}" for part in scale)
        found.append(
            f'"{thing.name}" has the scale {numbers}: apply it with Object > Apply > Scale, so that '
            "a baked thickness is right. Cycles takes the size that you see"
        )
    return found


class Shape:
    """The world-space mesh of an object, for distances."""

    def __init__(self, thing, depsgraph):
        self.thing = thing
        evaluated = thing.evaluated_get(depsgraph)
        mesh = evaluated.to_mesh()
        mesh.calc_loop_triangles()
        vertices = np.empty(3 * len(mesh.vertices))
        mesh.vertices.foreach_get("co", vertices)
        faces = np.empty(3 * len(mesh.loop_triangles), int)
        mesh.loop_triangles.foreach_get("vertices", faces)
        evaluated.to_mesh_clear()
        world = np.array(thing.matrix_world)
        self.vertices = vertices.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
        self.faces = faces.reshape(-1, 3)
        self.tree = BVHTree.FromPolygons(self.vertices.tolist(), self.faces.tolist())
        self.low, self.high = self.vertices.min(0), self.vertices.max(0)
        self.size = float((self.high - self.low).max())

    def points(self, low, high):
        """Vertices and middles of triangles within a box."""
        middles = self.vertices[self.faces].mean(1)
        points = np.concatenate([self.vertices, middles])
        points = points[((points >= low) & (points <= high)).all(1)]
        return points[:: max(1, -(-len(points) // MOST_POINTS))]


def are_touching(first, second):
    """Whether two shapes are in contact or overlap."""
    near = CONTACT * min(first.size, second.size)
    low, high = np.maximum(first.low, second.low) - near, np.minimum(first.high, second.high) + near
    if (low > high).any():
        return False
    for one, other in ((first, second), (second, first)):
        for point in one.points(low, high):
            if other.tree.find_nearest(point, near)[0] is not None:
                return True
    if first.tree.overlap(second.tree):
        return True
    # one within the other
    for one, other in ((first, second), (second, first)):
        start = Vector(one.vertices[0])
        place, normal, _, _ = other.tree.find_nearest(start)
        if (place - start).dot(normal) > 0:
            return True
    return False


def usable(things):
    """Those with faces."""
    return [thing for thing in things if thing.type == "MESH" and len(thing.data.polygons)]


def touching(things, depsgraph):
    """Pairs of objects in contact or overlapping."""
    shapes = [Shape(thing, depsgraph) for thing in usable(things)]
    return [
        (first.thing, second.thing)
        for first, second in itertools.combinations(shapes, 2)
        if are_touching(first, second)
    ]


def groups(things, pairs):
    """Sets of objects that are connected by contact or overlap, of two and more."""
    group = {thing: {thing} for thing in things}
    for first, second in pairs:
        both = group[first] | group[second]
        for thing in both:
            group[thing] = both
    unique = []
    for members in group.values():
        if len(members) > 1 and members not in unique:
            unique.append(members)
    return [[thing for thing in things if thing in members] for members in unique]


def problems(scene, depsgraph):
    """What is wrong with the snow of a scene."""
    things, found = snow_objects(scene), []
    for thing in things:
        found += problems_of(thing, depsgraph)
    for first, second in touching(things, depsgraph):
        found.append(
            f'"{first.name}" and "{second.name}" touch or overlap: no light passes from snow into other snow. '
            "Select both and choose Join Snow"
        )
    if len(things) > 1:
        found.append(
            f"{len(things)} objects are snow: one that stands behind another, as seen from the light, "
            "stops the light as a solid body does, and what is lit through both is nearly black"
        )
    return found
