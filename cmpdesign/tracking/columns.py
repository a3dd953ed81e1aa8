"""The columns that are common to the tables of tracking and of reconstruction, and the interface of a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cmpdesign.inputs.texts import visible
from cmpdesign.tracking.sources.frame_source import SourceTimes

if TYPE_CHECKING:
    from extractor.contact import ContactForce

Columns = dict[str, NDArray[Any]]


AXES = ("x", "y", "z")
COVARIANCE = ("xx", "xy", "xz", "yy", "yz", "zz")
UPPER = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
FORCE_DIGITS: Mapping[str, int] = (
    {"contact_reason": 0, "contact_regions": 0, "utilisation": 4}
    | {f"force_{axis}_n": 6 for axis in AXES}
    | {f"force_cov_{name}_n2": 12 for name in COVARIANCE}
    | {f"torque_{axis}_nmm": 6 for axis in AXES}
    | {f"torque_cov_{name}_nmm2": 12 for name in COVARIANCE}
    | {f"traction_{axis}_mpa": 7 for axis in AXES}
)
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


def force_columns(found: Sequence[ContactForce]) -> Columns:
    """The columns of F frames: by frame, and ``marker_traction_mpa`` (F, M, 3) on the touched surface."""
    covariances = {
        "force_cov_n2": np.stack([one.force_cov_n2 for one in found]),
        "torque_cov_nmm2": np.stack([one.torque_cov_nmm2 for one in found]),
    }
    return {
        "contact_reason": np.array([one.reason for one in found], np.uint8),
        "contact_regions": np.array([len(one.regions) for one in found], np.int32),
        "force_n": np.stack([one.force_n for one in found]),
        "torque_nmm": np.stack([one.torque_nmm for one in found]),
        **{name: cov[:, UPPER[0], UPPER[1]] for name, cov in covariances.items()},
        "utilisation": np.array([one.utilisation for one in found]),
        "marker_traction_mpa": np.stack([one.marker_traction_mpa for one in found]).astype(np.float32),
    }


def force_long_form(columns: Columns, count: int) -> Columns:
    """The same columns for one row of every frame and point; a frame's values stand in all its rows."""
    long: Columns = {
        name: np.repeat(columns[name], count) for name in ("contact_reason", "contact_regions", "utilisation")
    }
    for name, unit in (("force", "n"), ("torque", "nmm")):
        for place, axis in enumerate(AXES):
            long[f"{name}_{axis}_{unit}"] = np.repeat(columns[f"{name}_{unit}"][:, place], count)
        for place, pair in enumerate(COVARIANCE):
            values = columns[f"{name}_cov_{unit}2"][:, place]
            long[f"{name}_cov_{pair}_{unit}2"] = np.repeat(values, count)
    for place, axis in enumerate(AXES):
        long[f"traction_{axis}_mpa"] = by_point(columns["marker_traction_mpa"][..., place], count)
    return long
