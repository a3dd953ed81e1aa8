"""Runs the reader's tests and attacks on it with native modules that check every index, address and operation.

    python -m tools.sanitized [arguments of pytest]

The modules are built into a copy of the packages (build/sanitized), with the compiler's AddressSanitizer and
UndefinedBehaviorSanitizer. It needs g++ or clang++ with their runtime libraries.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPY = ROOT / "build" / "sanitized"
PARTS = ("extractor", "cmpdesign", "tests", "templates", "docs", "benchmarks", "tools", "examples")
FILES = ("pyproject.toml", "README.md", "CHANGELOG.md")
TESTS = ("tests/extractor", "tests/cmpdesign/scene")
# With their slow tests: 2,000 layouts edited in memory, and 2,000 pictures.
ATTACKS = ("tests/attack/test_edited_layouts.py", "tests/attack/test_images.py")


def copy_sources() -> None:
    """Copy the checkout's sources without built modules."""
    shutil.rmtree(COPY, ignore_errors=True)
    for part in PARTS:
        shutil.copytree(ROOT / part, COPY / part, ignore=shutil.ignore_patterns("_native.*", "__pycache__"))
    (COPY / "cmake").mkdir()
    for file in (ROOT / "cmake").glob("CMakeLists.txt"):
        shutil.copy2(file, COPY / "cmake")
    for name in FILES:
        shutil.copy2(ROOT / name, COPY)


def build() -> None:
    """Build the native modules in the copy."""
    tree = COPY / "tree"
    configure = ["cmake", "-S", str(COPY / "cmake"), "-B", str(tree), "-G", "Ninja", "-DCMP_SANITIZED=ON"]
    run(*configure, "-DSKBUILD_STATE=editable", f"-DPython_EXECUTABLE={sys.executable}")
    run("cmake", "--build", str(tree))


def run(*command: str, **environment: str) -> None:
    """Run a command in the copy; raises ``CalledProcessError`` where the command fails."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(command, check=True, cwd=COPY, env={**os.environ, "PATH": path, **environment})


def library(name: str) -> str:
    """The path of a runtime library of the compiler."""
    command = [os.environ.get("CXX", "g++"), f"-print-file-name={name}"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def main(arguments: list[str]) -> int:
    copy_sources()
    build()
    preloaded = f"{library('libasan.so')} {library('libstdc++.so')}"
    try:
        for chosen in [arguments] if arguments else [TESTS, ("-m", "", *ATTACKS)]:
            run(
                *(sys.executable, "-m", "pytest", "-n", "2", *chosen),
                LD_PRELOAD=preloaded,
                ASAN_OPTIONS="detect_leaks=0:allocator_may_return_null=1",
            )
    except subprocess.CalledProcessError as error:
        return error.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
