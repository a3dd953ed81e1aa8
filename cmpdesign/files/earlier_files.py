"""Removal of files that an earlier build wrote into a product's folder and this build does not make.

Each product's folder holds a list of the written files with digests. Only files on the list with an unchanged digest
are removed, so files of the user and changed files stay.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath

LIST_NAME = ".cmpdesign-files.json"


def files_with_lists(
    files: Mapping[str, str | bytes], folders: Iterable[str], design: str = ""
) -> dict[str, str | bytes]:
    """Add the list of files of every folder that has files.

    Args:
        files: path relative to the output folder, with "/" -> content.
        folders: products' folders, as "mold/".
        design: digest of the layout that the files belong to.

    Returns:
        The files and the lists.
    """
    result = dict(files)
    for folder in folders:
        digests = {
            path.removeprefix(folder): _content_digest(data)
            for path, data in files.items()
            if path.startswith(folder)
        }
        if digests:
            document = {
                "format": "cmp-files",
                "version": 1,
                "design": design,
                "sha256": dict(sorted(digests.items())),
            }
            result[folder + LIST_NAME] = json.dumps(document, indent=1) + "\n"
    return result


def find_stale_files(output: Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """Find unchanged files that are on earlier lists and that this build does not make.

    Args:
        output: the output folder, before the files of this build are written.
        files: files of this build with lists, from ``files_with_lists``.

    Returns:
        Sorted paths.
    """
    found = []
    for name in files:
        if PurePosixPath(name).name != LIST_NAME:
            continue
        folder = (output / name).parent
        current = {output / other for other in files}
        for listed, digest in _read_file_list(output / name).items():
            path = folder / listed
            if path not in current and _is_below(path, folder) and _is_unchanged(path, digest):
                found.append(path)
    return sorted(found)


def remove_files(paths: Iterable[Path]) -> list[Path]:
    """Remove files, and folders that become empty; the removed files."""
    removed = []
    for path in paths:
        # A file that cannot be removed stays without harm.
        with suppress(OSError):
            path.unlink()
            removed.append(path)
            path.parent.rmdir()
    return removed


def _read_file_list(path: Path) -> dict[str, str]:
    """File name -> digest from an earlier list; empty without a valid list."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if (document["format"], document["version"]) != ("cmp-files", 1):
            return {}
        return {str(name): str(digest) for name, digest in document["sha256"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _is_below(path: Path, folder: Path) -> bool:
    """True if the path lies below the folder without links; an edited list may name other paths."""
    return (
        path.resolve() == folder.resolve() / path.relative_to(folder)
        if path.is_relative_to(folder)
        else False
    )


def _is_unchanged(path: Path, digest: str) -> bool:
    try:
        return path.is_file() and _content_digest(path.read_bytes()) == digest
    except OSError:
        return False


def _content_digest(content: str | bytes) -> str:
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()
