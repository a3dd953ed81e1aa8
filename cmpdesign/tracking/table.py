"""The table of tracking, and the long form of tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmpdesign.tracking.columns import (
    HEAD,
    Columns,
    head_columns,
    long_head_columns,
    time_columns,
    unknown_times,
)
from cmpdesign.tracking.force_table import FORCE_DIGITS, force_about, force_columns, force_long_form
from cmpdesign.tracking.sources.frame_source import SourceTimes

if TYPE_CHECKING:
    from extractor.contact import ContactReader
    from extractor.space.views import ContactTracker
    from extractor.track.tracker import Tracked, Tracker


DIGITS: Mapping[str, int] = {name: 0 for name in ("marker", "layer", "index", "status")} | {
    "x_px": 5, "y_px": 5, "cov_xx_px2": 8, "cov_xy_px2": 8, "cov_yy_px2": 8,
    "dx_px": 5, "dy_px": 5, "dx_mm": 6, "dy_mm": 6,
}  # fmt: skip


class TrackTable:
    """The table of a tracker's frames.

    Args:
        tracker: its layout and rest frame are the shared columns.
        times: gives how the frames' times were found, for the shared columns.
        contact: the reader whose forces the frames hold, for further columns; None: frames without forces.
    """

    def __init__(
        self,
        tracker: Tracker | ContactTracker,
        times: Callable[[], SourceTimes] = unknown_times,
        contact: ContactReader | None = None,
    ) -> None:
        self._tracker, self._times, self._contact = tracker, times, contact
        self.digits: Mapping[str, int] = DIGITS if contact is None else {**DIGITS, **FORCE_DIGITS}

    def batch(self, frames: Sequence[Tracked]) -> Columns:
        columns = frame_columns(frames)
        if self._contact is not None:
            columns |= force_columns([frame.contact for frame in frames if frame.contact is not None])
        return columns

    def about(self) -> Columns:
        columns = fixed_columns(self._tracker) | time_columns(self._times())
        return columns if self._contact is None else columns | force_about(self._contact)


def table_long_form(columns: Columns, fixed: Columns) -> Columns:
    """The long form of the columns of frames; ``fixed``: the shared columns, whose ``format`` determines the table."""
    if str(fixed["format"]) == "cmp-reconstruction":
        from cmpdesign.tracking.shape_table import shape_long_form as of_shapes

        return of_shapes(columns, fixed)
    return track_long_form(columns, fixed)


def frame_columns(frames: Sequence[Tracked]) -> Columns:
    """The columns of F frames by M markers."""
    cov = np.stack([frame.markers.cov_px2 for frame in frames])
    return {
        **head_columns(frames),
        "start": np.array([frame.start or "" for frame in frames], "U20"),
        "status": np.stack([frame.markers.status for frame in frames]),
        "xy_px": np.stack([frame.markers.xy_px for frame in frames]),
        "cov_px2": cov[:, :, (0, 0, 1), (0, 1, 1)].astype(np.float32),
        "displacement_px": np.stack([frame.displacement_px for frame in frames]),
        "displacement_mm": np.stack([frame.displacement_mm for frame in frames]),
    }


def fixed_columns(tracker: Tracker | ContactTracker) -> Columns:
    """The shared columns: the layout, and the rest frame (NaN where unknown so far)."""
    reference, rest = tracker.layout, tracker.rest
    unknown = np.full((3, 3), np.nan)
    homography = rest.layout_from_image if rest is not None else None
    scale = rest.mm_per_px if rest is not None else None
    return {
        "format": np.array("cmp-tracking"),
        "layer": reference.layer,
        "index": reference.index,
        "layout_xy_mm": reference.xy_mm,
        "edges": reference.edges,
        "rest_xy_px": np.full_like(reference.xy_mm, np.nan) if rest is None else rest.xy_px,
        "layout_from_image": unknown if homography is None else homography,
        "mm_per_px": np.float64(np.nan if scale is None else scale),  # type: ignore[dict-item]
        "digest": np.array(reference.digest),
    }


def track_long_form(columns: Columns, fixed: Columns) -> Columns:
    """The long form: one row for every frame and marker (also lost markers), one column per axis of a pair."""
    frames, count = columns["status"].shape
    pairs = {
        "xy_px": ("x_px", "y_px"),
        "displacement_px": ("dx_px", "dy_px"),
        "displacement_mm": ("dx_mm", "dy_mm"),
    }
    long = long_head_columns(columns, count)
    long["marker"] = np.tile(np.arange(count, dtype=np.int32), frames)
    long["layer"], long["index"] = np.tile(fixed["layer"], frames), np.tile(fixed["index"], frames)
    long["status"] = columns["status"].reshape(-1)
    for name, (x, y) in pairs.items():
        long[x], long[y] = columns[name][..., 0].reshape(-1), columns[name][..., 1].reshape(-1)
    for place, name in enumerate(("cov_xx_px2", "cov_xy_px2", "cov_yy_px2")):
        long[name] = columns["cov_px2"][..., place].reshape(-1)
    ordered = {name: long[name] for name in (*HEAD, *DIGITS)}
    return ordered | force_long_form(columns, count) if "force_n" in columns else ordered
