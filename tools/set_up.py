"""Makes the environment .venv. Called by make, with the Python of the system; needs the standard library only.

    python3 tools/set_up.py base [--lock requirements.lock] [--zig]
    python3 tools/set_up.py dev [--lock requirements.lock]

``base``: what reads and draws, and both native modules, compiled in place. ``dev``: the extra [dev], for tests and
documentation. uv installs the packages where the package index has uv; otherwise pip does. Neither compiles bytecode:
Python does so when a module is first imported. Every step prints one line with its time and the size of .venv.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
# Beside .venv, whose packages are those of requirements.lock.
UV_FOLDER = ROOT / "build" / "uv"
PIP = (PYTHON, "-m", "pip", "install", "--quiet", "--no-compile", "--disable-pip-version-check")
OLDEST = (3, 11)
BUILD_NEEDS = ("scikit-build-core", "nanobind", "cmake", "ninja")
# For libraries of [dev] without a wheel of their own.
SOURCE_NEEDS = ("setuptools", "wheel")
# setuptools comes with the environment of Python 3.11. The other one comes from an older .venv: two distributions of
# OpenCV in one environment overwrite each other.
NOT_NEEDED = ("setuptools", "opencv-python-headless")
# Programs of the package cmake that no build starts: 44 MB.
NOT_STARTED = ("ctest", "cpack")


class SetUpError(Exception):
    """The environment cannot be made; the text names the remedy."""


def main() -> int:
    """Make the part of the environment that is asked for; 0, or 1 after one line on stderr."""
    parser = argparse.ArgumentParser(prog="set_up.py", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("part", choices=("base", "dev"))
    parser.add_argument("--lock", default="", help="file of the versions; without, the newest allowed")
    parser.add_argument("--zig", action="store_true", help="compile with the package ziglang")
    given = parser.parse_args()
    install = Installer([f"--constraint={given.lock}"] if given.lock else [])
    try:
        if given.part == "dev":
            install.packages(*SOURCE_NEEDS)
            step("libraries for tests and documentation", install.packages, *requirements("dev"))
        else:
            make_base(install, given.zig)
    except (SetUpError, subprocess.CalledProcessError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def make_base(install: Installer, zig: bool) -> None:
    """The environment, the build's tools, the libraries that each use needs, and the native modules."""
    require_python()
    print("Setting up .venv (once)", flush=True)
    step("environment", run, sys.executable, "-m", "venv", VENV)
    step("build tools", install_build_tools, install, zig)
    succeeds(PYTHON, "-m", "pip", "uninstall", "--yes", *NOT_NEEDED)
    step("libraries", install.packages, *requirements())
    step("native modules, compiled", install_editable, zig)


def install_build_tools(install: Installer, zig: bool) -> None:
    """What compiles, without the programs that only test and pack."""
    install.packages(*BUILD_NEEDS, *(["ziglang"] if zig else []))
    for name in NOT_STARTED:
        for path in VENV.glob(f"lib/*/site-packages/cmake/data/bin/{name}"):
            path.unlink()


def require_python() -> None:
    """Raises ``SetUpError`` where this Python is too old, or lacks what environments and native modules need."""
    if sys.version_info < OLDEST:
        raise SetUpError(
            f"{sys.executable} is Python {sys.version.split()[0]}; expected 3.11 or newer; "
            "call make PYTHON=/path/to/python3.11"
        )
    if not (Path(sysconfig.get_path("include")) / "Python.h").exists():
        raise SetUpError(f"the headers of {sys.executable} are missing; on Debian: apt install python3-dev")
    if find_spec("ensurepip") is None or find_spec("venv") is None:
        raise SetUpError(
            f"{sys.executable} cannot make virtual environments; on Debian: apt install python3-venv"
        )


class Installer:
    """Installs packages into .venv: with uv, or with pip where uv cannot be had or fails."""

    def __init__(self, options: list[str]) -> None:
        self._options = options
        self._uv: Path | str | None = None
        self._tried = False

    def packages(self, *names: str) -> None:
        """Install packages, none of them twice.

        Raises:
            subprocess.CalledProcessError: pip failed; its output was printed.
        """
        uv = self._found_uv()
        if uv and succeeds(uv, "pip", "install", "--quiet", "--python", PYTHON, *self._options, *names):
            return
        print(f"  {'uv failed' if uv else 'no uv'}: pip installs the packages, some minutes", flush=True)
        self._uv = None
        run(*PIP, *self._options, *names)

    def _found_uv(self) -> Path | str | None:
        if not self._tried:
            self._tried = True
            own = UV_FOLDER / "bin" / "uv"
            if shutil.which("uv"):
                self._uv = shutil.which("uv")
            elif own.exists() or succeeds(*PIP, "--only-binary=:all:", "--target", UV_FOLDER, "uv"):
                self._uv = own
        return self._uv


def requirements(extra: str = "") -> list[str]:
    """The requirements of pyproject.toml: of the package, or of one extra with the extras that this extra names."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    if not extra:
        return list(project["dependencies"])
    found: list[str] = []
    for requirement in project["optional-dependencies"][extra]:
        own = re.fullmatch(rf"{project['name']}\[(.+)\]", requirement)
        found += [one for name in own[1].split(",") for one in requirements(name)] if own else [requirement]
    return list(dict.fromkeys(found))


def install_editable(zig: bool) -> None:
    """Install this checkout, whose build compiles the native modules in place."""
    toolchain = {"CMAKE_TOOLCHAIN_FILE": str(ROOT / "cmake" / "zig.cmake")} if zig else {}
    environment = {**os.environ, **toolchain, "PATH": f"{VENV / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    run(*PIP, "--no-deps", "--no-build-isolation", "--editable", ROOT, env=environment)
    # Only the path: the build backend's finder would take the packages from here also in copies of the checkout.
    for path in VENV.glob("lib/*/site-packages/_editable_skbc_cmpdesign.pth"):
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        path.write_text("".join(line for line in lines if not line.startswith("import ")), encoding="utf-8")


def step(name: str, work: object, *arguments: object) -> None:
    """Do one step, and print its name, its time, and the size of .venv after it."""
    assert callable(work)
    begin = time.monotonic()
    work(*arguments)
    print(f"  {name:38s}{time.monotonic() - begin:5.0f} s {size_mb(VENV):6.0f} MB", flush=True)


def size_mb(folder: Path) -> float:
    """The size of a folder on disk, MB of 10^6 bytes; a file with two names counts once."""
    files = {}
    for path in folder.rglob("*"):
        status = path.lstat()
        files[status.st_dev, status.st_ino] = 512 * status.st_blocks
    return sum(files.values()) / 1e6


def succeeds(*command: object) -> bool:
    """Whether a command runs without error; its output is not shown."""
    return subprocess.run([str(word) for word in command], capture_output=True, check=False).returncode == 0


def run(*command: object, **options: dict[str, str]) -> None:
    """Run a command; raises ``CalledProcessError`` where the command fails."""
    subprocess.run([str(word) for word in command], check=True, **options)  # type: ignore[call-overload]


if __name__ == "__main__":
    sys.exit(main())
