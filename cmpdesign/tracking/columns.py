"""What the tables of tracking and of reconstruction share: the columns of a frame, and what every sink needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Columns = dict[str, NDArray[Any]]


FRAME_STATUS = ("", "tracked", "lost", "unreadable", "other size")


REASON = "U120"


HEAD = ("frame", "time_s", "frame_status", "reason")  # opens every row of a long form


class FrameTable(Protocol):
    """Frames as arrays, and as a long form of one row for every frame and point.

    Attributes:
        digits: the long form's columns after ``HEAD``: decimals in text, 0 for whole numbers.
    """

    digits: Mapping[str, int]

    def batch(self, frames: Sequence[Any]) -> Columns:
        """F frames as arrays with a leading axis of F."""
        ...

    def about(self) -> Columns:
        """What is the same for all frames, with ``format``, by which ``long_form_of`` knows the table."""
        ...


def head_columns(frames: Sequence[Any]) -> Columns:
    """What all tables say of a frame."""
    return {
        "frame": np.array([frame.index for frame in frames], np.int64),
        "time_s": np.array([frame.time_s for frame in frames], np.float64),
        "frame_status": np.array([frame.status for frame in frames], np.uint8),
        "reason": np.array([frame.reason for frame in frames], REASON),
        "elapsed_ms": np.array([frame.elapsed_ms for frame in frames], np.float32),
    }


def long_head_columns(columns: Columns, count: int) -> Columns:
    """``HEAD`` for ``count`` rows of every frame."""
    long: Columns = {name: np.repeat(columns[name], count) for name in ("frame", "time_s")}
    long["frame_status"] = np.repeat(np.array(FRAME_STATUS)[columns["frame_status"]], count)
    long["reason"] = np.repeat(columns["reason"], count)
    return long
