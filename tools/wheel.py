"""Builds a wheel that runs on other machines: for Linux systems since 2018 (glibc 2.28), without a local compiler.

    python -m tools.wheel [--processor x86_64|aarch64] [--folder dist]

The compiler is that of the package ziglang, which is installed into this environment where it is missing.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
GLIBC = (2, 28)
PROCESSORS = ("x86_64", "aarch64")


def build_wheel(processor: str, folder: Path) -> Path:
    """Build the wheel for a processor of ``PROCESSORS`` into a folder, and return its path.

    Raises:
        subprocess.CalledProcessError: the build failed; its output was printed.
    """
    if importlib.util.find_spec("ziglang") is None:
        _run(sys.executable, "-m", "pip", "install", "--quiet", "ziglang")
    environment = {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "CMAKE_TOOLCHAIN_FILE": str(ROOT / "cmake" / "zig.cmake"),
        "ZIG_TARGET": f"{processor}-linux-gnu.{'.'.join(map(str, GLIBC))}",
        "SETUPTOOLS_EXT_SUFFIX": sysconfig.get_config_var("EXT_SUFFIX").replace(
            platform.machine(), processor
        ),
    }
    tag = f"manylinux_{GLIBC[0]}_{GLIBC[1]}_{processor}"
    options = ["--no-deps", "--no-build-isolation", f"--config-settings=build-dir=build/{tag}"]
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as made:
        pip_wheel = (
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--quiet",
            *options,
            "--wheel-dir",
            made,
            str(ROOT),
        )
        _run(*pip_wheel, **environment)
        (native,) = Path(made).glob("*.whl")
        _run(sys.executable, "-m", "wheel", "tags", "--remove", "--platform-tag", tag, str(native))
        (tagged,) = Path(made).glob("*.whl")
        return tagged.replace(folder / tagged.name)


def _run(*command: str, **environment: str) -> None:
    subprocess.run(command, check=True, env={**os.environ, **environment})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tools.wheel", description=__doc__.split("\n")[0])
    parser.add_argument("--processor", choices=PROCESSORS, default=platform.machine())
    parser.add_argument("--folder", type=Path, default=ROOT / "dist")
    given = parser.parse_args()
    print(build_wheel(given.processor, given.folder))
