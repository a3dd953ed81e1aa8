"""The folder laser/: one job a pass in four formats, all passes in one file, the sheet, the coupon, as
made."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cmpdesign.design.design import Design
from cmpdesign.layout.layout import Layout
from cmpdesign.products.laser.as_made import as_made
from cmpdesign.products.laser.as_made_svg import as_made_svg
from cmpdesign.products.laser.coupon.job import coupon
from cmpdesign.products.laser.figures import job_figures, timing
from cmpdesign.products.laser.formats.drawing import Drawing, job_drawing
from cmpdesign.products.laser.formats.dxf import drawing_to_dxf
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.formats.lightburn import drawing_to_lightburn
from cmpdesign.products.laser.formats.svg import drawing_to_svg
from cmpdesign.products.laser.job import make_job
from cmpdesign.products.laser.job_sheet import job_sheet
from cmpdesign.products.laser.refuse import made_findings, path_findings, refuse, setup_findings
from cmpdesign.products.laser.setup import complete
from cmpdesign.products.registry import Made

FOLDER = "laser"
FORMATS: Mapping[str, Callable[[Drawing], str]] = {
    "svg": drawing_to_svg,
    "dxf": drawing_to_dxf,
    "lbrn2": drawing_to_lightburn,
    "gcode": drawing_to_gcode,
}


def product(design: Design, layout: Layout) -> Made:
    """Everything that a shop needs to carve the design's cells.

    Raises:
        DesignError: the machine or material is unknown, or the job would go wrong; every reason in one line.
    """
    job = make_job(design.name, layout, complete(design.laser))
    refuse(setup_findings(design, job))
    refuse(path_findings(job))
    figures = as_made(job)
    warnings = refuse(made_findings(job, figures))
    timings = tuple(timing(job, one) for one in job.passes)
    files: dict[str, str | bytes] = {}
    whole = job_drawing(job)
    drawings = {one.name: whole.only(one) for one in job.passes} | {"job": whole}
    drawings["coupon"], files[f"{FOLDER}/coupon.json"] = coupon(job.setup)
    for name, drawing in drawings.items():
        files |= {f"{FOLDER}/{name}.{suffix}": write(drawing) for suffix, write in FORMATS.items()}
    files[f"{FOLDER}/as-made.svg"] = as_made_svg(job)
    files[f"{FOLDER}/job-sheet.html"] = job_sheet(job, figures, timings)
    return Made(files, job_figures(job, figures, timings), warnings)
