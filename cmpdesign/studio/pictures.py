"""Pictures of the products: the pad as the camera sees it, and the paths of the laser with their times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmpdesign.files.images import to_png
from cmpdesign.patterns.colors import COLORS
from cmpdesign.studio.designs import Look, design_of

BLUR_PX = 1.0
_DECIMALS = 3  # of a path on the screen, mm


def seen_picture(asked: Mapping[str, Any]) -> bytes:
    """The pad as a camera sees it whose picture the pattern fills, as PNG.

    Raises:
        DesignError: see ``design_of``.
    """
    from cmpdesign.products.as_made.reading import filling_view
    from cmpdesign.scene import Camera, Optics, Scene, render

    layout, look = design_of(asked.get("fields")).layout, Look.of(asked)
    camera_turn_deg, scale = filling_view(layout, look.camera_px)
    camera = Camera(scale * float(layout.parameters["pitch_mm"]), camera_turn_deg)
    return to_png(render(Scene(layout, camera, optics=Optics(BLUR_PX)), size=look.camera_px).image)


def laser_document(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The passes of the laser job of a design in burning order: paths, times, and the cells as made.

    Places are in mm on a drawing with y down, from the top left of the job's extent. ``begin_s`` are the starts of the
    strokes of one repeat; the beam travels from the end of a stroke to the start of the next.

    Raises:
        DesignError: see ``design_of``; or a job that cannot be.
        MissingLibraryError: the extra of laser jobs is not installed.
    """
    import numpy as np

    from cmpdesign.products.laser.figures import pass_timing
    from cmpdesign.products.laser.job import make_job
    from cmpdesign.products.laser.make import laser_pad
    from cmpdesign.products.laser.paths.timing import begin_times_s
    from cmpdesign.products.laser.setup import complete_setup

    design = design_of(asked.get("fields"))
    job = make_job(design.name, design.layout, complete_setup(design.laser))
    machine, (left, _, _, top) = job.setup.machine, job.extent_mm

    def drawn(xy_mm: Any) -> Any:
        return np.round((xy_mm - (left, top)) * (1, -1), _DECIMALS).tolist()

    passes = []
    for one in job.passes:
        strokes = one.burn_strokes(0)
        times = begin_times_s(
            strokes, one.speed_mm_s, machine.travel_mm_s.value, machine.acceleration_mm_s2.value
        )
        passes.append(
            {
                "name": one.name,
                "color": "#808080" if one.color is None else job.layout.palette[COLORS[one.color]],
                "strokes": [drawn(stroke) for stroke in strokes],
                "begin_s": times[0].round(4).tolist(),
                "end_s": round(times[1], 4),
                "repeats": one.repeats,
                "time_s": pass_timing(job, one).time_s,
            }
        )
    made = laser_pad(design, design.layout).layout.colored_outlines_mm + job.origin_mm
    return {
        "passes": passes,
        "size_mm": [job.extent_mm.right - left, top - job.extent_mm.bottom],
        "made": [drawn(ring) for ring in made],
        "kerf_mm": job.setup.kerf_x_mm,
        "assumed": list(job.setup.assumed),
    }
