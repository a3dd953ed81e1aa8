"""The process sheet of a laser job: every pass with its settings, what is weighed to fill it, and all materials."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.laser.figures import PassTiming
from cmpdesign.products.laser.job import LaserJob, LaserPass
from cmpdesign.products.laser.job_sheet import format_duration
from cmpdesign.products.laser.paths.cavities import burnt_areas_mm2
from cmpdesign.products.materials.silicones import load_silicone
from cmpdesign.products.materials.weighing import (
    Weighing,
    mix_tables,
    mixing_checks,
    silicone_materials,
    weigh,
)
from cmpdesign.products.process_sheet.steps import NeededMaterial, ProcessSheet, Step, Table, materials_table

# A sheet is larger than the job by this margin on every side, to be held and cut off.
SHEET_MARGIN_MM = 10.0
PLATE_MM = 3.0
PICTURE_PX = 900
HOLE_COLOR = "#b8b0a4"
_FOOTNOTE = (
    "* assumed. The value is a field of the material's or the silicone's file: copy templates/materials/NAME.toml or "
    "templates/silicones/NAME.toml, change the value and its source, and name the file (laser.material in the design, "
    "fill_silicone in the material's file)."
)


def fill_volumes_mm3(job: LaserJob) -> dict[str, float]:
    """Volumes of cavities by the name of the pass; the burnt area is quadratic in depth: Simpson's rule is exact."""
    middle = job.front.at_depth(job.setup.depth_mm / 2, job.setup.taper_deg)
    volumes: dict[str, float] = {}
    for laser_pass in job.cell_passes:
        assert laser_pass.cavities is not None
        front, half, back = (
            float(burnt_areas_mm2(laser_pass.cavities, beam).sum()) for beam in (job.front, middle, job.back)
        )
        volumes[laser_pass.name] = job.setup.depth_mm * (front + 4 * half + back) / 6
    return volumes


def weighings(job: LaserJob) -> dict[str, Weighing]:
    """What is weighed by the name of the pass, in the order of filling.

    Raises:
        DesignError: the material names an unknown silicone.
    """
    silicone = load_silicone(
        job.setup.material.fill_silicone.value, f"{job.setup.material.name}: fill_silicone"
    )
    volumes = fill_volumes_mm3(job)
    return {
        each.name: weigh(COLORS[each.color], silicone, volumes[each.name])
        for each in job.cell_passes
        if each.color is not None
    }


def bill_of_materials(job: LaserJob) -> tuple[NeededMaterial, ...]:
    """All that one pad needs."""
    material, extent = job.setup.material, job.extent_mm
    width, height = (
        side + 2 * SHEET_MARGIN_MM for side in (extent.right - extent.left, extent.top - extent.bottom)
    )
    size = f"{width:.0f} x {height:.0f}"
    pins = [
        NeededMaterial(
            f"pin, {job.layout.fiducial_diameter_mm:g} mm", "register", len(job.fiducials_mm), "piece"
        ),
        NeededMaterial(
            f"acrylic plate, {size} x {PLATE_MM:g} mm", "carries the pins and the sheet", 1, "piece"
        ),
    ]
    return (
        NeededMaterial(
            f"{material.name}, {size} x {material.thickness_mm.value:g} mm", "marker layer", 1, "piece"
        ),
        *silicone_materials(weighings(job).values()),
        *(pins if len(job.fiducials_mm) else []),
        NeededMaterial("isopropanol, cups, spatula, cloths without lint, gloves", "consumables", 1, "set"),
    )


def process_sheet(job: LaserJob, timings: tuple[PassTiming, ...], findings: tuple[str, ...]) -> ProcessSheet:
    """The pages, whose pictures are those of ``pass_pictures``."""
    mixes = weighings(job)
    steps = [
        Step(
            "Buy",
            ("All lines of the table are at hand; their part numbers are written in.",),
            (materials_table(bill_of_materials(job)),),
        ),
        Step(
            "Measure the sheet",
            (
                "Burn coupon on a piece of the same sheet; where power, speed and passes are unknown, burn grid first.",
                "Read the photographs: cmpdesign kerf coupon.json photo.jpg, cmpdesign kerf grid.json photo.jpg.",
                "Enter the values into the material's file, and build again.",
            ),
            warnings=findings,
        ),
    ]
    for laser_pass, timing in zip(job.passes, timings, strict=True):
        steps.append(_pass_step(job, laser_pass, timing, mixes.get(laser_pass.name)))
    steps.append(
        Step(
            "Clean and try",
            (
                "Wipe both faces with isopropanol and a cloth without lint; let it dry for 10 minutes.",
                "Look at it through a magnifier: no cell is open, no color lies on another.",
                f"Photograph the {seen_side(job.layout.mirrored)}, which the camera sees.",
                "Read the photograph: cmpdesign verify layout.json photo.png",
            ),
        )
    )
    return ProcessSheet(
        f"Carving and filling {job.name}", (job.setup.material.fumes,), tuple(steps), _FOOTNOTE
    )


def _pass_step(job: LaserJob, laser_pass: LaserPass, timing: PassTiming, mix: Weighing | None) -> Step:
    settings = Table(
        ("file", "power", "speed", "times over", "laser time"),
        (
            (
                laser_pass.name,
                f"{laser_pass.power_percent:g} %",
                f"{laser_pass.speed_mm_s:g} mm/s",
                str(laser_pass.repeats),
                format_duration(timing.time_s),
            ),
        ),
    )
    burn = f"Burn the file {laser_pass.name} (.svg, .dxf, .lbrn2 or .gcode)."
    if mix is None:
        then = (
            "Put the pins in; they stay until the end."
            if laser_pass.kind == "holes"
            else "Take the pad out of its frame."
        )
        return Step(f"Pass {laser_pass.name}", (burn, then), (settings,), pictures=(laser_pass.name,))
    material, silicone = job.setup.material, mix.silicone
    chemistry = material.chemistry
    warnings = (
        ()
        if chemistry.value == silicone.cure
        else (
            f"{silicone.name} may not cure on {material.name}: {silicone.cure} against "
            f"{chemistry.value}{chemistry.mark}; use one chemistry",
        )
    )
    checks = (
        burn,
        "Take the sheet off; push loose pieces and dust out of the cavities; wipe them with isopropanol.",
        *mixing_checks(mix),
        material.fill,
        material.cure,
        "Put the sheet back on the pins.",
    )
    return Step(
        f"Pass {laser_pass.name}: carve and fill {mix.name}",
        checks,
        (settings, *mix_tables(mix)),
        warnings,
        (laser_pass.name,),
    )


def pass_pictures(job: LaserJob) -> dict[str, NDArray[np.uint8]]:
    """Name of a pass -> (H, W, 3) uint8 BGR picture of the sheet after the pass is filled; y of the bed points up."""
    extent = job.extent_mm
    scale = PICTURE_PX / max(extent.right - extent.left, extent.top - extent.bottom)
    corner = np.array([extent.left, extent.top])
    size = round((extent.top - extent.bottom) * scale), round((extent.right - extent.left) * scale)

    def pixels(xy_mm: NDArray[np.float64]) -> NDArray[np.int32]:
        return np.asarray(np.round((xy_mm - corner) * (scale, -scale) * 16), np.int32)

    def fill(canvas: NDArray[np.uint8], shapes: list[NDArray[np.float64]], color: str) -> None:
        bgr = tuple(int(color[place : place + 2], 16) for place in (5, 3, 1))
        for shape in shapes:
            cv2.fillPoly(canvas, [pixels(shape)], bgr, cv2.LINE_AA, 4)

    palette = job.layout.palette
    canvas = np.full((*size, 3), 244, np.uint8)
    fill(canvas, [job.outline_mm], palette["black"])
    pictures = {}
    for laser_pass in job.passes:
        if laser_pass.cavities is not None and laser_pass.color is not None:
            fill(canvas, list(laser_pass.cavities.nominal_mm), palette[COLORS[laser_pass.color]])
        elif laser_pass.kind == "holes":
            fill(canvas, list(laser_pass.walls), HOLE_COLOR)
        pictures[laser_pass.name] = canvas.copy()
    return pictures
