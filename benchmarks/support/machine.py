"""The conditions of a figure: which machine, which versions. And how a benchmark's results are handed out."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

PACKAGES = ("numpy", "opencv-contrib-python-headless", "numba", "scipy")


def processor_name() -> str:
    """The processor's name, as the system gives it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def machine_conditions() -> dict[str, str]:
    """Machine and versions by name."""
    load = f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
    found = {
        "cpu": f"{processor_name()}, {os.cpu_count()} cores, load {load}",
        "system": f"{platform.system()} {platform.machine()}",
    }
    found["python"] = platform.python_version()
    return found | {name: version(name) for name in PACKAGES}


def conditions_text(found: Mapping[str, str] | None = None) -> str:
    """The conditions, these or the present ones, on one line, for a table's caption."""
    found = found or machine_conditions()
    packages = ", ".join(f"{name.partition('-')[0]} {found[name]}" for name in PACKAGES)
    return f"{found['cpu']}; {found['system']}; Python {found['python']}, {packages}"


def write_json(path: Path, results: Mapping[str, Any]) -> None:
    """Conditions and results to a file, whole or not at all."""
    beside = path.with_name(path.name + ".part")
    beside.write_text(
        json.dumps({"conditions": machine_conditions(), **results}, indent=1) + "\n", encoding="utf-8"
    )
    beside.replace(path)
