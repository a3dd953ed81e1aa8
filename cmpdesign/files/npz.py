"""Reading of .npz files that may be damaged."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError

_DAMAGE = (OSError, ValueError, TypeError, AttributeError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)


class NpzError(CmpDesignError, ValueError):
    """A file that cannot be read as .npz, or whose checksums are wrong; the message says why, without the name."""


def read_npz(path: str | Path, *names: str) -> dict[str, NDArray[Any]]:
    """Read the named arrays of a file, or all.

    Raises:
        NpzError: the file cannot be read, is damaged, or holds objects other than arrays of plain values.
    """
    try:
        # An own file, because numpy leaves its own one open after an error.
        with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            return {name: file[name] for name in names or file.files}
    except _DAMAGE as error:
        raise NpzError(str(error) or type(error).__name__) from None
