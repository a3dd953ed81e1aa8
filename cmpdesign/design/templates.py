"""Search for templates: beside the package in a checkout, inside the package when installed."""

from __future__ import annotations

from pathlib import Path

from cmpdesign.errors import DesignError
from cmpdesign.inputs.files import path_exists
from cmpdesign.inputs.names import nearest_name


def templates_folder() -> Path:
    """The folder that holds the templates.

    Raises:
        DesignError: the installation has no templates.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "templates", package.parent / "templates"):
        if folder.is_dir():
            return folder
    raise DesignError(f"no templates beside {package}; install cmpdesign again")


def templates() -> dict[str, Path]:
    """Every design template by name, in alphabetical order."""
    return {path.stem: path for path in sorted(templates_folder().glob("*.toml"))}


def scene_templates() -> dict[str, Path]:
    """Every scene template by name, in alphabetical order."""
    return {path.stem: path for path in sorted((templates_folder() / "scenes").glob("*.toml"))}


def find_design(name_or_path: str | Path) -> Path:
    """The TOML file of a design template's name or of a path.

    Raises:
        DesignError: neither a template nor a file.
    """
    return _find_template(name_or_path, templates())


def find_scene(name_or_path: str | Path) -> Path:
    """The TOML file of a scene template's name or of a path.

    Raises:
        DesignError: neither a template nor a file.
    """
    return _find_template(name_or_path, scene_templates())


def _find_template(name_or_path: str | Path, known: dict[str, Path]) -> Path:
    if str(name_or_path) in known:
        return known[str(name_or_path)]
    path = Path(name_or_path)
    if path_exists(path):
        return path
    if path.suffix or len(path.parts) > 1:
        raise DesignError(f"{name_or_path}: no such file")
    raise DesignError(
        f"{name_or_path}: no such template{nearest_name(name_or_path, known)}; there are {', '.join(known)}, "
        "or give a TOML file"
    )
