"""The sink of .csv: the long form as text, frame by frame."""

from __future__ import annotations

import csv
import io
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.errors import OutputError
from cmpdesign.files.atomic import sync_folder
from cmpdesign.files.locks import try_lock
from cmpdesign.tracking.columns import HEAD, Columns, FrameTable
from cmpdesign.tracking.sinks.unfinished import FLUSH_S, part_path
from cmpdesign.tracking.table import table_long_form

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # in spreadsheets


class CsvSink:
    """Writes the long form as text, frame by frame; a frame that does not fit on the disk is removed again."""

    def __init__(self, path: Path, table: FrameTable) -> None:
        self._path, self._part, self._table = path, part_path(path), table
        self._file = self._part.open("xb", buffering=0)
        try_lock(self._file.fileno())
        self._end, self._frames, self._last = 0, 0, time.monotonic()
        self._write((",".join((*HEAD, *self._table.digits)) + "\n").encode())

    def add(self, frame: Any, image: Any = None) -> None:
        columns = table_long_form(self._table.batch([frame]), self._table.about())
        try:
            self._write(_csv_lines(columns, self._table.digits))
            self._frames += 1
            if time.monotonic() - self._last > FLUSH_S:
                os.fsync(self._file.fileno())
                self._last = time.monotonic()
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
            with self._file:
                os.fsync(self._file.fileno())
                self._part.replace(self._path)
            sync_folder(self._path.parent)
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
    """The text of a cell; with an apostrophe, spreadsheets do not read the text as a formula."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text


def _format_number(value: float, digits: int) -> str:
    return "" if value != value else f"{value:.{digits}f}"
