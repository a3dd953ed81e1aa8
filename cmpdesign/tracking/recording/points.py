"""Markers as the points of a PointCloud2: records of little-endian numbers in metres, one a marker in id order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.force_table import torque_about_origin

M_PER_MM, PA_PER_MPA = 1e-3, 1e6
Records = NDArray[np.void]


Field = tuple[str, str] | tuple[str, str, tuple[int]]


def _record_type(*fields: Field) -> np.dtype[Any]:
    """A record whose fields are aligned, as in C."""
    return np.dtype([*fields, ("id", "<u4"), ("status", "u1")], align=True)


def _axes(*names: str) -> list[tuple[str, str]]:
    return [(name, "<f4") for name in names]


# Fields of records of reconstruction: metres, square metres; of tracking: metres and pixels. Tractions are in pascals.
_SPACE: tuple[Field, ...] = (*_axes(*"xyz", "dx", "dy", "dz", "nx", "ny", "nz"), ("covariance", "<f4", (6,)))
_SURFACE: tuple[Field, ...] = (
    *_axes("surface_dx", "surface_dy", "surface_dz"),
    ("surface_covariance", "<f4", (6,)),
)
_TRACTION = ("traction_x", "traction_y", "traction_z")
_IMAGE: tuple[Field, ...] = (
    *_axes(*"xyz", "dx", "dy", "dz", "x_px", "y_px", "dx_px", "dy_px"),
    ("covariance_px2", "<f4", (3,)),
)
IN_IMAGE = _record_type(*_IMAGE)
# Records of regions: the centre of pressure, in metres and square metres, the area, force and torque.
REGION = np.dtype(
    [
        *_axes(*"xyz"),
        ("centre_covariance", "<f4", (3,)),
        *_axes("area", "force_x", "force_y", "force_z"),
        ("force_covariance", "<f4", (6,)),
        *_axes("torque_x", "torque_y", "torque_z"),
        ("torque_covariance", "<f4", (6,)),
    ]
)


def marker_records(columns: Columns, about: Columns) -> Records:
    """The markers of F frames as records.

    Args:
        columns: the frames' columns, of tracking or of reconstruction.
        about: the columns that all frames share.

    Returns:
        (F, M) records, with the fields of the columns that are there; NaN where unknown.
    """
    is_in_space = str(about["format"]) == "cmp-reconstruction"
    has_surface, has_traction = "surface_displacement_mm" in columns, "marker_traction_mpa" in columns
    fields = [
        *(_SPACE if is_in_space else _IMAGE),
        *(_SURFACE if has_surface else ()),
        *(_axes(*_TRACTION) if has_traction else ()),
    ]
    records = _empty_records(columns, len(about["layer"]), _record_type(*fields))
    if is_in_space:
        _fill_in_space(records, columns, len(about["layer"]))
    else:
        _fill_in_image(records, columns, about)
    if has_traction:
        _fill(records, _TRACTION, columns["marker_traction_mpa"], PA_PER_MPA)
    return records


def region_records(columns: Columns, about: Columns) -> list[Records]:
    """The regions of F frames as records of ``REGION``, in the markers' frame; torques are about its origin."""
    areas = columns["region_area_mm2"]
    records = np.zeros(areas.shape, REGION)
    depth_mm = float(about["marker_depth_mm"])
    _fill(records, "xy", columns["region_centre_mm"], M_PER_MM)
    records["z"] = depth_mm * M_PER_MM
    records["centre_covariance"] = columns["region_centre_cov_mm2"] * M_PER_MM**2
    records["area"] = areas * M_PER_MM**2
    _fill(records, ("force_x", "force_y", "force_z"), columns["region_force_n"], 1.0)
    records["force_covariance"] = columns["region_force_cov_n2"]
    torque = torque_about_origin(columns["region_torque_nmm"], columns["region_force_n"], about)
    _fill(records, ("torque_x", "torque_y", "torque_z"), torque, M_PER_MM)
    records["torque_covariance"] = columns["region_torque_cov_nmm2"] * M_PER_MM**2
    return [row[np.isfinite(area)] for row, area in zip(records, areas, strict=True)]


def _fill_in_space(records: Records, columns: Columns, markers: int) -> None:
    _fill(records, "xyz", columns["3D_Positions"][:, :markers], M_PER_MM)
    _fill(records, ("dx", "dy", "dz"), columns["3D_Displacements"][:, :markers], M_PER_MM)
    _fill(records, ("nx", "ny", "nz"), columns["3D_Normals"][:, :markers], 1.0)
    records["covariance"] = columns["cov_mm2"][:, :markers].astype(np.float64) * M_PER_MM**2
    if "surface_displacement_mm" in columns:
        moved = columns["surface_displacement_mm"]
        _fill(records, ("surface_dx", "surface_dy", "surface_dz"), moved, M_PER_MM)
        records["surface_covariance"] = columns["surface_cov_mm2"].astype(np.float64) * M_PER_MM**2


def _fill_in_image(records: Records, columns: Columns, about: Columns) -> None:
    """In the plane of the pattern at rest: z and dz are 0 where x and dx are known."""
    _fill(records, ("x_px", "y_px"), columns["xy_px"], 1.0)
    _fill(records, ("dx_px", "dy_px"), columns["displacement_px"], 1.0)
    _fill(records, ("x", "y"), positions_mm(columns["xy_px"], about), M_PER_MM)
    _fill(records, ("dx", "dy"), columns["displacement_mm"], M_PER_MM)
    records["z"], records["dz"] = 0 * records["x"], 0 * records["dx"]
    records["covariance_px2"] = columns["cov_px2"]


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
