"""Search for files of another design in a folder that a build has written into."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cmpdesign.files.earlier_files import LIST_NAME


def find_other_designs(output: Path, folders: Iterable[str], digest: str) -> list[Path]:
    """Find what belongs to another layout than the one with this digest.

    Looked at are ``layout.json``, ``as-made/*.json`` and the lists of files in the products' folders.

    Args:
        output: the output folder, after the files of a build are written.
        folders: products' folders, as "mold/".
        digest: digest of the layout.

    Returns:
        Sorted files, and folders for files of a product.
    """
    stated = {output / "layout.json": _value(output / "layout.json", "digest")}
    stated |= {path: _value(path, "as_made", "of") for path in (output / "as-made").glob("*.json")}
    stated |= {output / folder: _value(output / folder / LIST_NAME, "design") for folder in folders}
    return sorted(path for path, design in stated.items() if design and design != digest)


def _value(path: Path, *names: str) -> str:
    """The text at a path of names in a JSON file; empty without such a file or text."""
    try:
        value: Any = json.loads(path.read_text(encoding="utf-8"))
        for name in names:
            value = value[name]
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return value if isinstance(value, str) else ""
