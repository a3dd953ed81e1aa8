"""The options of a recording, and the table with the columns that messages need."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.texts import visible
from cmpdesign.tracking.columns import Columns, FrameTable

if TYPE_CHECKING:
    from extractor.quality import Quality
    from extractor.space.camera import View

DEFAULT_FRAME_ID = "tactile"
# The properties of an image in the column "quality", in this order; units as in ``Quality``.
QUALITY = ("blur_px", "noise", "contrast", "clipping", "evenness", "edge_px")
# dtype of the column "hints".
HINTS = "U400"
_FRAME_ID = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")


@dataclass(frozen=True)
class Recording:
    """Options of a recording.

    Attributes:
        frame_id: the coordinate frame in the messages' headers, and the first part of their topics.
        with_images: keep the source's images.
        views: the cameras' views with their intrinsics; empty where the intrinsics are not known.
        is_image_one_a_view: the source has an image for each view; otherwise one image shows all views.

    Raises:
        CmpDesignError: a frame id that cannot stand in a ROS topic.
    """

    frame_id: str = DEFAULT_FRAME_ID
    with_images: bool = False
    views: tuple[View, ...] = ()
    is_image_one_a_view: bool = False

    def __post_init__(self) -> None:
        if not _FRAME_ID.fullmatch(self.frame_id):
            raise CmpDesignError(
                f"{parameter('frame_id')} {self.frame_id!r}: cannot stand in a ROS topic; "
                "use letters, digits and _, and begin with a letter"
            )


def is_recording(path: Path) -> bool:
    """True for the name of a recording: it ends in .mcap or .rrd, or has no ending, for a rosbag2 folder."""
    return path.suffix in (".mcap", ".rrd", "")


class RecordedTable:
    """A table whose frames and shared columns also hold the values for messages.

    Args:
        table: the table.
        recording: the options, which become shared columns, so that an interrupted run is recovered with them.
    """

    def __init__(self, table: FrameTable, recording: Recording) -> None:
        self._table, self._recording = table, recording
        self.digits: Mapping[str, int] = table.digits

    def batch(self, frames: Sequence[Any]) -> Columns:
        """The table's columns of F frames of V views, and quality (F, V, 6) float32, hints (F,) text."""
        columns = self._table.batch(frames)
        qualities = [_qualities_of(frame) for frame in frames]
        columns["quality"] = np.array(
            [[[getattr(one, name, np.nan) for name in QUALITY] for one in views] for views in qualities],
            np.float32,
        )
        columns["hints"] = np.array([_hints_text(views) for views in qualities], HINTS)
        return columns

    def about(self) -> Columns:
        """The table's shared columns, the frame id, and the views' names and intrinsics."""
        views = self._recording.views
        areas = [view.area_px or (0, 0, 0, 0) for view in views]
        return self._table.about() | {
            "frame_id": np.array(self._recording.frame_id),
            "view_names": np.array([view.name for view in views], "U100"),
            "view_focal_px": np.array([view.focal_px for view in views], np.float64).reshape(-1, 2),
            "view_centre_px": np.array([view.centre_px for view in views], np.float64).reshape(-1, 2),
            "view_distortion": _padded([view.distortion for view in views]),
            "view_area_px": np.array(areas, np.int64).reshape(-1, 4),
        }


def _padded(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    """(V, K) of rows of at most K numbers, with NaN at their ends."""
    out = np.full((len(rows), max(map(len, rows), default=5)), np.nan)
    for filled, row in zip(out, rows, strict=True):
        filled[: len(row)] = row
    return out


def _qualities_of(frame: Any) -> list[Quality | None]:
    """The quality of each view's image of a ``Tracked`` or a ``ShapeFrame``; None without an image."""
    return [view.markers.quality for view in getattr(frame, "views", (frame,))]


def _hints_text(views: Sequence[Quality | None]) -> str:
    return visible("; ".join(dict.fromkeys(hint for one in views if one is not None for hint in one.hints)))
