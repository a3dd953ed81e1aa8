"""The input of the file formats: passes on laser layers, and fiducials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cmpdesign.products.laser.formats.laser_layers import LaserLayer, job_layers
from cmpdesign.products.laser.job import Extent, LaserJob, LaserPass
from cmpdesign.products.laser.paths.beam import Points
from cmpdesign.products.laser.setup import LaserSetup


@dataclass(frozen=True, eq=False)
class LaserDrawing:
    """Passes on the bed, in mm, origin at its lower left corner.

    Attributes:
        name: name for comments in the files.
        setup: machine and settings.
        passes: passes in burning order.
        laser_layers: pass name -> laser layer.
        fiducials_mm: (F, 2) centres of the fiducials, which serve for alignment and are not burnt.
        fiducial_diameter_mm: diameter of the fiducials.
    """

    name: str
    setup: LaserSetup
    passes: tuple[LaserPass, ...]
    laser_layers: Mapping[str, LaserLayer]
    fiducials_mm: Points
    fiducial_diameter_mm: float

    def with_one_pass(self, laser_pass: LaserPass) -> LaserDrawing:
        """The drawing with one of its passes."""
        return replace(self, passes=(laser_pass,))

    @property
    def extent_mm(self) -> Extent:
        """The bounding box of all paths and fiducials."""
        radius = self.fiducial_diameter_mm / 2
        marks = [self.fiducials_mm - radius, self.fiducials_mm + radius]
        points = np.concatenate([laser_pass.walls.xy_mm for laser_pass in self.passes] + marks)
        left, bottom = points.min(axis=0).tolist()
        right, top = points.max(axis=0).tolist()
        return Extent(left, bottom, right, top)


def job_drawing(job: LaserJob) -> LaserDrawing:
    """The drawing of all passes of a job."""
    return LaserDrawing(
        name=job.name,
        setup=job.setup,
        passes=job.passes,
        laser_layers=job_layers(job),
        fiducials_mm=np.round(job.fiducials_mm, 4),
        fiducial_diameter_mm=job.layout.fiducial_diameter_mm,
    )
