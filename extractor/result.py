"""The result of extraction, and the reasons for finding little or nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.frozen_record import FrozenRecord


class Status(IntEnum):
    """How a marker's position was found."""

    LOST = 0
    MEASURED = 1
    REPAIRED = 2  # mild omission, eq. 6
    FITTED = 3  # heavy omission, quadratic fit within the marker's layer


class VirtualStatus(IntEnum):
    """How a virtual marker's position was found."""

    LOST = 0
    MEASURED = 1
    INTERPOLATED = 2


class Origin(StrEnum):
    """The evidence that fixed where the numbering begins."""

    WHITE = "white"  # the white cell
    OUTLINE = "outline"  # the pattern's rim, as the white cell is hidden
    PREVIOUS = "previous"  # the frame before, as the white cell is hidden


class Reason(StrEnum):
    """Why nothing, or little, was found in an image."""

    NO_COLOR = "no_color"  # the image is grayscale, or one of the three inks is absent
    NO_PATTERN = "no_pattern"  # no triangles that meet as in a pattern
    REFERENCE_LOST = "reference_lost"  # a pattern whose white cell is not visible
    AMBIGUOUS = "ambiguous"  # more than one cell could be the reference
    SEVERAL_PADS = "several_pads"  # several white cells, each with the cells around it that a pattern has


@dataclass(frozen=True, eq=False)
class Markers(FrozenRecord):
    """The M markers of one image by id, and m virtual markers on each of E edges. Can be pickled and copied.

    Attributes:
        xy_px: (M, 2) float64 in the image frame ((0, 0) is the centre of the top-left pixel), NaN where lost.
        cov_px2: (M, 2, 2) float64, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
        virtual_xy_px: (E, m, 2) float64, in the order of the layout's edges, from the smaller id; NaN where lost.
        virtual_cov_px2: (E, m, 2, 2) float64, NaN where lost.
        virtual_status: (E, m) uint8, a ``VirtualStatus`` each: measured across the gridline (every virtual marker is
            interpolated along it), or interpolated only.
        mirrored: whether the image shows the pattern's back; None when nothing was found.
        reason: why nothing or little was found; None when all went well.
        timings_ms: stage name -> milliseconds, read-only.
        stages: stage name -> that stage's result, for debugging and drawing, read-only.
        origin: the evidence that fixed the numbering; None when nothing was found.
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

    def __post_init__(self) -> None:
        self._freeze_mappings("timings_ms", "stages")
