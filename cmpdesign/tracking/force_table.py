"""The columns of force, torque, regions and traction, of tracking and of reconstruction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cmpdesign.tracking.columns import AXES, COVARIANCE, UPPER, Columns, by_point

if TYPE_CHECKING:
    from extractor.contact import ContactForce, ContactReader

Array = NDArray[np.float64]
MAX_REGIONS = 8  # of a frame in the columns of regions, the largest force first
FORCE_DIGITS: Mapping[str, int] = (
    {"contact_reason": 0, "contact_regions": 0, "utilisation": 4}
    | {f"force_{axis}_n": 6 for axis in AXES}
    | {f"force_cov_{name}_n2": 12 for name in COVARIANCE}
    | {f"torque_{axis}_nmm": 6 for axis in AXES}
    | {f"torque_cov_{name}_nmm2": 12 for name in COVARIANCE}
    | {f"traction_{axis}_mpa": 7 for axis in AXES}
)
# Columns of runs with a contact, beside the regions', that exports of runs take over.
FORCE_COLUMNS = (
    "contact_reason", "force_n", "force_cov_n2", "torque_nmm", "torque_cov_nmm2", "utilisation", "marker_traction_mpa",
)  # fmt: skip
# Column -> shape of one region's values.
REGION_COLUMNS: Mapping[str, tuple[int, ...]] = {
    "region_area_mm2": (),
    "region_area_sigma_mm2": (),
    "region_centre_mm": (2,),
    "region_centre_cov_mm2": (3,),
    "region_force_n": (3,),
    "region_force_cov_n2": (6,),
    "region_torque_nmm": (3,),
    "region_torque_cov_nmm2": (6,),
}


def force_columns(found: Sequence[ContactForce]) -> Columns:
    """The columns of F frames: by frame, by region, and ``marker_traction_mpa`` (F, M, 3) on the touched surface."""
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
        **_region_columns(found),
        "marker_traction_mpa": np.stack([one.marker_traction_mpa for one in found]).astype(np.float32),
    }


def _region_columns(found: Sequence[ContactForce]) -> Columns:
    """(F, MAX_REGIONS, ...) of every column of regions; NaN beyond a frame's last region."""
    columns: Columns = {
        name: np.full((len(found), MAX_REGIONS, *shape), np.nan) for name, shape in REGION_COLUMNS.items()
    }
    for row, one in enumerate(found):
        for place, region in enumerate(one.regions[:MAX_REGIONS]):
            for name, shape in REGION_COLUMNS.items():
                value = np.asarray(getattr(region, name.removeprefix("region_")))
                if value.ndim == 2:
                    value = value[np.triu_indices(len(value))]
                columns[name][row, place] = value.reshape(shape)
    return columns


def force_about(reader: ContactReader) -> Columns:
    """The shared columns of a run with a contact."""
    return {
        "young_mpa": np.array(reader.young_mpa),
        "torque_about_mm": reader.about_mm,
        "marker_depth_mm": np.array(reader.gel.marker_depth_mm),
    }


def force_long_form(columns: Columns, count: int) -> Columns:
    """The columns of frames for one row of every frame and point; a frame's values stand in all its rows."""
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


def torque_about_origin(torque_nmm: Array, force_n: Array, about: Columns) -> Array:
    """(..., 3) N mm about the origin of the markers' frame, which lies in the plane of the pattern.

    Args:
        torque_nmm, force_n: (..., 3), the torques about the point of the run.
        about: the shared columns of the run.
    """
    origin_mm = np.array([0.0, 0.0, -float(about["marker_depth_mm"])])
    return np.asarray(torque_nmm + np.cross(about["torque_about_mm"] - origin_mm, force_n))
