"""The conditions of measured figures: machine, versions, compiler, and the seed that a commit gives."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import subprocess
from collections.abc import Mapping
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from cmpdesign.libraries import opencv_version

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("numpy", "opencv", "scipy")
NATIVE_MODULE = "extractor._native"
COMPILER_NOTE = re.compile(rb"(clang) version (\d+[.\d]*)|(GCC): \([^)]*\) (\d+[.\d]*)")  # in a module's file


def processor_name() -> str:
    """The processor's name, as reported by the system."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def compiler_name() -> str:
    """The compiler that the native module's file names, and its version, if the file names one."""
    module = find_spec(NATIVE_MODULE)
    data = Path(module.origin).read_bytes() if module and module.origin else b""
    # a module by clang also has the notes of the system's start files, which are by GCC
    found = sorted(b" ".join(filter(None, note)) for note in COMPILER_NOTE.findall(data))
    return found[-1].decode() if found else "unknown compiler"


def machine_conditions() -> dict[str, str]:
    """Machine, versions and compiler by name."""
    load = f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
    conditions = {
        "cpu": f"{processor_name()}, {os.cpu_count()} cores, load {load}",
        "system": f"{platform.system()} {platform.machine()}",
    }
    conditions["python"] = platform.python_version()
    versions = {name: opencv_version() if name == "opencv" else version(name) for name in PACKAGES}
    return conditions | versions | {"compiler": compiler_name()}


def conditions_text(conditions: Mapping[str, str] | None = None) -> str:
    """The given or the present conditions on one line, for a table's caption.

    Conditions of earlier measurements have no compiler, or the full name of OpenCV's distribution.
    """
    conditions = conditions or machine_conditions()
    by_name = {key.partition("-")[0]: text for key, text in conditions.items()}
    versions = [f"{name} {by_name[name]}" for name in PACKAGES]
    if "compiler" in conditions:
        versions.append(conditions["compiler"])
    return (
        f"{conditions['cpu']}; {conditions['system']}; Python {conditions['python']}, {', '.join(versions)}"
    )


def commit_seed(folder: Path = ROOT) -> int:
    """The seed that the hash of the folder's commit gives: no rule can be tuned to pictures of the next commit.

    Raises:
        ValueError: the folder is no part of a repository.
    """
    command = ["git", "-C", str(folder), "rev-parse", "HEAD"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        raise ValueError(f"{folder} is no git repository with a commit; give a seed with --seed") from None
    return seed_of_hash(result.stdout.strip())


def seed_of_hash(commit: str) -> int:
    """0 to 2**32 - 1, from a commit's hash."""
    return int.from_bytes(hashlib.sha256(commit.encode()).digest()[:4], "big")
