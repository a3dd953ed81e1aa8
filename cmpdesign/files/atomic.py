"""Atomic writing: files are complete on disk, in a folder of a random name, before they are renamed into place."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from cmpdesign.errors import OutputError
from cmpdesign.files.locks import Lock, open_for_lock, try_lock

STAGE_PREFIX = ".cmpdesign-"
REMOVALS, REMOVAL_WAIT_S = 40, 0.05  # of a folder that gets new files while it is removed
# Names that ``tempfile.mkdtemp`` makes from the prefix.
_STAGE_NAME = re.compile(re.escape(STAGE_PREFIX) + "[a-z0-9_]{8}")


class Stage:
    """A folder of a random name for files that are not complete; locked while its process lives.

    Stages of killed processes in the same place are removed first. No entry of a stage can be a link that
    another user made, because only this user may write into the stage.

    Attributes:
        folder: the folder.

    Args:
        parent: folder of the files to come, made if missing.

    Raises:
        OSError: the folder cannot be made.
    """

    def __init__(self, parent: Path) -> None:
        remove_abandoned_stages(parent)
        while True:
            self.folder = _new_folder(parent)
            self._descriptor = open_for_lock(self.folder)
            is_taken = self._descriptor is not None and try_lock(self._descriptor) is Lock.TAKEN
            # Before this lock, another process may have taken the folder for abandoned, and removes the folder.
            if not is_taken and self.folder.exists():
                return
            self.close()

    def commit(self, staged: Path, path: Path) -> None:
        """Flush a staged file or folder to disk, and rename it to its place.

        Raises:
            OSError: a full disk, for example; what is at the place is unchanged.
        """
        sync_file(staged)
        staged.replace(path)
        sync_folder(path.parent)

    def close(self) -> None:
        """Remove the folder and its content; threads of a library may still write into it for a moment."""
        for _ in range(REMOVALS):
            shutil.rmtree(self.folder, ignore_errors=True)
            if not self.folder.exists():
                break
            time.sleep(REMOVAL_WAIT_S)
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _new_folder(parent: Path) -> Path:
    """A new folder in ``parent``, which another process may remove while it is empty."""
    for _ in range(REMOVALS):
        with suppress(FileNotFoundError, FileExistsError):
            return _new_folder_at_once(parent)
    return _new_folder_at_once(parent)


def _new_folder_at_once(parent: Path) -> Path:
    parent.mkdir(parents=True, exist_ok=True)
    return Path(tempfile.mkdtemp(prefix=STAGE_PREFIX, dir=parent))


def remove_abandoned_stages(parent: Path) -> None:
    """Remove the stages of killed processes from a folder: stages of this user that no process has locked."""
    for path in _stages_in(parent):
        descriptor = open_for_lock(path)
        if descriptor is None:
            continue
        try:
            if _is_own(descriptor) and try_lock(descriptor) is Lock.HELD:
                shutil.rmtree(path, ignore_errors=True)
        finally:
            os.close(descriptor)


def _is_own(descriptor: int) -> bool:
    """True if an open file or folder belongs to the user; always true on Windows, which does not state the owner."""
    return sys.platform == "win32" or os.fstat(descriptor).st_uid == os.geteuid()


def _stages_in(parent: Path) -> list[Path]:
    try:
        with os.scandir(parent) as entries:
            return [
                Path(entry.path)
                for entry in entries
                if _STAGE_NAME.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False)
            ]
    except OSError:
        return []


@contextmanager
def staged_file(path: str | Path) -> Iterator[Path]:
    """Yield the path of a file to write; after the block, the file is flushed to disk and renamed to ``path``.

    An error within the block leaves the file at ``path`` unchanged, and no other file.

    Raises:
        OSError: the file cannot be written; its folder is missing.
    """
    path = Path(path)
    path.parent.stat()
    _require_no_folder(path)
    with Stage(path.parent) as stage:
        staged = stage.folder / f"staged{path.suffix}"
        yield staged
        stage.commit(staged, path)


def write_file(path: str | Path, content: str | bytes) -> None:
    """Write text (UTF-8, "\\n") or bytes; an earlier file stays until the new file is complete.

    Raises:
        OutputError: the file cannot be written; an earlier file is unchanged.
    """
    path = Path(path)
    with _as_output_error(path):
        _require_no_folder(path)
        with Stage(path.parent) as stage:
            staged = stage.folder / "staged"
            staged.write_bytes(_to_bytes(content))
            stage.commit(staged, path)


def write_new_file(path: str | Path, content: str | bytes) -> bool:
    """Write a file as ``write_file`` does, unless another process has made it: of two processes, one gets False.

    Raises:
        OutputError: the file cannot be written.
    """
    path = Path(path)
    with _as_output_error(path), Stage(path.parent) as stage:
        staged = stage.folder / "staged"
        staged.write_bytes(_to_bytes(content))
        sync_file(staged)
        try:
            os.link(staged, path)
        except FileExistsError:
            return False
        except OSError:  # a file system without a second name of a file
            if path.exists():
                return False
            staged.rename(path)
        sync_folder(path.parent)
    return True


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
        for path in paths:
            _require_no_folder(path)
        with Stage(folder) as stage:
            for number, content in enumerate(files.values()):
                staged = stage.folder / str(number)
                staged.write_bytes(_to_bytes(content))
                sync_file(staged)
            for path in paths:
                path.parent.mkdir(parents=True, exist_ok=True)
            for number, path in enumerate(paths):
                (stage.folder / str(number)).replace(path)
            for parent in dict.fromkeys(path.parent for path in paths):
                sync_folder(parent)
    return paths


def sync_file(path: Path) -> None:
    """Flush a file, or all files of a folder, to disk, so that a full disk is an error before a rename.

    Raises:
        OSError: not all data is on disk.
    """
    if path.is_dir():
        for inner in path.iterdir():
            sync_file(inner)
        sync_folder(path)
        return
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def sync_folder(path: Path) -> None:
    """Flush the names in a folder to disk, where the system can: a rename is then kept after a loss of power."""
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _to_bytes(content: str | bytes) -> bytes:
    """The bytes of a file.

    Half a surrogate pair, from a path whose bytes are not UTF-8, is written as in JSON: backslash, u, four digits.
    """
    return content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content


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
