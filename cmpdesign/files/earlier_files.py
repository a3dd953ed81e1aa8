"""Files that an earlier build left in a product's folder and this one no longer makes: they are taken away.

Each folder that a build fills holds a list of what was written, with digests. Only what is on the list and still as
it was written is removed: nothing of the user's, and nothing that was changed since.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath

LIST_NAME = ".cmpdesign-files.json"


def files_with_lists(files: Mapping[str, str | bytes], folders: Iterable[str]) -> dict[str, str | bytes]:
    """The files, and in each of these folders that they fill the list of those in it.

    Args:
        files: path relative to the output folder, with "/" -> content.
        folders: products' folders, as "mold/".
    """
    result = dict(files)
    for folder in folders:
        made = {
            path.removeprefix(folder): _content_digest(data)
            for path, data in files.items()
            if path.startswith(folder)
        }
        if made:
            document = {"format": "cmp-files", "version": 1, "sha256": dict(sorted(made.items()))}
            result[folder + LIST_NAME] = json.dumps(document, indent=1) + "\n"
    return result


def find_stale_files(output: Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """What earlier builds' lists name, this build does not make, and nobody has changed.

    Args:
        output: the output folder, before this build is written.
        files: this build's, with its lists.
    """
    found = []
    for name in files:
        if PurePosixPath(name).name != LIST_NAME:
            continue
        folder = (output / name).parent
        kept = {output / other for other in files}
        for path, digest in _read_file_list(output / name).items():
            stale = folder / path
            if stale not in kept and _is_below(stale, folder) and _is_unchanged(stale, digest):
                found.append(stale)
    return sorted(found)


def remove_files(paths: Iterable[Path]) -> list[Path]:
    """Remove files, and their folders where that leaves them empty; those that went."""
    removed = []
    for path in paths:
        # What cannot be removed stays; it does no harm.
        with suppress(OSError):
            path.unlink()
            removed.append(path)
            path.parent.rmdir()
    return removed


def _read_file_list(path: Path) -> dict[str, str]:
    """An earlier list; none where there is none, or one that cannot be understood."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if (document["format"], document["version"]) != ("cmp-files", 1):
            return {}
        return {str(name): str(digest) for name, digest in document["sha256"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _is_below(path: Path, folder: Path) -> bool:
    """A list may have been edited: nothing outside its folder is touched, nor through links."""
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
