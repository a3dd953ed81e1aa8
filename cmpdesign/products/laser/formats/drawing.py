"""What the file formats write: passes on layers, fiducials beside them. Formats know nothing of layouts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cmpdesign.products.laser.formats.laser_layers import LaserLayer, job_layers
from cmpdesign.products.laser.job import LaserJob, LaserPass
from cmpdesign.products.laser.paths.beam import Points
from cmpdesign.products.laser.setup import LaserSetup


@dataclass(frozen=True, eq=False)
class LaserDrawing:
    """Passes on the bed, in mm, origin at its lower left corner.

    Attributes:
        name: for comments.
        setup: machine and settings.
        passes: in burning order.
        layers: pass name -> layer.
        fiducials_mm: (F, 2) centres; not burnt, but there to align by.
        fiducial_diameter_mm: their diameter.
    """

    name: str
    setup: LaserSetup
    passes: tuple[LaserPass, ...]
    layers: Mapping[str, LaserLayer]
    fiducials_mm: Points
    fiducial_diameter_mm: float

    def with_one_pass(self, one: LaserPass) -> LaserDrawing:
        """The same with one pass."""
        return replace(self, passes=(one,))

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top of all paths and fiducials."""
        radius = self.fiducial_diameter_mm / 2
        marks = [self.fiducials_mm - radius, self.fiducials_mm + radius]
        points = np.concatenate([one.walls.xy_mm for one in self.passes] + marks)
        left, bottom = points.min(axis=0).tolist()
        right, top = points.max(axis=0).tolist()
        return left, bottom, right, top


def job_drawing(job: LaserJob) -> LaserDrawing:
    """All passes of a job."""
    return LaserDrawing(
        name=job.name,
        setup=job.setup,
        passes=job.passes,
        layers=job_layers(job),
        fiducials_mm=np.round(job.fiducials_mm, 4),
        fiducial_diameter_mm=job.layout.fiducial_diameter_mm,
    )
