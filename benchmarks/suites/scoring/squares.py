"""Squared errors over covariances (d2) of the markers of one picture, by how their positions were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scoring.calibration import Calibration, squared_distances, summarise
from extractor import Markers, Status, VirtualStatus

MEASURED, VIRTUAL_MEASURED = "measured", "virtual, measured"
MARKER_STATUS = {MEASURED: Status.MEASURED, "repaired": Status.REPAIRED, "fitted": Status.FITTED}
VIRTUAL_STATUS = {
    VIRTUAL_MEASURED: VirtualStatus.MEASURED,
    "virtual, interpolated": VirtualStatus.INTERPOLATED,
}
POSITIONS = (*MARKER_STATUS, *VIRTUAL_STATUS)
PictureSquares = Mapping[str, NDArray[np.float64]]  # by POSITIONS: (N,) d2 each


class TruePositions(Protocol):
    """The true positions in px, such as those of a scene's ``Truth``; NaN where not known."""

    @property
    def marker_xy_px(self) -> NDArray[np.float64]:
        """(M, 2)."""

    @property
    def virtual_xy_px(self) -> NDArray[np.float64]:
        """(E, m, 2), in the order of the layout's edges."""


def picture_squares(markers: Markers, truth: TruePositions) -> dict[str, NDArray[np.float64]]:
    """The d2 of all reported markers and virtual markers by ``POSITIONS``, (N,) each. Wrong markers are included."""
    marker_d2 = squared_distances(markers.xy_px - truth.marker_xy_px, markers.cov_px2)
    virtual_error = (markers.virtual_xy_px - truth.virtual_xy_px).reshape(-1, 2)
    virtual_d2 = squared_distances(virtual_error, markers.virtual_cov_px2.reshape(-1, 2, 2))
    virtual_status = markers.virtual_status.ravel()
    return {
        **{name: marker_d2[markers.status == status] for name, status in MARKER_STATUS.items()},
        **{name: virtual_d2[virtual_status == status] for name, status in VIRTUAL_STATUS.items()},
    }


def nearest_truth(markers: Markers, truths: Sequence[TruePositions]) -> TruePositions:
    """The pattern that was read, of several patterns in a picture: the pattern with the smallest median error."""

    def median_px(truth: TruePositions) -> float:
        error_px = np.linalg.norm(markers.xy_px - truth.marker_xy_px, axis=1)
        known = error_px[np.isfinite(error_px)]
        return float(np.median(known)) if len(known) else np.inf

    return min(truths, key=median_px)


def calibrations_by_position(pictures: Sequence[PictureSquares]) -> dict[str, Calibration]:
    """The calibration of all pictures by ``POSITIONS``, without kinds that no picture has."""
    found = {
        name: summarise([squares[name] for squares in pictures if name in squares]) for name in POSITIONS
    }
    return {name: calibration for name, calibration in found.items() if calibration.count}
