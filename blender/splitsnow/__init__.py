# SPDX-License-Identifier: MIT OR Apache-2.0
"""Snow for Cycles: light that comes through snow has the colour that simulations give it.

docs/blender.md describes the use. `material` is the method; `compact`, `colour` and `table` need
numpy alone; `settings` is what is stored with a material; `interface` is operators and panel.
"""

from . import interface, settings


def register():
    interface.register()


def unregister():
    interface.unregister()


__all__ = ["interface", "register", "settings", "unregister"]
