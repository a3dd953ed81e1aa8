"""The conditions of measured figures, machine and versions, and the writing of a benchmark's results."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cmpdesign.files.atomic import write_file

PACKAGES = ("numpy", "opencv-contrib-python-headless", "numba", "scipy")


def processor_name() -> str:
    """The processor's name, as reported by the system."""
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
    conditions = {
        "cpu": f"{processor_name()}, {os.cpu_count()} cores, load {load}",
        "system": f"{platform.system()} {platform.machine()}",
    }
    conditions["python"] = platform.python_version()
    return conditions | {name: version(name) for name in PACKAGES}


def conditions_text(conditions: Mapping[str, str] | None = None) -> str:
    """The given or the present conditions on one line, for a table's caption."""
    conditions = conditions or machine_conditions()
    packages = ", ".join(f"{name.partition('-')[0]} {conditions[name]}" for name in PACKAGES)
    return f"{conditions['cpu']}; {conditions['system']}; Python {conditions['python']}, {packages}"


def null_for_nan(value: Any) -> Any:
    """The value with None for every float that JSON has no text for: NaN and infinities, in lists and mappings, too."""
    if isinstance(value, Mapping):
        return {key: null_for_nan(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [null_for_nan(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, results: Mapping[str, Any]) -> None:
    """Write conditions and results to a file, completely or not at all; NaN as null."""
    write_file(
        path, json.dumps({"conditions": machine_conditions(), **null_for_nan(results)}, indent=1) + "\n"
    )
