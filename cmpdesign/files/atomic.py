"""Atomic writing of files: a complete file is written next to its place, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from cmpdesign.errors import OutputError


def write_file(path: str | Path, content: str | bytes) -> None:
    """Write text (UTF-8, "\\n") or bytes; an earlier file stays until the new file is complete.

    Raises:
        OutputError: the file cannot be written; an earlier file is unchanged.
    """
    path = Path(path)
    with _as_output_error(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        _require_no_folder(path)
        with tempfile.TemporaryDirectory(prefix=".cmpdesign-", dir=path.parent) as stage:
            staged = Path(stage) / path.name
            _write_and_sync(staged, content)
            staged.replace(path)


def write_folder(folder: str | Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """Write several files into a folder: all are complete on disk before the first one is renamed into place.

    Args:
        folder: made if missing.
        files: name -> content; sub-folders in a name ("laser/1-red.svg") are made.

    Returns:
        The paths in the order of ``files``.

    Raises:
        OutputError: a file cannot be written; no file has been replaced.
    """
    folder = Path(folder)
    paths = [folder / name for name in files]
    with _as_output_error(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for path in paths:
            _require_no_folder(path)
        with tempfile.TemporaryDirectory(prefix=".cmpdesign-", dir=folder) as stage:
            for number, content in enumerate(files.values()):
                _write_and_sync(Path(stage) / str(number), content)
            for path in paths:
                path.parent.mkdir(parents=True, exist_ok=True)
            for number, path in enumerate(paths):
                (Path(stage) / str(number)).replace(path)
    return paths


def _write_and_sync(path: Path, content: str | bytes) -> None:
    """Write and sync, so that a full disk raises an error here and not after the rename.

    Half a surrogate pair, from a path whose bytes are not UTF-8, is written as in JSON: backslash, u, four digits.
    """
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _require_no_folder(path: Path) -> None:
    if path.is_dir():
        raise IsADirectoryError(21, "is a folder; give a file's name", str(path))


@contextmanager
def _as_output_error(path: Path) -> Iterator[None]:
    try:
        yield
    except OutputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:  # also a NUL in the path, or a loop of links
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{path}: cannot be written ({reason}); nothing was changed") from error
