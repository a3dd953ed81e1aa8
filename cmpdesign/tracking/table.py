"""The columns that tracking writes, and batches of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from extractor.displacement import Rest
    from extractor.reference import Reference
    from extractor.tracking import Tracked

Columns = dict[str, NDArray[Any]]

FRAME_STATUS = ("", "tracked", "lost", "unreadable", "other size")
REASON = "U120"
# In the long form, pairs become columns of their own.
LONG_COLUMNS = (
    "frame", "time_s", "frame_status", "reason", "marker", "layer", "index", "status", "x_px", "y_px",
    "cov_xx_px2", "cov_xy_px2", "cov_yy_px2", "dx_px", "dy_px", "dx_mm", "dy_mm",
)  # fmt: skip


def batch(frames: Sequence[Tracked]) -> Columns:
    """Frames as columns: F frames by M markers."""
    cov = np.stack([frame.markers.cov_px2 for frame in frames])
    return {
        "frame": np.array([frame.index for frame in frames], np.int64),
        "time_s": np.array([frame.time_s for frame in frames], np.float64),
        "frame_status": np.array([frame.status for frame in frames], np.uint8),
        "reason": np.array([frame.reason for frame in frames], REASON),
        "start": np.array([frame.start or "" for frame in frames], "U20"),
        "elapsed_ms": np.array([frame.elapsed_ms for frame in frames], np.float32),
        "status": np.stack([frame.markers.status for frame in frames]),
        "xy_px": np.stack([frame.markers.xy_px for frame in frames]),
        "cov_px2": cov[:, :, (0, 0, 1), (0, 1, 1)].astype(np.float32),
        "displacement_px": np.stack([frame.displacement_px for frame in frames]),
        "displacement_mm": np.stack([frame.displacement_mm for frame in frames]),
    }


def about(reference: Reference, rest: Rest | None) -> Columns:
    """What is the same for all frames."""
    unknown = np.full((3, 3), np.nan)
    homography = rest.layout_from_image if rest is not None else None
    scale = rest.mm_per_px if rest is not None else None
    return {
        "layer": reference.layer,
        "index": reference.index,
        "layout_xy_mm": reference.xy_mm,
        "edges": reference.edges,
        "rest_xy_px": np.full_like(reference.xy_mm, np.nan) if rest is None else rest.xy_px,
        "layout_from_image": unknown if homography is None else homography,
        "mm_per_px": np.float64(np.nan if scale is None else scale),  # type: ignore[dict-item]
        "digest": np.array(reference.digest),
    }


def long_form(columns: Columns, layer: NDArray[np.int32], index: NDArray[np.int32]) -> Columns:
    """One row for every frame and marker, lost ones too, in the order of ``LONG_COLUMNS``."""
    frames, count = columns["status"].shape
    pairs = {
        "xy_px": ("x_px", "y_px"),
        "displacement_px": ("dx_px", "dy_px"),
        "displacement_mm": ("dx_mm", "dy_mm"),
    }
    long: Columns = {name: np.repeat(columns[name], count) for name in ("frame", "time_s", "reason")}
    long["frame_status"] = np.repeat(np.array(FRAME_STATUS)[columns["frame_status"]], count)
    long["marker"] = np.tile(np.arange(count, dtype=np.int32), frames)
    long["layer"], long["index"] = np.tile(layer, frames), np.tile(index, frames)
    long["status"] = columns["status"].reshape(-1)
    for name, (x, y) in pairs.items():
        long[x], long[y] = columns[name][..., 0].reshape(-1), columns[name][..., 1].reshape(-1)
    for place, name in enumerate(("cov_xx_px2", "cov_xy_px2", "cov_yy_px2")):
        long[name] = columns["cov_px2"][..., place].reshape(-1)
    return {name: long[name] for name in LONG_COLUMNS}
