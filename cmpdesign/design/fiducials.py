"""Fiducials: marks outside the pattern that align the passes, prints and molds of a design.

+------------------------+
| o                      |      Three marks in four corners fix the orientation: a pad that is taken out
|        /\\  /\\          |      for filling cannot be put back turned. A fourth mark (count = 4) allows
|       pattern          |      a photo to be rectified. It lies one diameter further out, so that the
|        \\/  \\/          |      corners still differ.
| o                    o |
+------------------------+
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from cmpdesign.design.quantities import Length, LengthOrZero


class Fiducials(BaseModel):
    """The [fiducials] table of a design."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    count: Literal[0, 3, 4] = Field(3, description="Number of marks: 0, 3 or 4.")
    diameter_mm: Length = Field(
        2.0, description="Diameter of a mark; a pin of this diameter fits into the hole."
    )
    gap_mm: LengthOrZero = Field(
        2.0, description="Distance between the pattern's bounding box and a mark's rim."
    )


def fiducial_positions(fiducials: Fiducials, outline_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, 2) centres in mm, layout frame: lower left, lower right, upper left, then upper right.

    Args:
        fiducials: the [fiducials] table.
        outline_mm: (K, 2), the ground's outline.
    """
    distance_mm = fiducials.gap_mm + fiducials.diameter_mm / 2
    left, bottom = outline_mm.min(axis=0) - distance_mm
    right, top = outline_mm.max(axis=0) + distance_mm
    fourth = right + fiducials.diameter_mm, top
    corners = np.array([(left, bottom), (right, bottom), (left, top), fourth])
    return corners[: fiducials.count]
