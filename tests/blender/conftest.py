"""Fixtures: Blender with the extension installed from its zip, as by a user.

`tests/blender/run` builds and installs the zip; SPLITSNOW_BLENDER names the folder of Blender's
user files, in which it is.
"""

import os
import sys
from pathlib import Path

# Blender reads it when it is imported.
os.environ["BLENDER_USER_RESOURCES"] = os.environ["SPLITSNOW_BLENDER"]
import bpy  # noqa: E402
import pytest  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
EXTENSION = "bl_ext.user_default.splitsnow"


@pytest.fixture
def scene():
    """An empty scene, rendered by Cycles, with the extension enabled."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    import stage

    stage.prepare(bpy.context.scene)
    return bpy.context.scene


@pytest.fixture
def snow(scene):
    """The modules of the installed extension."""
    return sys.modules[EXTENSION]


@pytest.fixture(scope="session")
def record():
    """Collects measured numbers and prints them at the end."""
    lines = []
    yield lambda name, value: lines.append(f"{name}: Delta-E {value:.3f}")
    print(f"\nBlender {bpy.app.version_string}")
    print("\n".join(lines))


STATUS = []


def pytest_sessionfinish(exitstatus):
    STATUS.append(int(exitstatus))


@pytest.hookimpl(trylast=True)
def pytest_unconfigure():
    """Ends the process at once: as a module, Blender 4.5 can hang while Python shuts down."""
    sys.stdout.flush()
    sys.stderr.flush()
    if STATUS:
        os._exit(STATUS[0])
