"""Runs the tests that a base installation passes: ``pip install .`` and pytest, without any extra.

    python -m tools.base_tests [pytest's options]

The tests are copied into an empty folder, so that they import the installed packages and not the sources beside them.
Files that import a module that is not installed are left out and named.
"""

from __future__ import annotations

import ast
import importlib.util
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = (
    *(f"tests/cmpdesign/{room}" for room in ("design", "files", "inputs", "layout", "patterns", "reading")),
    *(f"tests/extractor/{room}" for room in ("layout", "image", "cells", "numbering", "track")),
)
# Files that tests open; none of cmpdesign, so that the installed package is imported.
BESIDE = ("pyproject.toml", "README.md")
NEED_EXTRAS = ("tests/cmpdesign/files/test_earlier_files.py",)  # builds every product
# Signals, links, pipes and locks of POSIX.
NEED_POSIX = ("tests/cmpdesign/files", "tests/cmpdesign/inputs")


def main(options: list[str]) -> int:
    """Pytest's exit code."""
    rooms = [room for room in ROOMS if sys.platform != "win32" or room not in NEED_POSIX]
    unready = sorted(name for room in rooms for name in _unready(ROOT / room))
    for name in unready:
        print(f"left out, because it imports modules that are not installed: {name}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("tests", "templates"):
            shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
        for file in BESIDE:
            shutil.copy(ROOT / file, folder / file)
        ignored = [f"--ignore={file}" for file in (*NEED_EXTRAS, *unready)]
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *ignored, *rooms, *options]
        return subprocess.run(command, cwd=folder, check=False).returncode


def _unready(room: Path) -> Iterator[str]:
    """The test files of a room that cannot be imported here."""
    for path in sorted(room.rglob("test_*.py")):
        if not all(map(_is_installed, _modules(path, set()))):
            yield path.relative_to(ROOT).as_posix()


def _modules(path: Path, seen: set[Path]) -> Iterator[str]:
    """The modules that a file of the tests imports, through their helpers, too."""
    seen.add(path)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            helper = (ROOT / name.replace(".", "/")).with_suffix(".py")
            if not name.startswith("tests."):
                yield name.partition(".")[0]
            elif helper.is_file() and helper not in seen:
                yield from _modules(helper, seen)


def _is_installed(module: str) -> bool:
    return module not in ("benchmarks", "docs", "tools") and importlib.util.find_spec(module) is not None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
