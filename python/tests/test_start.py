"""The quick starts in docs/start and docs/retrieval.md that use Python run as they stand, and print what they show.

As in tests/start.rs, which runs the other blocks: commands run in an empty folder that sees
the clone, `toml` is saved under the name in its first line, and `...` in a `text` block
stands for any lines. Installations are not run.
"""

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

PAGES = ("artist", "plants", "satellite", "snow", "soot", "../retrieval")
INSTALLS = ("cargo install --path .", "pip install ", "apt install ")


def fits(shown, text):
    parts = ["(.*\n)*" if line == "..." else re.escape(line + "\n") for line in shown.splitlines()]
    return re.fullmatch("".join(parts), text) is not None


def shell(script, folder):
    program = Path(os.environ.get("SPLITSNOW_BIN", ROOT / "target/release/splitsnow")).resolve()
    path = os.pathsep.join([str(program.parent), str(Path(sys.executable).parent), os.environ["PATH"]])
    command = ["bash", "-euo", "pipefail", "-c", script]
    result = subprocess.run(command, cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout


def python(code, names):
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(code, names)
    return printed.getvalue()


def test_other_pages_have_no_python():
    names = {path.stem for path in (ROOT / "docs/start").glob("*.md")}
    for name in names - set(PAGES):
        page = (ROOT / f"docs/start/{name}.md").read_text()
        assert "```python\n" not in page and "\npython " not in page


@pytest.mark.parametrize("name", PAGES)
def test_page(name, tmp_path, monkeypatch):
    for shared in ("configs", "examples", "include", "tests"):
        (tmp_path / shared).symlink_to(ROOT / shared)
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    page = (ROOT / f"docs/start/{name}.md").read_text()
    names, printed, compared = {}, None, 0
    for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        if language == "sh":
            installs = all(line.startswith(INSTALLS) for line in text.splitlines())
            printed = None if installs else shell(text, tmp_path)
        elif language == "python":
            printed = python(text, names)
        elif language == "toml":
            (tmp_path / text.splitlines()[0].removeprefix("# ")).write_text(text)
        else:
            assert language == "text" and printed is not None
            assert fits(text, printed), f"{text}is shown, printed:\n{printed}"
            compared += 1
    assert compared > 0


def test_dots_stand_for_lines():
    for shown in ("a\n...\nc\n", "...\n", "a\nb\nc\n...\n"):
        assert fits(shown, "a\nb\nc\n"), shown
    for shown in ("a\n", "...\nb\n", ""):
        assert not fits(shown, "a\nb\nc\n"), shown
