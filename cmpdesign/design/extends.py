"""Design files that extend another design: ``extends = "tac3d"``, or the path of a file.

The fields of the file replace the fields of the extended design, table by table. The text "none" removes a field
of the extended design, as after ``--set``. ``name``, ``description`` and ``source`` describe one file and are
not passed on.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.design.templates import find_design, templates
from cmpdesign.errors import DesignError, InputError
from cmpdesign.inputs.documents import read_toml

FIELD = "extends"
OWN_FIELDS = ("name", "description", "source")
MAX_FILES = 20  # of a chain; the longest useful chain has three or four
REMOVED = "none"


def read_design_file(path: Path) -> dict[str, Any]:
    """The document of a design file, with the fields of all designs that the file extends.

    Args:
        path: the TOML file. A path after ``extends`` is relative to the folder of its file.

    Raises:
        DesignError: a file cannot be read or is no TOML, ``extends`` is no text, names no design, or leads back to a
            file of the chain.
    """
    chain: list[Path] = []
    documents: list[dict[str, Any]] = []
    following: Path | None = path
    while following is not None:
        if any(_is_same(following, earlier) for earlier in chain):
            loop = " -> ".join(map(str, (*chain, following)))
            raise DesignError(f"{path}: extends leads in a circle: {loop}; remove one of the lines")
        if len(chain) == MAX_FILES:
            raise DesignError(f"{path}: extends leads through more than {MAX_FILES} files; shorten the chain")
        chain.append(following)
        document = _read(following)
        documents.append(document)
        following = _extended(document.pop(FIELD, None), following)
    merged = documents.pop()
    while documents:
        for name in OWN_FIELDS:
            merged.pop(name, None)
        merged = _merge(merged, documents.pop())
    return merged


def require_extended(value: str, path: Path) -> None:
    """Check that ``extends = value`` can stand in a file at ``path``, which need not exist.

    Raises:
        DesignError: the value names no design, or the design that it names cannot be read.
    """
    named = _extended(value, path)
    assert named is not None
    if _is_same(named, path):
        raise DesignError(f"{path}: extends itself; name another design")
    read_design_file(named)


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except InputError as error:
        raise DesignError(str(error)) from None


def _extended(value: object, path: Path) -> Path | None:
    """The file that ``extends`` names in the file at ``path``."""
    if value is None:
        return None
    if not isinstance(value, str) or not value:
        raise DesignError(
            f'{path}: {FIELD} = {value!r:.60} must be a name or a path, as in {FIELD} = "tac3d"'
        )
    try:
        return find_design(value if value in templates() else path.parent / value)
    except DesignError:
        known = ", ".join(templates())
        raise DesignError(
            f"{path}: {FIELD} = {value!r} is no template and no file beside it; templates are {known}"
        ) from None


def _is_same(one: Path, other: Path) -> bool:
    return one.resolve() == other.resolve()


def _merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of both documents; fields of ``above`` have priority, also within tables."""
    merged = dict(below)
    for name, value in above.items():
        if value == REMOVED:
            merged.pop(name, None)
        elif isinstance(value, Mapping):
            inner = below.get(name)
            merged[name] = _merge(inner if isinstance(inner, Mapping) else {}, value)
        else:
            merged[name] = value
    return merged
