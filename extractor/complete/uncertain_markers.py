"""Uncertain markers, as under dirt: the measurement is combined with the prediction by other markers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native


class UncertainLimits(NamedTuple):
    """Limits of uncertain markers.

    Attributes:
        deviation: in edges, of a marker that others may predict better: at best to 0.012. Measured: rule "fusion".
    """

    deviation: float = 0.02


LIMITS = UncertainLimits()


def find_uncertain_markers(
    cov_px2: NDArray[np.float64], edge_px: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], bool]:
    """(M,) bool, the uncertain markers by their covariances (M, 2, 2) and edges (M,); and whether there are any."""
    uncertain, is_any = native.find_uncertain_markers(cov_px2, edge_px, LIMITS)
    return np.asarray(uncertain), bool(is_any)
