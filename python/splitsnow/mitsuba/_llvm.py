"""Check of the LLVM library that Mitsuba uses."""

from __future__ import annotations

import functools
import subprocess
import sys

_PROBE = """
import mitsuba
mitsuba.set_variant("llvm_ad_rgb")
film = {"type": "hdrfilm", "width": 2, "height": 2}
scene = {"type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
         "shape": {"type": "sphere", "center": [0, 0, 4]},
         "sensor": {"type": "perspective", "film": film}}
assert mitsuba.render(mitsuba.load_dict(scene), spp=1).array[0] > 0
"""


@functools.lru_cache(maxsize=None)
def check_llvm() -> None:
    """Raises ``RuntimeError`` if the LLVM variants of Mitsuba cannot run.

    Some versions of LLVM (15 and 16 among them) terminate the process at the first
    rendering. The check therefore renders in a separate process, once; it takes about
    a second.
    """
    probe = [sys.executable, "-c", _PROBE]
    try:
        result = subprocess.run(probe, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired as error:
        raise _unusable("a test rendering took more than two minutes") from error
    if result.returncode != 0:
        errors = [line for line in result.stderr.splitlines() if "error" in line.lower()]
        code = f"a test rendering terminated with code {result.returncode}"
        raise _unusable(errors[-1].strip() if errors else code)


def _unusable(reason: str) -> RuntimeError:
    return RuntimeError(
        f"the LLVM library that Mitsuba finds cannot be used: {reason}. Install version 19, on "
        "Debian and Ubuntu with `apt install libllvm19`; if several versions are installed, set "
        "DRJIT_LIBLLVM_PATH to the library. Or use a scalar variant, which is much slower"
    )
