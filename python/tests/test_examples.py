"""The examples of both READMEs run and give plausible results."""

import os
import re

import pytest
from conftest import ROOT


@pytest.mark.parametrize("readme", ["README.md", "python/README.md"])
def test_example(readme, out, monkeypatch):
    text = (ROOT / readme).read_text()
    codes = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (code,) = [code for code in codes if "import" in code and "splitsnow.Database" in code]
    names = {}
    monkeypatch.chdir(ROOT)
    exec(code.replace("out/quick", os.fspath(out)), names)
    assert names["spectra"].shape == (3, 31) and names["colours"].shape == (3, 3)
    assert ((names["measured"] > 0) & (names["measured"] < 1)).all()
