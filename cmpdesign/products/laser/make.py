"""The product "laser": a file per pass and one of all passes in four formats, sheets, coupon, grid, as-made.svg."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from cmpdesign.design.design import Design
from cmpdesign.files.images import to_png
from cmpdesign.layout.checks import Finding
from cmpdesign.layout.layout import Layout
from cmpdesign.products.laser.as_made import PassFigures, made_pad, measure_as_made
from cmpdesign.products.laser.as_made_svg import as_made_svg
from cmpdesign.products.laser.checks import as_made_findings, path_findings, require_no_errors, setup_findings
from cmpdesign.products.laser.coupon.job import coupon_job
from cmpdesign.products.laser.figures import job_figures, pass_timing
from cmpdesign.products.laser.formats.drawing import LaserDrawing, job_drawing
from cmpdesign.products.laser.formats.dxf import drawing_to_dxf
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.formats.lightburn import drawing_to_lightburn
from cmpdesign.products.laser.formats.svg import drawing_to_svg
from cmpdesign.products.laser.grid.job import grid_job
from cmpdesign.products.laser.job import LaserJob, make_job
from cmpdesign.products.laser.job_sheet import job_sheet_html
from cmpdesign.products.laser.process_sheet import bill_of_materials, pass_pictures, process_sheet
from cmpdesign.products.laser.setup import complete_setup
from cmpdesign.products.process_sheet.html import sheet_to_html
from cmpdesign.products.process_sheet.pdf import sheet_to_pdf
from cmpdesign.products.process_sheet.steps import materials_csv
from cmpdesign.products.registry import PreparedProduct, ProductFiles
from cmpdesign.watch import tell

FOLDER = "laser"
FORMATS: Mapping[str, Callable[[LaserDrawing], str]] = {
    "svg": drawing_to_svg,
    "dxf": drawing_to_dxf,
    "lbrn2": drawing_to_lightburn,
    "gcode": drawing_to_gcode,
}


def prepare_laser(design: Design, layout: Layout) -> PreparedProduct:
    """The folder ``laser/`` and the pad as carved.

    Raises:
        DesignError: the machine or material is unknown, or a check of the job fails; every reason in one line.
    """
    job = make_job(design.name, layout, complete_setup(design.laser))
    warnings = require_no_errors(setup_findings(design, job))
    figures = measure_as_made(job)
    warnings += require_no_errors(as_made_findings(job, figures))
    return PreparedProduct(partial(_make_laser, job, figures, warnings), made_pad(job))


def _make_laser(
    job: LaserJob, figures: tuple[PassFigures, ...], warnings: tuple[Finding, ...]
) -> ProductFiles:
    """Make the files.

    Raises:
        DesignError: a check of the paths fails.
    """
    require_no_errors(path_findings(job))
    drawn = len(job.passes) + 3  # a drawing a pass, one of all, coupon and grid
    tell(2, drawn + 3)
    timings = tuple(pass_timing(job, laser_pass) for laser_pass in job.passes)
    files: dict[str, str | bytes] = {}
    all_passes = job_drawing(job)
    drawings = {laser_pass.name: all_passes.with_one_pass(laser_pass) for laser_pass in job.passes}
    drawings["job"] = all_passes
    drawings["coupon"], files[f"{FOLDER}/coupon.json"] = coupon_job(job.setup)
    drawings["grid"], files[f"{FOLDER}/grid.json"] = grid_job(job.setup)
    for number, (name, drawing) in enumerate(drawings.items(), start=1):
        files |= {f"{FOLDER}/{name}.{suffix}": write(drawing) for suffix, write in FORMATS.items()}
        tell(2 + number, drawn + 3)
    files[f"{FOLDER}/as-made.svg"] = as_made_svg(job)
    files[f"{FOLDER}/job-sheet.html"] = job_sheet_html(job, figures, timings, drawings["coupon"])
    pictures = {name: to_png(picture) for name, picture in pass_pictures(job).items()}
    files |= {f"{FOLDER}/pictures/{name}.png": png for name, png in pictures.items()}
    sheet = process_sheet(job, timings, tuple(map(str, warnings)))
    files[f"{FOLDER}/process-sheet.html"] = sheet_to_html(sheet, "pictures")
    files[f"{FOLDER}/process-sheet.pdf"] = sheet_to_pdf(sheet, pictures)
    files[f"{FOLDER}/materials.csv"] = materials_csv(bill_of_materials(job))
    made = ProductFiles(files, job_figures(job, figures, timings), warnings)
    tell(drawn + 3, drawn + 3)
    return made
