"""What a reader of forces gets: displacements in space, or in the image of one view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor import ContactForce, ContactReader, View

Array = NDArray[np.float64]
SIGMA_MM = np.array([0.001, 0.001, 0.003])
PX_PER_MM, SIGMA_PX = 14.0, 0.02  # of one view


@dataclass(frozen=True, eq=False)
class Seen:
    """A reader with the noise of its measurements; ``view`` is None for displacements in space."""

    reader: ContactReader
    view: View | None

    def read(self, displacement_mm: Array, random: np.random.Generator, lost: float = 0.0) -> ContactForce:
        """The contact from displacements (M, 3) mm without noise, of which a share is lost."""
        flat_mm = np.pad(self.reader.layout.xy_mm, [(0, 0), (0, 1)])
        sigma, moved = SIGMA_MM, displacement_mm
        if self.view is not None:
            sigma, moved = (
                np.full(2, SIGMA_PX),
                self.view.project(flat_mm + moved) - self.view.project(flat_mm),
            )
        cov = np.tile(np.diag(sigma**2), (len(flat_mm), 1, 1))
        moved = moved + sigma * random.normal(size=moved.shape)
        moved[random.permutation(len(moved))[: round(lost * len(moved))]] = np.nan
        return self.reader.read(moved, cov)


def seen_from(reader: ContactReader, far_mm: float | None) -> Seen:
    """A reader of displacements in space; or, with a distance, of one view straight from behind the pad."""
    if far_mm is None:
        return Seen(reader, None)
    focal, shift = (PX_PER_MM * far_mm,) * 2, (0.0, 0.0, far_mm)
    view = View("one", focal, (0.0, 0.0), R_camera_from_layout=np.eye(3), t_camera_from_layout_mm=shift)
    flat_mm = np.pad(reader.layout.xy_mm, [(0, 0), (0, 1)])
    return Seen(reader.seen(view.linearised(flat_mm).by_point), view)
