"""The columns that are common to the tables of tracking and of reconstruction, and the interface of a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cmpdesign.inputs.texts import visible
from cmpdesign.tracking.sources.frame_source import SourceTimes

Columns = dict[str, NDArray[Any]]


AXES = ("x", "y", "z")
COVARIANCE = ("xx", "xy", "xz", "yy", "yz", "zz")
UPPER = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
# Texts of the frame status codes.
FRAME_STATUS = ("", "tracked", "lost", "unreadable", "other size")
# dtype of reasons.
REASON = "U120"
# First columns of every long form.
HEAD = ("frame", "time_s", "frame_status", "reason")


class FrameTable(Protocol):
    """A table of frames as arrays; its long form has one row for every frame and point.

    Attributes:
        digits: column of the long form after ``HEAD`` -> decimals in text; 0 for whole numbers.
    """

    digits: Mapping[str, int]

    def batch(self, frames: Sequence[Any]) -> Columns:
        """The columns of F frames: arrays with a leading axis of F."""
        ...

    def about(self) -> Columns:
        """The columns that all frames share; ``format`` selects the long form in ``table_long_form``."""
        ...


def head_columns(frames: Sequence[Any]) -> Columns:
    """The columns (F,) of a frame that all tables have."""
    return {
        "frame": np.array([frame.index for frame in frames], np.int64),
        "time_s": np.array([frame.time_s for frame in frames], np.float64),
        "frame_status": np.array([frame.status for frame in frames], np.uint8),
        "reason": np.array([visible(frame.reason) for frame in frames], REASON),
        "elapsed_ms": np.array([frame.elapsed_ms for frame in frames], np.float32),
    }


def unknown_times() -> SourceTimes:
    """Times of frames that come from no source."""
    return SourceTimes("none", "")


def time_columns(times: SourceTimes) -> Columns:
    """The shared columns of times: when ``time_s`` was 0, s since 1970 (NaN where unknown), and what says so."""
    began_s = np.nan if times.began_unix_s is None else times.began_unix_s
    return {
        "times_of": np.array(times.of),
        "began_unix_s": np.array(began_s, np.float64),
        "began_of": np.array(times.began_of or ""),
    }


def long_head_columns(columns: Columns, count: int) -> Columns:
    """The columns of ``HEAD`` in the long form, for ``count`` rows per frame."""
    long: Columns = {name: np.repeat(columns[name], count) for name in ("frame", "time_s")}
    long["frame_status"] = np.repeat(np.array(FRAME_STATUS)[columns["frame_status"]], count)
    long["reason"] = np.repeat(columns["reason"], count)
    return long


def by_point(of_markers: NDArray[Any], count: int) -> NDArray[Any]:
    """(F * count,) from (F, M): NaN for the virtual markers."""
    padded = np.full((len(of_markers), count), np.nan, of_markers.dtype)
    padded[:, : of_markers.shape[1]] = of_markers
    return padded.reshape(-1)
