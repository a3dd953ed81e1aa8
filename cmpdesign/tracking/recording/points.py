"""Markers as the points of a PointCloud2: records of little-endian numbers in metres, one a marker in id order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.tracking.columns import Columns

M_PER_MM = 1e-3
Records = NDArray[np.void]


def _record_type(*fields: tuple[str, str] | tuple[str, str, tuple[int]]) -> np.dtype[Any]:
    """A record whose fields are aligned, as in C."""
    return np.dtype([*fields, ("id", "<u4"), ("status", "u1")], align=True)


def _axes(*names: str) -> list[tuple[str, str]]:
    return [(name, "<f4") for name in names]


# Records of reconstruction: metres, square metres; of tracking: metres and pixels.
IN_SPACE = _record_type(*_axes(*"xyz", "dx", "dy", "dz", "nx", "ny", "nz"), ("covariance", "<f4", (6,)))
IN_SPACE_AND_SURFACE = _record_type(
    *_axes(*"xyz", "dx", "dy", "dz", "nx", "ny", "nz"),
    ("covariance", "<f4", (6,)),
    *_axes("surface_dx", "surface_dy", "surface_dz"),
    ("surface_covariance", "<f4", (6,)),
)
IN_IMAGE = _record_type(
    *_axes(*"xyz", "dx", "dy", "dz", "x_px", "y_px", "dx_px", "dy_px"), ("covariance_px2", "<f4", (3,))
)


def marker_records(columns: Columns, about: Columns) -> Records:
    """The markers of F frames as records.

    Args:
        columns: the frames' columns, of tracking or of reconstruction.
        about: the columns that all frames share.

    Returns:
        (F, M) records of ``IN_SPACE``, ``IN_SPACE_AND_SURFACE`` or ``IN_IMAGE``; NaN where unknown.
    """
    if str(about["format"]) == "cmp-reconstruction":
        return _records_in_space(columns, len(about["layer"]))
    return _records_in_image(columns, about)


def _records_in_space(columns: Columns, markers: int) -> Records:
    has_surface = "surface_displacement_mm" in columns
    records = _empty_records(columns, markers, IN_SPACE_AND_SURFACE if has_surface else IN_SPACE)
    _fill(records, "xyz", columns["3D_Positions"][:, :markers], M_PER_MM)
    _fill(records, ("dx", "dy", "dz"), columns["3D_Displacements"][:, :markers], M_PER_MM)
    _fill(records, ("nx", "ny", "nz"), columns["3D_Normals"][:, :markers], 1.0)
    records["covariance"] = columns["cov_mm2"][:, :markers].astype(np.float64) * M_PER_MM**2
    if has_surface:
        moved = columns["surface_displacement_mm"]
        _fill(records, ("surface_dx", "surface_dy", "surface_dz"), moved, M_PER_MM)
        records["surface_covariance"] = columns["surface_cov_mm2"].astype(np.float64) * M_PER_MM**2
    return records


def _records_in_image(columns: Columns, about: Columns) -> Records:
    """In the plane of the pattern at rest: z and dz are 0 where x and dx are known."""
    records = _empty_records(columns, len(about["layer"]), IN_IMAGE)
    _fill(records, ("x_px", "y_px"), columns["xy_px"], 1.0)
    _fill(records, ("dx_px", "dy_px"), columns["displacement_px"], 1.0)
    _fill(records, ("x", "y"), positions_mm(columns["xy_px"], about), M_PER_MM)
    _fill(records, ("dx", "dy"), columns["displacement_mm"], M_PER_MM)
    records["z"], records["dz"] = 0 * records["x"], 0 * records["dx"]
    records["covariance_px2"] = columns["cov_px2"]
    return records


def positions_mm(xy_px: NDArray[np.float64], about: Columns) -> NDArray[np.float64]:
    """Positions in the frame of ``displacement_mm``.

    Args:
        xy_px: (..., 2) in the image, NaN where lost.
        about: the shared columns of tracking, with the scale or the homography of the rest frame.

    Returns:
        (..., 2) mm, y up: in the layout frame, or with a scale along the image's axes from pixel (0, 0); NaN where
        the rest frame gives no millimetres.
    """
    from extractor.numeric.homographies import mapped

    scale = float(about["mm_per_px"])
    if np.isfinite(scale):
        return xy_px * (scale, -scale)
    return mapped(about["layout_from_image"], xy_px.reshape(-1, 2)).reshape(xy_px.shape)


def _empty_records(columns: Columns, markers: int, kind: np.dtype[Any]) -> Records:
    """Records with ids and statuses; zeros else, also in the padding."""
    records = np.zeros((len(columns["frame"]), markers), kind)
    records["id"] = np.arange(markers)
    records["status"] = columns["status"][:, :markers]
    return records


def _fill(records: Records, names: tuple[str, ...] | str, values: NDArray[Any], factor: float) -> None:
    """Write the last axis of values into one field each; products are rounded once, to float32."""
    for place, name in enumerate(names):
        records[name] = values[..., place].astype(np.float64) * factor
