"""The types that are declared are those that are there."""

import subprocess
import sys
from pathlib import Path

import splitsnow

PACKAGE = Path(splitsnow.__file__).parent


def test_marked_as_typed():
    assert (PACKAGE / "py.typed").exists()


def test_stubs_agree_with_the_compiled_half(tmp_path):
    check(tmp_path, "mypy.stubtest", "splitsnow._native")


def test_the_python_half_is_typed(tmp_path):
    check(tmp_path, "mypy", "--strict", "--python-version", "3.10", "-p", "splitsnow")


def check(folder, *command):
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
