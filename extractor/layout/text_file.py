"""Opening of text files that others may have written: regular files of UTF-8, up to a stated size, without waiting."""

from __future__ import annotations

import os
import stat
from os import PathLike

from extractor.errors import ExtractorError

# First bytes of files that are given in place of a text by mistake -> what they are.
_BINARY = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture",
    b"BM": "a BMP picture",
    b"RIFF": "a picture or a video",
    b"\x1a\x45\xdf\xa3": "a video",
    b"PK\x03\x04": "a zip archive",
    b"\x93NUMPY": "a NumPy array",
}
_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


def read_text_file(
    path: str | PathLike[str],
    most_bytes: int,
    error: type[ExtractorError],
    expected: str = "a text file in UTF-8",
) -> str:
    """Read a regular file of UTF-8 text. The function does not wait for a pipe.

    Args:
        path: the file.
        most_bytes: limit of its size.
        error: the class of the errors that are raised; their messages begin with the path.
        expected: what another file would be, for the message.

    Raises:
        ExtractorError: of the class ``error``: the file cannot be opened, is no regular file, is larger than the
            limit, or is not UTF-8.
    """
    data = read_bytes_file(path, most_bytes, error, expected)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as problem:
        name = printable_path(path)
        kind = next((text for start, text in _BINARY.items() if data.startswith(start)), "")
        kind = kind or ("a video" if data[4:8] == b"ftyp" else "")
        what = f"is {kind}" if kind else f"byte {problem.start} is not UTF-8"
        raise error(f"{name}: {what}; expected {expected}") from None


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
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            kind = _KINDS.get(stat.S_IFMT(found.st_mode), "a device")
            raise error(f"{name}: cannot be read: it is {kind}; expected {expected}")
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            data = file.read(
                min(found.st_size, most_bytes) + 1
            )  # ``read`` allocates the requested number of bytes
    except OSError as problem:
        raise error(f"{name}: cannot be read: {problem.strerror}") from None
    finally:
        os.close(descriptor)
    if len(data) > most_bytes:
        raise error(f"{name}: larger than {most_bytes >> 20} MiB; expected {expected}")
    return data


def printable_path(path: str | PathLike[str]) -> str:
    """The path as text, with unprintable characters escaped."""
    text = os.fspath(path)
    return text if text.isprintable() else ascii(text)
