"""Chunks of frames as .npz files; each also holds the columns that all frames share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import InputError
from cmpdesign.files.atomic import staged_file
from cmpdesign.files.npz import read_npz
from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.sinks.unfinished import describe_gap

_ABOUT = "about."


@dataclass(frozen=True, eq=False)
class Chunk:
    """A complete chunk.

    Attributes:
        path: its file.
        frames: the numbers of its frames, (F,).
        kinds: column -> dtype and shape of one frame.
    """

    path: Path
    frames: NDArray[np.int64]
    kinds: dict[str, tuple[np.dtype[Any], tuple[int, ...]]]


@dataclass(frozen=True, eq=False)
class FoundChunks:
    """The chunks of a folder.

    Attributes:
        chunks: the complete chunks in order.
        about: the shared columns of the last complete chunk; None without a chunk.
        problems: one sentence on each damaged chunk and on each gap.
    """

    chunks: tuple[Chunk, ...]
    about: Columns | None
    problems: tuple[str, ...]


def save_chunk(path: Path, frames: Columns, about: Columns) -> None:
    """Write the columns of frames with the shared columns; the file is complete on disk or does not exist.

    Raises:
        OSError: the file cannot be written.
    """
    columns = frames | {_ABOUT + name: values for name, values in about.items()}
    with staged_file(path) as staged, staged.open("xb") as file:
        np.savez(file, allow_pickle=False, **columns)


def find_chunks(part: Path) -> FoundChunks:
    """Read every chunk of a folder once, with its checksums."""
    chunks: list[Chunk] = []
    about: Columns | None = None
    problems = []
    paths = sorted(part.glob("[0-9]*.npz"))
    for path in paths:
        try:
            columns = read_npz(path)
            chunks.append(_whole_chunk(path, columns, chunks[0] if chunks else None))
            about = {name.removeprefix(_ABOUT): v for name, v in columns.items() if name.startswith(_ABOUT)}
        except InputError as error:
            problems.append(str(error))
        except ValueError as error:
            problems.append(f"{path.name} is damaged ({error})")
    is_end_lost = bool(paths) and (not chunks or chunks[-1].path != paths[-1])
    problems += _gaps(chunks, is_end_lost)
    return FoundChunks(tuple(chunks), about, tuple(problems))


def _whole_chunk(path: Path, columns: Columns, first: Chunk | None) -> Chunk:
    """Raises ``ValueError`` for columns that are not those of one run."""
    frames = {name: values for name, values in columns.items() if not name.startswith(_ABOUT)}
    if _ABOUT + "format" not in columns or "frame" not in frames:
        raise ValueError("the chunk holds no frames")
    numbers = frames["frame"]
    kinds = {name: (values.dtype, values.shape[1:]) for name, values in frames.items()}
    if any(values.shape[:1] != numbers.shape for values in frames.values()):
        raise ValueError("the columns differ in length")
    if first is not None and kinds != first.kinds:
        raise ValueError(f"the columns are not those of {first.path.name}")
    return Chunk(path, numbers, kinds)


def _gaps(chunks: list[Chunk], is_end_lost: bool) -> list[str]:
    numbers = np.concatenate([np.array([-1]), *(chunk.frames for chunk in chunks)])
    before = np.flatnonzero(np.diff(numbers) > 1)
    gaps = [describe_gap(int(numbers[i]) + 1, int(numbers[i + 1]) - 1) for i in before]
    return [*gaps, describe_gap(int(numbers[-1]) + 1, None)] if is_end_lost else gaps


def read_column(chunk: Chunk, name: str) -> NDArray[Any]:
    """One column of the frames of a complete chunk.

    Raises:
        InputError, NpzError: the chunk changed since it was found.
    """
    return read_npz(chunk.path, name)[name]


def read_frames(chunk: Chunk) -> Columns:
    """The columns of the frames of a complete chunk.

    Raises:
        InputError, NpzError: the chunk changed since it was found.
    """
    return read_npz(chunk.path, *chunk.kinds)
