# SPDX-License-Identifier: MIT OR Apache-2.0
"""Joins meshes to one closed mesh, without the faces between them."""

from __future__ import annotations

import bpy


def join(context, target, others):
    """Makes ``target`` the union of itself and ``others``, which are removed."""
    names = []
    for other in others:
        modifier = target.modifiers.new("Snow Union", "BOOLEAN")
        modifier.operation, modifier.solver, modifier.object = "UNION", "EXACT", other
        names.append(modifier.name)
    depsgraph = context.evaluated_depsgraph_get()
    depsgraph.update()
    mesh = bpy.data.meshes.new_from_object(target.evaluated_get(depsgraph))
    target.modifiers.clear()
    mesh.name = target.data.name
    target.data = mesh
    for other in others:
        bpy.data.objects.remove(other)
