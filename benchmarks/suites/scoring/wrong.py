"""Wrong markers of one reading: under another marker's id, or at a wrong place."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from extractor import Status

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Reading(Protocol):
    """Markers as they are read, such as ``Markers``."""

    @property
    def xy_px(self) -> Floats:
        """(M, 2), NaN where lost."""

    @property
    def status(self) -> NDArray[np.uint8]:
        """(M,), a ``Status`` each."""


class WrongMarkers(NamedTuple):
    """(M,) bool each: reported at the place of another marker; else further off than the tolerance."""

    ids: Bools
    places: Bools

    @property
    def any_kind(self) -> Bools:
        return self.ids | self.places


def wrong_markers(
    reading: Reading, true_px: Floats, tolerance_px: Floats, same_place_px: Floats | None = None
) -> WrongMarkers:
    """The reported markers that are further from their places than a tolerance.

    Args:
        reading: the markers.
        true_px: (M, 2), NaN where not known.
        tolerance_px: (M,); a marker without a place is beyond it.
        same_place_px: (M,) the distance up to which a place is that of another marker; by default the nearest is.
    """
    error_px = np.linalg.norm(reading.xy_px - true_px, axis=1)
    wrong = (reading.status != Status.LOST) & ~(error_px <= tolerance_px)
    ids, numbers = np.zeros_like(wrong), np.flatnonzero(wrong & np.isfinite(reading.xy_px).all(axis=1))
    distance_px = np.linalg.norm(reading.xy_px[numbers][:, None] - true_px, axis=2)
    distance_px[np.isnan(distance_px)] = np.inf
    nearest = distance_px.argmin(axis=1)
    ids[numbers] = nearest != numbers
    if same_place_px is not None:
        ids[numbers] &= distance_px.min(axis=1) < same_place_px[nearest]
    return WrongMarkers(ids, wrong & ~ids)
