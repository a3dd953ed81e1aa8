"""Search for files of another design in a folder that a build has written into."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cmpdesign.errors import InputError
from cmpdesign.files.earlier_files import LIST_NAME
from cmpdesign.inputs.documents import read_json


def find_other_designs(output: Path, folders: Iterable[str], digest: str, pattern: str) -> list[Path]:
    """Find the files that belong to another layout than the layout with this digest.

    The function reads ``layout.json``, ``as-made/*.json`` and the lists of files in the products' folders.

    Args:
        output: the output folder, after the files of a build are written.
        folders: products' folders, as "mold/".
        digest: digest of the layout.
        pattern: digest of the pattern, as in the lists of files.

    Returns:
        Sorted files, and folders for files of a product.
    """
    stated = {output / "layout.json": _value(output / "layout.json", "digest")}
    stated |= {path: _value(path, "as_made", "of") for path in (output / "as-made").glob("*.json")}
    lists = {output / folder: _value(output / folder / LIST_NAME, "pattern") for folder in folders}
    others = [path for path, design in stated.items() if design and design != digest]
    return sorted(others + [path for path, own in lists.items() if own and own != pattern])


def _value(path: Path, *names: str) -> str:
    """The text at a path of names in a JSON file; empty without such a file or text."""
    try:
        value: Any = read_json(path)
        for name in names:
            value = value[name]
    except (InputError, KeyError, TypeError):
        return ""
    return value if isinstance(value, str) else ""
