"""The columns of force, torque and traction in the table of reconstruction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmpdesign.tracking.columns import Columns, by_point

if TYPE_CHECKING:
    from extractor.contact import ContactForce

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
