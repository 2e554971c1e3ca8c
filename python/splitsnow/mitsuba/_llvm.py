"""Whether the LLVM that Mitsuba finds can be used."""

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
    """Raises ``RuntimeError`` where the LLVM variants of Mitsuba cannot run.

    Some versions of LLVM (15 and 16 among them) end the process at the first rendering,
    so that a process of its own tries one, once; it takes about a second.
    """
    probe = [sys.executable, "-c", _PROBE]
    try:
        done = subprocess.run(probe, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired as error:
        raise _unusable("no image was ready in two minutes") from error
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        code = f"rendering ends the process (code {done.returncode})"
        raise _unusable(said[-1].strip() if said else code)


def _unusable(why: str) -> RuntimeError:
    return RuntimeError(
        f"the LLVM that Mitsuba finds cannot be used: {why}. Install version 19, on Debian and "
        "Ubuntu with `apt install libllvm19`; where there are several, set DRJIT_LIBLLVM_PATH "
        "to the library. Or use a scalar variant, which is much slower"
    )
