"""The unfinished table of a run: place, lock, and result of a recovery."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmpdesign.files.locks import open_for_lock, try_lock
from cmpdesign.libraries import extra

# Largest time between two flushes to disk, s: frames of this time are lost in a power cut.
FLUSH_S = 5.0


@dataclass(frozen=True)
class Recovered:
    """The result of a recovery.

    Attributes:
        frames: number of complete frames in the table; with 0, no table was written.
        problems: one sentence on each damaged chunk or frame and on each gap.
    """

    frames: int
    problems: tuple[str, ...] = ()


def part_path(path: Path) -> Path:
    """The place of a table's frames during the run."""
    return path.with_name(path.name + ".part")


def lock_folder(path: Path) -> int | None:
    """Lock a folder; return the descriptor that holds the lock until it is closed, where the system gives a
    descriptor.
    """
    descriptor = open_for_lock(path)
    if descriptor is not None:
        try_lock(descriptor)
    return descriptor


def release_lock(descriptor: int | None) -> None:
    """Close the descriptor of ``lock_folder``."""
    if descriptor is not None:
        os.close(descriptor)


def require_pyarrow() -> Any:
    """The module pyarrow, with pyarrow.parquet.

    Raises:
        MissingLibraryError: it is not installed.
    """
    with extra("parquet", "write .npz or .csv"):
        import pyarrow
        import pyarrow.parquet
    return pyarrow


def describe_gap(first: int, last: int | None) -> str:
    """The sentence on missing frames; ``last`` is None where their number is unknown."""
    if last is None:
        return f"frames from {first} on are lost"
    return f"frame {first} is lost" if first == last else f"frames {first} to {last} are lost"
