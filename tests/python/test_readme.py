"""The README's example of reading a database without the package `splitsnow` works."""

import json
import os
import re
from pathlib import Path

import numpy as np
from safetensors import safe_open

README = Path(__file__).parents[2] / "README.md"


def test_example_without_the_package():
    out = os.environ["SPLITSNOW_OUT"]
    codes = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    # the other example uses the package; see python/tests
    (code,) = [code for code in codes if "open_zarr" in code]
    assert "out/quick" in code
    names = {}
    exec(code.replace("out/quick", out), names)
    with safe_open(f"{out}/snow.safetensors", framework="numpy") as file:
        table = json.loads(file.metadata()["error_table"])["transmittance"]
    worst = table["rows"][table["chosen"] - 1]["rmse"]["max"]
    rmse = np.sqrt(np.mean((names["spectrum"] - names["simulated"].values) ** 2))
    # the example sums in single precision, the table in double
    assert 0 < rmse <= worst + 1e-6
