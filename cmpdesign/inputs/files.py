"""Opening of input files: regular files only, up to a stated size, without waiting."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from cmpdesign.errors import CmpDesignError, InputError, parameter

MAX_TEXT_BYTES = 1 << 24  # 16 MiB: of a document; the largest document that a command writes has some 3 MiB
MAX_PIXELS = 250_000_000  # of an image; A4 at 1200 dpi has 139 million
MAX_DATA_BYTES = 1 << 31  # 2 GiB: of an image or an array
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def require_suffix(name: str, path: str | Path | None, *expected: str) -> None:
    """Check the ending of the name of a file to write, if a file is given; the ending states the format.

    Args:
        name: the call's parameter.
        path: its value.
        expected: endings.

    Raises:
        CmpDesignError: another ending.
    """
    if path is not None and Path(path).suffix.lower() not in expected:
        one_of = "one of " if len(expected) > 1 else ""
        raise CmpDesignError(
            f"{parameter(name, str(path))}: unknown ending; expected {one_of}{', '.join(expected)}"
        )


def open_file(path: str | Path) -> BinaryIO:
    """Open a regular file for reading, in parts and at any place. The function does not wait for a pipe.

    Raises:
        InputError: the file cannot be opened, or is no regular file.
    """
    try:
        # Without O_NONBLOCK, opening a pipe waits until another process writes into it.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError) as error:  # ValueError: a NUL, or characters that no path can hold
        raise _unreadable(path, error) from None
    try:
        mode = os.fstat(descriptor).st_mode
        if not stat.S_ISREG(mode):
            kind = _KINDS.get(stat.S_IFMT(mode), "no file")
            raise InputError(f"{path}: cannot be read (it is {kind}); expected a regular file")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_file(path: str | Path, most_bytes: int = MAX_DATA_BYTES) -> bytes:
    """Read a regular file. The function does not wait for a pipe.

    Args:
        path: the file.
        most_bytes: limit of its size.

    Raises:
        InputError: the file cannot be opened, is no regular file, or is larger than the limit.
    """
    with open_file(path) as file:
        try:
            # ``read`` allocates the requested number of bytes.
            data = file.read(min(os.fstat(file.fileno()).st_size, most_bytes) + 1)
        except OSError as error:
            raise _unreadable(path, error) from None
    if len(data) > most_bytes:
        raise _too_large(path, most_bytes)
    return data


def require_size(file: BinaryIO, path: str | Path, most_bytes: int) -> None:
    """Check the size of an open file.

    Raises:
        InputError: the file is larger than the limit.
    """
    if os.fstat(file.fileno()).st_size > most_bytes:
        raise _too_large(path, most_bytes)


def read_text(path: str | Path, most_bytes: int = MAX_TEXT_BYTES) -> str:
    """Read a regular file of UTF-8 text.

    Raises:
        InputError: see ``read_file``; or the file is not UTF-8.
    """
    data = read_file(path, most_bytes)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no UTF-8 text (its byte {error.start} begins no character)") from None


def is_regular_file(path: str | Path) -> bool:
    """True for a regular file; False also for paths that no file can have: too long, with NUL, a loop of links."""
    try:
        return stat.S_ISREG(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False


def is_folder(path: str | Path) -> bool:
    """True for a folder; False also for paths that no folder can have."""
    try:
        return stat.S_ISDIR(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False


def path_exists(path: str | Path) -> bool:
    """True if a file or folder exists; False also for paths that no file can have."""
    try:
        Path(path).stat()
    except (OSError, ValueError):
        return False
    return True


def _unreadable(path: str | Path, error: OSError | ValueError) -> InputError:
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return InputError(f"{path}: cannot be read ({reason})")


def _too_large(path: str | Path, most_bytes: int) -> InputError:
    return InputError(f"{path} is larger than {_size_text(most_bytes)}, the limit for this kind of file")


def _size_text(count: int) -> str:
    return f"{count >> 30} GiB" if count >= 1 << 30 else f"{count >> 20} MiB"
