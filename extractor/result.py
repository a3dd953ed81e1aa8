"""What extraction returns, and what it says when it finds little or nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Status(IntEnum):
    """How a marker's position was found."""

    LOST = 0
    MEASURED = 1
    REPAIRED = 2  # mild omission, eq. 6
    FITTED = 3  # heavy omission, quadratic fit within its layer


class VirtualStatus(IntEnum):
    """How a virtual marker's position was found."""

    LOST = 0
    MEASURED = 1
    INTERPOLATED = 2


class Origin(StrEnum):
    """What told where the numbering begins."""

    WHITE = "white"  # the white cell
    OUTLINE = "outline"  # it is hidden, and the pattern's rim leaves one way only
    PREVIOUS = "previous"  # it is hidden, and the frame before leaves one way only


class Reason(StrEnum):
    """Why nothing, or little, was found in an image."""

    NO_COLOR = "no_color"  # the image is grayscale, or one of the three inks is absent
    NO_PATTERN = "no_pattern"  # no triangles that meet as those of a pattern do
    REFERENCE_LOST = "reference_lost"  # a pattern, but its white cell is not to be seen
    AMBIGUOUS = "ambiguous"  # more than one cell could be the reference


@dataclass(frozen=True, eq=False)
class Markers:
    """The markers of one image, by id.

    Attributes:
        xy_px: (M, 2) float64 in the image frame ((0, 0) is the centre of the top-left pixel), NaN where lost.
        cov_px2: (M, 2, 2) float64, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
        virtual_xy_px: (E, m, 2) float64, in the order of the layout's edges, from the smaller id; NaN where lost.
        virtual_cov_px2: (E, m, 2, 2) float64, NaN where lost.
        virtual_status: (E, m) uint8, a ``VirtualStatus`` each: measured across the gridline (along it, every virtual
            marker is interpolated), or interpolated only.
        mirrored: the pattern is seen from its back; None when nothing was found.
        reason: why nothing or little was found; None when all went well.
        timings_ms: stage name -> milliseconds.
        stages: stage name -> that stage's result, for debugging and drawing.
        origin: what told where the numbering begins; None when nothing was found.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]
    virtual_xy_px: NDArray[np.float64]
    virtual_cov_px2: NDArray[np.float64]
    virtual_status: NDArray[np.uint8]
    mirrored: bool | None
    reason: Reason | None
    timings_ms: Mapping[str, float]
    stages: Mapping[str, Any] = field(default_factory=dict, repr=False)
    origin: Origin | None = None
