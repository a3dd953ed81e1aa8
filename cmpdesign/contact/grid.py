"""The grid of a contact: square cells, centred on the layout frame's origin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.errors import require

Array = NDArray[np.float64]
MIN_CELLS, MAX_CELLS = 8, 2048


@dataclass(frozen=True)
class ContactGrid:
    """Centres of square cells of side ``step_mm``: ``x_mm`` (nx,) and ``y_mm`` (ny,), both ascending."""

    x_mm: Array
    y_mm: Array
    step_mm: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns (ny, nx)."""
        return len(self.y_mm), len(self.x_mm)

    @property
    def xy_mm(self) -> Array:
        """All centres, (2, ny, nx)."""
        return np.stack(np.meshgrid(self.x_mm, self.y_mm))


def make_contact_grid(size_mm: tuple[float, float], cells: int) -> ContactGrid:
    """A grid over ``size_mm`` (width, height) with ``cells`` along its longer side.

    Raises:
        ContactError: a size is not positive, or there are too few or too many cells.
    """
    good = len(size_mm) == 2 and all(math.isfinite(side) and side > 0 for side in size_mm)
    require(good, "size_mm", size_mm, "two lengths above 0 mm, width and height")
    whole = isinstance(cells, int) and not isinstance(cells, bool) and MIN_CELLS <= cells <= MAX_CELLS
    require(whole, "grid", cells, f"a whole number of cells from {MIN_CELLS} to {MAX_CELLS}")
    step = max(size_mm) / cells
    nx, ny = (max(1, round(side / step)) for side in size_mm)
    require(
        min(nx, ny) >= MIN_CELLS, "size_mm", size_mm, f"at least {MIN_CELLS} cells of {step:.3g} mm both ways"
    )
    x, y = (np.asarray(step * (np.arange(n) - (n - 1) / 2), dtype=np.float64) for n in (nx, ny))
    return ContactGrid(x, y, step)
