"""Whether few of the visible markers are reported: the result then has a reason."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MIN_FIT_MARKERS = 3  # for a map from layout to image; derived: three coefficients an axis


def is_less_than_half_reported(
    xy_px: NDArray[np.float64],
    xy_mm: NDArray[np.float64],
    present: NDArray[np.bool_],
    size: tuple[int, int],
) -> bool:
    """Whether fewer than half of the markers that lie within the image are reported.

    An affine map through the reported markers gives the other markers that lie within the image; with fewer than three
    markers, all count.

    Args:
        xy_px: (M, 2) the reported markers, NaN where lost.
        xy_mm: (M, 2) the layout's.
        present: (M,) bool, the markers that can be seen at all.
        size: width and height of the image, px.
    """
    known = np.isfinite(xy_px[:, 0])
    reported = int(np.count_nonzero(known & present))
    if 2 * reported >= int(np.count_nonzero(present)):
        return False
    if np.count_nonzero(known) < MIN_FIT_MARKERS:
        return True
    terms = np.column_stack([xy_mm, np.ones(len(xy_mm))])
    predicted = terms @ np.linalg.lstsq(terms[known], xy_px[known], rcond=None)[0]
    inside = ((predicted >= -0.5) & (predicted <= np.array(size) - 0.5)).all(axis=1)
    return 2 * reported < int(np.count_nonzero((inside | known) & present))
