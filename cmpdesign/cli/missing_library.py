"""The message for a library that is not installed: what to install, from the package's own requirements."""

from __future__ import annotations

import re
import sys
from importlib.metadata import PackageNotFoundError, requires

# Distributions of another name than their module.
_DISTRIBUTIONS = {
    "OCP": "cadquery-ocp-novtk",
    "PIL": "pillow",
    "cv2": "opencv-contrib-python-headless",
    "foxglove": "foxglove-sdk",
    "rerun": "rerun-sdk",
}
_OWN = ("cmpdesign", "extractor")


def missing_library_text(error: ModuleNotFoundError) -> str | None:
    """One sentence with the remedy; None for a module that no requirement brings, which is a fault of the program."""
    module = (error.name or "").partition(".")[0]
    if not module or module in _OWN or module in sys.stdlib_module_names:
        return None
    wanted = _DISTRIBUTIONS.get(module, module)
    requirement = find_requirement(wanted)
    if requirement is None:
        return None
    return f"this needs {module}, which is not installed; install it with: pip install '{requirement}'"


def find_requirement(distribution: str) -> str | None:
    """What to give to pip for a distribution: "name>=1.0", or "cmpdesign[extra]" for one of an extra."""
    try:
        lines = requires("cmpdesign") or []
    except PackageNotFoundError:  # run from a copy of the sources
        return distribution
    for line in lines:
        specifier, _, marker = line.partition(";")
        name = re.split(r"[^A-Za-z0-9._-]", specifier.strip())[0]
        if name.replace("_", "-").lower() != distribution.replace("_", "-").lower():
            continue
        extra = re.search(r"extra\s*==\s*['\"]([^'\"]+)['\"]", marker)
        return f"cmpdesign[{extra[1]}]" if extra else specifier.replace(" ", "")
    return None
