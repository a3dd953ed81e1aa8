"""A copy of the packages in which texts of sources are replaced and native modules are built anew."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from benchmarks.frame.conditions import ROOT

PACKAGES = ("extractor", "cmpdesign")
NATIVE_SUFFIXES = (".cpp", ".hpp")
READER_MODULE = "extractor_native"  # the target of cmake/CMakeLists.txt
CMAKE_OPTIONS = ("-DSKBUILD_STATE=editable", f"-DPython_EXECUTABLE={sys.executable}")


class Replacement(NamedTuple):
    """A change of one source: the file, relative to the checkout, a text that occurs in it once, and the new text."""

    file: str
    text: str
    new: str

    @property
    def is_native(self) -> bool:
        return self.file.endswith(NATIVE_SUFFIXES)


def replaced_text(text: str, change: Replacement) -> str:
    """The text of a file after the change.

    Raises:
        ValueError: the text to be replaced does not occur exactly once.
    """
    count = text.count(change.text)
    if count != 1:
        raise ValueError(f"{change.file}: the text occurs {count} times, not once: {change.text!r}")
    return text.replace(change.text, change.new)


def environment(folder: Path) -> dict[str, str]:
    """The environment of a process that imports the packages of a folder and the benchmarks of this checkout.

    No bytecode is written: bytecode of a text that is replaced and restored within a second would be taken for valid.
    """
    path = os.pathsep.join((str(folder), str(ROOT)))
    return {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}


class CodeCopy:
    """A copy of the packages, at first with the native modules of this checkout.

    Attributes:
        folder: holds the packages, ``cmake`` and the build tree.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for package in PACKAGES:
            shutil.copytree(ROOT / package, folder / package)
        (folder / "cmake").mkdir()
        shutil.copy2(ROOT / "cmake" / "CMakeLists.txt", folder / "cmake")
        self._tree = folder / "tree"

    def build(self) -> None:
        """Build the reader's native module from the copied sources; later builds compile changed files only.

        Raises:
            RuntimeError: the build failed.
        """
        if not (self._tree / "build.ninja").exists():
            places = "-S", str(self.folder / "cmake"), "-B", str(self._tree)
            self._run("cmake", *places, "-G", "Ninja", *CMAKE_OPTIONS)
        self._run("cmake", "--build", str(self._tree), "--target", READER_MODULE)

    @contextmanager
    def replaced(self, changes: Iterable[Replacement]) -> Iterator[None]:
        """Replace texts within the context. A native module that was built always corresponds to the texts.

        Raises:
            ValueError: a text to be replaced does not occur exactly once.
            RuntimeError: the build failed.
        """
        before: dict[Path, str] = {}
        is_native = self._tree.exists()
        try:
            for change in changes:
                path = self.folder / change.file
                text = path.read_text(encoding="utf-8")
                new = replaced_text(text, change)
                before.setdefault(path, text)
                path.write_text(new, encoding="utf-8")
                is_native |= change.is_native
            if is_native:
                self.build()
            yield
        finally:
            for path, text in before.items():
                path.write_text(text, encoding="utf-8")

    def _run(self, *command: str) -> None:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        result = subprocess.run(
            command, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False
        )
        if result.returncode != 0:
            raise RuntimeError(f"{' '.join(command)}: {(result.stdout + result.stderr)[-4000:]}")
