"""Complete frames of the CSV file of a killed run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from cmpdesign.files.atomic import staged_file, sync_file, sync_folder
from cmpdesign.inputs.files import open_file
from cmpdesign.tracking.sinks.unfinished import Recovered

_COPY_BYTES = 1 << 20


@dataclass(frozen=True)
class _Frame:
    """The rows of one frame: its number (None for rows without a frame number), and their place in the file."""

    number: int | None
    start: int
    end: int
    rows: int


def recover_csv(part: Path, path: Path, rows_per_frame: int) -> Recovered:
    """Keep the complete frames of a text, and rename the text to the table.

    Args:
        part: the text of the killed run.
        path: the table.
        rows_per_frame: number of rows of a complete frame.

    Raises:
        InputError: the text cannot be opened.
        OSError: the file cannot be written; the text is kept.
    """
    with open_file(part) as file:
        head = len(file.readline())
        frames = list(_frames_in(file, head))
    whole = [frame for frame in frames if frame.number is not None and frame.rows == rows_per_frame]
    # The last frame of a killed run may be incomplete; this is no damage.
    others = [frame for frame in (frames[:-1] if whole else frames) if frame not in whole]
    problems = tuple(_describe(frame, rows_per_frame) for frame in others)
    if not whole:
        return Recovered(0, problems)
    end = whole[-1].end
    if end == head + sum(frame.end - frame.start for frame in whole):
        with part.open("r+b") as file:  # in place, because the disk may be full
            file.truncate(end)
        sync_file(part)
        part.replace(path)
        sync_folder(path.parent)
    else:
        with staged_file(path) as staged, open_file(part) as source, staged.open("xb") as target:
            for start, stop in [(0, head), *((frame.start, frame.end) for frame in whole)]:
                _copy_bytes(source, target, start, stop)
        part.unlink()
    return Recovered(len(whole), problems)


def _frames_in(file: BinaryIO, start: int) -> Iterator[_Frame]:
    """The frames from a place on: consecutive rows of one number. A row without its line end is left out."""
    frame: _Frame | None = None
    for number, end in _rows_in(file, start):
        if frame is not None and frame.number == number:
            frame = _Frame(number, frame.start, end, frame.rows + 1)
            continue
        if frame is not None:
            yield frame
        frame = _Frame(number, frame.end if frame else start, end, 1)
    if frame is not None:
        yield frame


def _rows_in(file: BinaryIO, start: int) -> Iterator[tuple[int | None, int]]:
    """The frame number of every row, and the end of the row; no field holds a line break, see ``head_columns``."""
    end = start
    for row in file:
        end += len(row)
        if not row.endswith(b"\n"):
            return
        first = row.partition(b",")[0]
        yield (int(first) if first.isdigit() and len(first) < 19 else None), end


def _describe(frame: _Frame, rows_per_frame: int) -> str:
    if frame.number is None:
        return f"{frame.rows} rows from byte {frame.start} on are damaged"
    return f"frame {frame.number} is damaged ({frame.rows} of {rows_per_frame} rows)"


def _copy_bytes(source: BinaryIO, target: BinaryIO, start: int, stop: int) -> None:
    source.seek(start)
    while start < stop:
        data = source.read(min(_COPY_BYTES, stop - start))
        target.write(data)
        start += len(data)
