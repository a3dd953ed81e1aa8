"""Search for templates: beside the package in a checkout, inside the package when installed."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

from cmpdesign.errors import DesignError
from cmpdesign.inputs.documents import parse_toml
from cmpdesign.inputs.files import path_exists, read_text
from cmpdesign.inputs.names import nearest_name

KINDS = ("scenes", "plans", "machines", "materials", "silicones", "sensors")


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


def template_kinds() -> dict[str, dict[str, Path]]:
    """Every template: kind -> name -> file. The designs come first; the other kinds are folders of their name."""
    return {"designs": templates(), **{kind: _in_folder(kind) for kind in KINDS}}


def _in_folder(kind: str) -> dict[str, Path]:
    return {path.stem: path for path in sorted((templates_folder() / kind).glob("*.toml"))}


def find_template(name: str) -> tuple[str, Path]:
    """The kind and the file of a template by its name; "sensors/tac3d" names the kind, too.

    Without a kind, a design comes before a template of another kind.

    Raises:
        DesignError: no template has the name.
    """
    kind, slash, word = name.rpartition("/")
    every = template_kinds()
    for each, names in every.items():
        if word in names and (not slash or kind == each):
            return each, names[word]
    known = [*every["designs"], *(f"{each}/{word}" for each, names in every.items() for word in names)]
    raise DesignError(f"{name}: no such template{nearest_name(name, known)}; cmpdesign templates lists them")


class TemplateWords(NamedTuple):
    """A template's description and source."""

    description: str
    source: str


def template_words(path: Path) -> TemplateWords:
    """A template's own description, else its name, else the first sentence of its file; and its source.

    Raises:
        InputError: the file cannot be read.
    """
    text = read_text(path)
    document = parse_toml(text, str(path))
    comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
    beginning, stop, _ = " ".join(line.lstrip("# ") for line in comment).partition(". ")
    words = document.get("description") or document.get("name") or beginning + stop.strip()
    return TemplateWords(str(words), str(document.get("source", "")))


def scene_templates() -> dict[str, Path]:
    """Every scene template by name, in alphabetical order."""
    return _in_folder("scenes")


def plan_templates() -> dict[str, Path]:
    """Every plan template by name, in alphabetical order."""
    return _in_folder("plans")


def find_plan(name_or_path: str | Path) -> Path:
    """The TOML file of a plan template's name or of a path.

    Raises:
        DesignError: neither a template nor a file.
    """
    return _find_template(name_or_path, plan_templates())


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
