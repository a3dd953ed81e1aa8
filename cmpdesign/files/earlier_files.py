"""Removal of files that an earlier build wrote and this build does not make.

The output folder and each product's folder have a list of the written files with digests. Only files on a list with an
unchanged digest are removed, so files of the user and changed files are kept. A list also names the pattern of its
files: where a build makes another pattern, all files of the earlier pattern are removed, because files of two patterns
do not fit together.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Literal

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import read_file, read_text
from cmpdesign.inputs.records import Digest, Record, parse_record

LIST_NAME = ".cmpdesign-files.json"


class _FileList(Record):
    """A list of files: digests by name, and the digest of the pattern (None where the list names none)."""

    format: Literal["cmp-files"] = "cmp-files"
    version: Literal[1] = 1
    pattern: Digest | None = None
    sha256: dict[str, Digest]

    def to_json(self) -> str:
        document = self.model_dump(exclude_none=True)
        return json.dumps(document | {"sha256": dict(sorted(self.sha256.items()))}, indent=1) + "\n"


def files_with_lists(
    files: Mapping[str, str | bytes], folders: Iterable[str], output: Path | None = None, pattern: str = ""
) -> dict[str, str | bytes]:
    """Add the list of files of every product's folder that has files, and that of the output folder.

    Args:
        files: path relative to the output folder, with "/" -> content.
        folders: products' folders, as "mold/".
        output: the output folder; its list keeps the files that an earlier build of the same pattern wrote. None: no
            list is made for files outside the products' folders.
        pattern: digest of the pattern, if known.

    Returns:
        The files and the lists.
    """
    folders, result = list(folders), dict(files)
    for folder in folders:
        digests = {
            path.removeprefix(folder): _content_digest(data)
            for path, data in files.items()
            if path.startswith(folder)
        }
        if digests:
            result[folder + LIST_NAME] = _FileList(sha256=digests, pattern=pattern or None).to_json()
    if output is not None:
        earlier = _read_file_list(output / LIST_NAME)
        kept = earlier.sha256 if (earlier.pattern or "") == pattern else {}
        own = {
            path: _content_digest(data) for path, data in files.items() if not path.startswith(tuple(folders))
        }
        result[LIST_NAME] = _FileList(sha256={**kept, **own}, pattern=pattern or None).to_json()
    return result


def find_stale_files(
    output: Path, files: Mapping[str, str | bytes], folders: Iterable[str] = (), pattern: str = ""
) -> list[Path]:
    """Find unchanged files on earlier lists that this build does not make.

    In the folder of a product that this build writes, all such files; in other folders, files of another pattern.

    Args:
        output: the output folder, before the files of this build are written.
        files: files of this build with lists, from ``files_with_lists``.
        folders: products' folders, as "mold/".
        pattern: digest of the pattern, if known.

    Returns:
        Sorted paths.
    """
    current = {output / name for name in files}
    written = [str(PurePosixPath(name).parent) for name in files if name.endswith("/" + LIST_NAME)]
    found = []
    for name in dict.fromkeys(("", *written, *(folder.rstrip("/") for folder in folders))):
        folder = output / name
        earlier = _read_file_list(folder / LIST_NAME)
        is_other = bool(pattern and earlier.pattern) and earlier.pattern != pattern
        if name not in written and not is_other:
            continue
        found += [
            path
            for path, digest in ((folder / listed, digest) for listed, digest in earlier.sha256.items())
            if path not in current and _is_below(path, folder) and _is_unchanged(path, digest)
        ]
        if folder / LIST_NAME not in current:
            found.append(folder / LIST_NAME)
    return sorted(found)


def remove_files(paths: Iterable[Path]) -> list[Path]:
    """Remove files, and folders that become empty; the removed files."""
    removed = []
    for path in paths:
        # A file that cannot be removed does no harm.
        with suppress(OSError):
            path.unlink()
            removed.append(path)
            for parent in path.parents:
                parent.rmdir()
    return removed


def _read_file_list(path: Path) -> _FileList:
    """An earlier list; an empty list if there is no valid list."""
    try:
        return parse_record(read_text(path), str(path), _FileList)
    except InputError:
        return _FileList(sha256={})


def _is_below(path: Path, folder: Path) -> bool:
    """True if the path lies below the folder without links; an edited list may name other paths."""
    try:
        return path.is_relative_to(folder) and path.resolve() == folder.resolve() / path.relative_to(folder)
    except (OSError, ValueError, RuntimeError):  # too long, a NUL, a loop of links
        return False


def _is_unchanged(path: Path, digest: str) -> bool:
    try:
        return _content_digest(read_file(path)) == digest
    except InputError:
        return False


def _content_digest(content: str | bytes) -> str:
    return hashlib.sha256(
        content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    ).hexdigest()
