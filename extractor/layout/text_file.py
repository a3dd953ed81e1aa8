"""Opening of text files that others may have written: regular files of UTF-8, up to a stated size, without waiting."""

from __future__ import annotations

import os
import stat
from os import PathLike

from extractor.errors import ExtractorError

_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


def read_text_file(path: str | PathLike[str], most_bytes: int, error: type[ExtractorError]) -> str:
    """Read a regular file of UTF-8 text. The function does not wait for a pipe.

    Args:
        path: the file.
        most_bytes: limit of its size.
        error: the class of the errors that are raised; their messages begin with the path.

    Raises:
        ExtractorError: of the class ``error``: the file cannot be opened, is no regular file, is larger than the
            limit, or is not UTF-8.
    """
    data = read_bytes_file(path, most_bytes, error)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as problem:
        name = printable_path(path)
        raise error(f"{name}: byte {problem.start} is not UTF-8; expected a text file in UTF-8") from None


def read_bytes_file(
    path: str | PathLike[str], most_bytes: int, error: type[ExtractorError], expected: str = "a text file"
) -> bytes:
    """The bytes of a regular file; arguments and errors as of ``read_text_file``.

    Args:
        path, most_bytes, error: see ``read_text_file``.
        expected: what a smaller file would be, for the message.
    """
    name = printable_path(path)
    try:
        # Without O_NONBLOCK, opening a pipe waits until another process writes into it.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except OSError as problem:
        raise error(f"{name}: cannot be read: {problem.strerror}") from None
    except ValueError as problem:  # a NUL in the path, or characters that no path can hold
        raise error(f"{name}: cannot be read: {problem}") from None
    try:
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            found = os.fstat(descriptor)
            mode = found.st_mode
            kind = None if stat.S_ISREG(mode) else _KINDS.get(stat.S_IFMT(mode), "a device")
            # ``read`` allocates the requested number of bytes.
            data = b"" if kind else file.read(min(found.st_size, most_bytes) + 1)
    except OSError as problem:
        raise error(f"{name}: cannot be read: {problem.strerror}") from None
    finally:
        os.close(descriptor)
    if kind:
        raise error(f"{name}: cannot be read: it is {kind}; expected a regular file")
    if len(data) > most_bytes:
        raise error(f"{name}: larger than {most_bytes >> 20} MiB; expected {expected}")
    return data


def printable_path(path: str | PathLike[str]) -> str:
    """The path as text, with unprintable characters escaped."""
    text = os.fspath(path)
    return text if text.isprintable() else ascii(text)
