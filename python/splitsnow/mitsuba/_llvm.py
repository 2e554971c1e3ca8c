"""Whether the LLVM that Mitsuba finds can be used."""

from __future__ import annotations

import functools
import subprocess
import sys

_PROBE = """
import drjit, mitsuba
mitsuba.set_variant("llvm_ad_rgb")
scene = mitsuba.load_dict({"type": "scene", "shape": {"type": "sphere"}})
ray = mitsuba.Ray3f(mitsuba.Point3f([0, 3], 0, -5), mitsuba.Vector3f(0, 0, 1))
assert list(scene.ray_intersect(ray).is_valid()) == [True, False]
"""


@functools.lru_cache(maxsize=None)
def check_llvm() -> None:
    """Raises ``RuntimeError`` where the LLVM variants of Mitsuba cannot run.

    Some versions of LLVM (15 and 16 among them) end the process at the first kernel,
    so that a process of its own runs one, once; it takes about a second.
    """
    probe = [sys.executable, "-c", _PROBE]
    try:
        done = subprocess.run(probe, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired as error:
        raise _unusable("no kernel was ready in two minutes") from error
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()
        raise _unusable(said[-1] if said else f"a kernel ends it with code {done.returncode}")


def _unusable(why: str) -> RuntimeError:
    return RuntimeError(
        f"the LLVM that Mitsuba finds cannot be used: {why}. Install version 19, on Debian and "
        "Ubuntu with `apt install libllvm19`; where there are several, set DRJIT_LIBLLVM_PATH "
        "to the library. Or use a scalar variant, which is much slower"
    )
