"""Reading of .npz files that may be damaged."""

from __future__ import annotations

import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import open_file, require_size

_DAMAGE = (
    OSError, ValueError, TypeError, AttributeError, KeyError, EOFError, MemoryError, RecursionError,
    NotImplementedError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


class NpzError(CmpDesignError, ValueError):
    """A file that is no .npz, or whose checksums are wrong; the message states the cause, without the name."""


def read_npz(path: str | Path, *names: str, most_bytes: int | None = None) -> dict[str, NDArray[Any]]:
    """Read the named arrays of a file, or all arrays.

    Args:
        path: the file.
        names: names of arrays.
        most_bytes: limit of the file's size, if any.

    Raises:
        InputError: the file cannot be opened, is no regular file, or is larger than the limit.
        NpzError: the file is damaged, or holds objects other than arrays of plain values.
    """
    with open_file(path) as raw:
        if most_bytes is not None:
            require_size(raw, path, most_bytes)
        try:
            with warnings.catch_warnings(), np.load(raw, allow_pickle=False) as file:
                warnings.simplefilter("ignore")  # of the headers' style
                return {name: file[name] for name in names or file.files}
        except _DAMAGE as error:
            raise NpzError(str(error) or type(error).__name__) from None
