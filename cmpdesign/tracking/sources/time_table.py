"""Times of frames from a file: ``--times FILE.csv``."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

from cmpdesign.errors import SourceError
from cmpdesign.inputs.files import read_text

_UNIX_S = 10**9  # larger times are seconds since 1970


@dataclass(frozen=True)
class TimeTable:
    """Times by the name of a picture's file, or by the number of a frame.

    Attributes:
        path: the file.
        times: name or number -> s from ``began_s``.
        began_s: smallest time of the file.
    """

    path: Path
    times: Mapping[str, float]
    began_s: float

    @property
    def is_unix(self) -> bool:
        return self.began_s >= _UNIX_S

    def time_s(self, index: int, name: str = "") -> float:
        """The time of a frame by its file's name, else by its number; NaN where the file has none."""
        return self.times.get(name, self.times.get(str(index), float("nan")))


def read_time_table(path: Path) -> TimeTable:
    """Read lines of "frame,time": frame is a file's name or a number from 0; a first line of names may stand above.

    Raises:
        SourceError: the file cannot be read, a line has no time, or a frame has two.
    """
    try:
        rows = [row for row in csv.reader(read_text(path).splitlines(), strict=True) if row]
    except (ValueError, csv.Error) as error:
        raise SourceError(str(error) if str(path) in str(error) else f"{path}: {error}") from None
    stamps: dict[str, Decimal] = {}
    for number, row in enumerate(rows, start=1):
        stamp = _decimal(row[1]) if len(row) > 1 else None
        if stamp is None and number == 1:
            continue  # names of the columns
        if stamp is None or row[0].strip() in stamps:
            problem = "has no time" if stamp is None else f"gives {row[0][:40]!r} a second time"
            raise SourceError(
                f"{path}: line {number} {problem}; expected lines of FRAME,SECONDS, as in frame7.png,0.231"
            )
        stamps[row[0].strip()] = stamp
    if not stamps:
        raise SourceError(f"{path}: holds no time; expected lines of FRAME,SECONDS, as in frame7.png,0.231")
    began = min(stamps.values())
    return TimeTable(path, {name: float(stamp - began) for name, stamp in stamps.items()}, float(began))


def _decimal(text: str) -> Decimal | None:
    try:
        stamp = Decimal(text.strip())
    except InvalidOperation:
        return None
    return stamp if stamp.is_finite() and abs(stamp) < 10**12 else None
