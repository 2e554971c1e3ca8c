"""The declared types match the implementation."""

import subprocess
import sys
from pathlib import Path

import splitsnow

PACKAGE = Path(splitsnow.__file__).parent


def test_the_package_is_marked_as_typed():
    assert (PACKAGE / "py.typed").exists()


def test_stubs_agree_with_the_compiled_part(tmp_path):
    check(tmp_path, "mypy.stubtest", "splitsnow._native")


def test_the_python_part_is_typed(tmp_path):
    check(tmp_path, "mypy", "--strict", "--python-version", "3.10", "-p", "splitsnow")


def check(folder, *command):
    result = subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stdout + result.stderr
