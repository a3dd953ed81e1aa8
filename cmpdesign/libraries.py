"""Libraries that may be missing. Each library belongs to an extra; a missing library gives one line with the install
command.

Modules import such a library where they first use it, within ``with extra("laser"):``.
"""

from __future__ import annotations

import json
import re
import shlex
import sys
from importlib.metadata import PackageNotFoundError, distribution, requires, version
from importlib.util import find_spec
from types import TracebackType
from urllib.parse import urlparse
from urllib.request import url2pathname

from cmpdesign.errors import CmpDesignError

# Extras and their purposes; pyproject.toml names the libraries.
EXTRAS = {
    "laser": "laser jobs and kerf coupons",
    "cad": "molds, STEP files, meshes",
    "print": "sheets to print",
    "evaluate": "contact, error bounds, size, experiments, plots",
    "parquet": "tables as Parquet",
    "video": "videos and network streams read",
    "recording": "recordings for ROS 2 and Foxglove",
    "export": "data sets for LeRobot and Diffusion Policy",
    "live": "frames shown in Foxglove during a run",
    "rerun": "recordings and a live view for Rerun",
    "data": "data sets for training",
    "dask": "data sets made by several machines",
    "studio": "the page in the browser",
}
# Distributions of another name than their module.
_DISTRIBUTIONS = {
    "OCP": "cadquery-ocp-novtk",
    "PIL": "pillow",
    "cv2": "opencv-contrib-python-headless",
    "foxglove": "foxglove-sdk",
    "rerun": "rerun-sdk",
}
# Distributions that bring OpenCV; the first is required. Each suffices; two in one environment overwrite each other.
OPENCV_DISTRIBUTIONS = (
    "opencv-contrib-python-headless",
    "opencv-python-headless",
    "opencv-python",
    "opencv-contrib-python",
)
_OWN = ("cmpdesign", "extractor")


class MissingLibraryError(CmpDesignError, ImportError):
    """A library of an extra that is not installed."""


class extra:
    """Within the block, a library that is not installed is a ``MissingLibraryError`` with the remedy.

    Args:
        name: the extra that brings the libraries, of ``EXTRAS``.
        instead: remedy without the libraries, as "write .csv".
    """

    __slots__ = ("_instead", "_name")

    def __init__(self, name: str, instead: str = "") -> None:
        self._name, self._instead = name, instead

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        module = _top_module(error) if isinstance(error, ModuleNotFoundError) else None
        if module is not None:
            other = f", or {self._instead}" if self._instead else ""
            raise MissingLibraryError(
                f"this needs {module} of the extra [{self._name}] ({EXTRAS[self._name]}), which is not installed; "
                f"install it with: {install_command(self._name)}{other}",
                name=module,
            ) from error


def require_libraries(name: str, *modules: str, instead: str = "") -> None:
    """Check that the modules of an extra are installed, before work that needs them.

    Raises:
        MissingLibraryError: a module is not installed.
    """
    with extra(name, instead):
        for module in modules:
            if find_spec(module) is None:
                raise ModuleNotFoundError(f"No module named {module!r}", name=module)


def install_command(name: str) -> str:
    """The command that installs an extra, from the source of this package's own installation."""
    source, options = _installed_from()
    wanted = f"{source}[{name}]"
    quoted = f'"{wanted}"' if sys.platform == "win32" else shlex.quote(wanted)
    return f"pip install {options}{quoted}"


def opencv_version() -> str:
    """Version of the installed distribution that brings OpenCV, of ``OPENCV_DISTRIBUTIONS``; "unknown" if none is."""
    for name in OPENCV_DISTRIBUTIONS:
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return "unknown"


def missing_library_text(error: ModuleNotFoundError) -> str | None:
    """One sentence with the remedy, for a library that every installation has.

    None for a module that no requirement contains, which is a fault of the program.
    """
    module = _top_module(error)
    if module is None or module in _OWN or module in sys.stdlib_module_names:
        return None
    requirement = _base_requirement(_DISTRIBUTIONS.get(module, module))
    if requirement is None:
        return None
    return f"this needs {module}, which is not installed; install it with: pip install '{requirement}'"


def _top_module(error: ModuleNotFoundError) -> str | None:
    """The package whose module was not found."""
    return (error.name or "").partition(".")[0] or None


def _base_requirement(name: str) -> str | None:
    """The argument of pip for a distribution that is required without an extra."""
    try:
        lines = requires("cmpdesign") or []
    except PackageNotFoundError:  # run from a copy of the sources
        return name
    for line in lines:
        specifier, _, marker = line.partition(";")
        found = re.split(r"[^A-Za-z0-9._-]", specifier.strip())[0]
        if not marker and found.replace("_", "-").lower() == name.lower():
            return specifier.replace(" ", "")
    return None


def _installed_from() -> tuple[str, str]:
    """The folder or wheel that this package was installed from, "." if unknown, and pip's options before it."""
    try:
        text = distribution("cmpdesign").read_text("direct_url.json")
        origin = json.loads(text) if text else {}
    except (PackageNotFoundError, ValueError):
        return ".", ""
    address = urlparse(str(origin.get("url", "")))
    if address.scheme != "file":
        return ".", ""
    editable = origin.get("dir_info", {}).get("editable", False)
    return url2pathname(address.path), "--editable " if editable else ""
