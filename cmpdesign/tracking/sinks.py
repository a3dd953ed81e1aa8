"""Sinks of frames: tables that are written while a run goes on, so that a killed run loses at most some seconds.

CSV is written to ``FILE.part``. NPZ and Parquet cannot grow: their frames go to the folder ``FILE.part/`` as chunks,
each an .npz file, which are assembled at the end. After a killed run, ``recover_table`` completes the file.
"""

from __future__ import annotations

import csv
import io
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.tracking.columns import HEAD, Columns, FrameTable
from cmpdesign.tracking.table import table_long_form

CHUNK_FRAMES = 256
CHUNK_S = 5.0  # largest time between two chunks, lost in a crash
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # in spreadsheets
KINDS = (".npz", ".parquet", ".csv")


class FrameSink(Protocol):
    """A table that is written frame by frame.

    ``add`` and ``close`` raise ``OutputError``. ``kept`` states the number of written frames and their file.
    """

    def add(self, frame: Any) -> None: ...

    def close(self) -> None: ...

    def kept(self) -> str: ...


def open_sink(path: Path, table: FrameTable) -> FrameSink:
    """Open the sink for the suffix of a file.

    Raises:
        CmpDesignError: another suffix, Parquet without pyarrow, or frames of an interrupted run exist.
        OutputError: the file cannot be written.
    """
    _require_kind(path)
    part = _part_path(path)
    if part.exists():
        raise CmpDesignError(
            f"{part} holds the frames of an interrupted run; call with --recover, or delete it"
        )
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give a file's name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return CsvSink(path, table) if path.suffix == ".csv" else ChunkSink(path, table)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from None


def recover_table(path: Path) -> int:
    """Complete the file of an interrupted run from its chunks or its text.

    Returns:
        The number of frames.

    Raises:
        CmpDesignError: no interrupted run.
        OutputError: the file cannot be written; the chunks or the text are kept.
    """
    _require_kind(path)
    part = _part_path(path)
    if not part.exists():
        raise CmpDesignError(f"{part}: there is nothing to recover")
    try:
        if path.suffix == ".csv":
            frames = _truncate_to_whole_lines(part)
            part.replace(path)
            return frames
        return _assemble_chunks(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error}); {part} is kept") from None


def _part_path(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _require_kind(path: Path) -> None:
    if path.suffix not in KINDS:
        raise CmpDesignError(f"{path}: unknown ending; expected one of {', '.join(KINDS)}")
    if path.suffix == ".parquet":
        _pyarrow()


def _pyarrow() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise CmpDesignError(
            "Parquet needs pyarrow: pip install 'cmpdesign[parquet]', or write .npz or .csv"
        ) from None
    return pyarrow


class CsvSink:
    """Writes the long form as text, frame by frame; a frame that does not fit on the disk is removed again."""

    def __init__(self, path: Path, table: FrameTable) -> None:
        self._path, self._part, self._table = path, _part_path(path), table
        self._file = self._part.open("xb", buffering=0)
        self._end, self._frames = 0, 0
        self._write((",".join((*HEAD, *self._table.digits)) + "\n").encode())

    def add(self, frame: Any) -> None:
        columns = table_long_form(self._table.batch([frame]), self._table.about())
        try:
            self._write(_csv_lines(columns, self._table.digits))
            self._frames += 1
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def _write(self, data: bytes) -> None:
        written = 0
        try:
            while written < len(data):
                written += self._file.write(data[written:])
        except OSError:
            self._file.truncate(self._end)
            self._file.seek(self._end)
            raise
        self._end += written

    def close(self) -> None:
        try:
            self._file.close()
            self._part.replace(self._path)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def kept(self) -> str:
        return f"{self._frames} frames are kept in {self._part if self._part.exists() else self._path}"


def _csv_lines(columns: Columns, digits: Mapping[str, int]) -> bytes:
    """The rows of a frame; unknown values are empty fields."""
    reason = io.StringIO()
    csv.writer(reason, lineterminator="").writerow([_plain_cell(columns["reason"][0])])
    time_s, status = _format_number(columns["time_s"][0], 6), columns["frame_status"][0]
    head = f"{columns['frame'][0]},{time_s},{status},{reason.getvalue()},"
    if not columns["reason"][0]:
        head = head.replace('""', "")
    fields = [
        [_format_number(v, places) if places else str(v) for v in columns[name].tolist()]
        for name, places in digits.items()
    ]
    return "".join(head + ",".join(row) + "\n" for row in zip(*fields, strict=True)).encode()


def _plain_cell(text: str) -> str:
    """The text of a cell; an apostrophe keeps spreadsheets from reading it as a formula."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text


def _format_number(value: float, digits: int) -> str:
    return "" if value != value else f"{value:.{digits}f}"


def _truncate_to_whole_lines(part: Path) -> int:
    """Cut off an incomplete last line; the number of frames in the file."""
    with part.open("r+b") as file:
        data = file.read()
        end = data.rfind(b"\n") + 1
        file.truncate(end)
    frames = {line.split(b",", 1)[0] for line in data[:end].splitlines()[1:]}
    return len(frames)


class ChunkSink:
    """Writes frames in chunks of some seconds, which are assembled at the end."""

    def __init__(self, path: Path, table: FrameTable) -> None:
        self._path, self._part, self._table = path, _part_path(path), table
        self._part.mkdir()
        self._frames: list[Any] = []
        self._chunks, self._kept = 0, 0
        self._last = time.monotonic()

    def add(self, frame: Any) -> None:
        self._frames.append(frame)
        if len(self._frames) >= CHUNK_FRAMES or time.monotonic() - self._last > CHUNK_S:
            self._flush()

    def _flush(self) -> None:
        try:
            _save_chunk(self._part / "about.npz", self._table.about())
            if self._frames:
                self._save_frames(self._frames)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None
        self._frames, self._last = [], time.monotonic()

    def _save_frames(self, frames: list[Any]) -> None:
        """Save frames as one chunk; if the chunk does not fit on the disk, as two halves."""
        try:
            _save_chunk(self._part / f"{self._chunks:06d}.npz", self._table.batch(frames))
        except OSError:
            if len(frames) == 1:
                raise
            half = len(frames) // 2
            self._save_frames(frames[:half])
            self._save_frames(frames[half:])
            return
        self._chunks += 1
        self._kept += len(frames)

    def close(self) -> None:
        self._flush()
        try:
            _assemble_chunks(self._part, self._path)
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def kept(self) -> str:
        if not self._part.exists():
            return f"{self._kept} frames are kept in {self._path}"
        return f"{self._kept} frames are kept in {self._part}; make room, then call with --recover"


def _save_chunk(path: Path, columns: Columns) -> None:
    """Write a chunk atomically."""
    unfinished = path.with_suffix(".new")
    try:
        with unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **columns)
        unfinished.replace(path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise


def _read_chunks(part: Path) -> Iterator[Columns]:
    """Read the chunks in order, one at a time."""
    for path in sorted(part.glob("[0-9]*.npz")):
        with np.load(path, allow_pickle=False) as file:
            yield {name: file[name] for name in file.files}


def _assemble_chunks(part: Path, path: Path) -> int:
    """Assemble the chunks into one file and remove them; the number of frames."""
    with np.load(part / "about.npz", allow_pickle=False) as file:
        fixed = {name: file[name] for name in file.files}
    unfinished = part / ("whole" + path.suffix)
    try:
        frames = (_write_npz if path.suffix == ".npz" else _write_parquet)(part, unfinished, fixed)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise
    unfinished.replace(path)
    shutil.rmtree(part)
    return frames


def _write_npz(part: Path, path: Path, fixed: Columns) -> int:
    """Write array by array and chunk by chunk, so that the memory in use is that of one chunk."""
    import zipfile

    shapes: dict[str, tuple[np.dtype[Any], list[int]]] = {}
    frames = 0
    for columns in _read_chunks(part):
        for name, values in columns.items():
            shapes.setdefault(name, (values.dtype, list(values.shape)))
        frames += len(columns["frame"])
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, values in fixed.items():
            with archive.open(_zip_member(name), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(values), allow_pickle=False)
        for name, (dtype, shape) in shapes.items():
            header = {
                "descr": np.lib.format.dtype_to_descr(dtype),
                "fortran_order": False,
                "shape": (frames, *shape[1:]),
            }
            with archive.open(_zip_member(name), "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, header)
                for columns in _read_chunks(part):
                    file.write(np.ascontiguousarray(columns[name]).tobytes())
    return frames


def _zip_member(name: str) -> Any:
    """A zip member without a date."""
    import zipfile

    member = zipfile.ZipInfo(f"{name}.npy")
    member.compress_type = zipfile.ZIP_DEFLATED
    return member


def _write_parquet(part: Path, path: Path, fixed: Columns) -> int:
    """Write the long form with one row group per chunk."""
    arrow = _pyarrow()
    frames, writer = 0, None
    try:
        for columns in _read_chunks(part):
            long = table_long_form(columns, fixed)
            arrays = {
                name: arrow.array(values, from_pandas=values.dtype.kind == "f")
                for name, values in long.items()
            }
            table = arrow.table(arrays).replace_schema_metadata({"digest": str(fixed["digest"])})
            writer = writer or arrow.parquet.ParquetWriter(path, table.schema, compression="zstd")
            writer.write_table(table)
            frames += len(columns["frame"])
    finally:
        if writer is not None:
            writer.close()
    if writer is None:
        raise OSError(0, "no frame was tracked")
    return frames
