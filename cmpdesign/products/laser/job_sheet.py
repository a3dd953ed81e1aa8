"""The job sheet of a laser job: one HTML page without scripts, fonts or other files."""

from __future__ import annotations

from html import escape

import numpy as np

from cmpdesign.layout.side import seen_side
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.laser.as_made import FaceFigures, PassFigures
from cmpdesign.products.laser.figures import PassTiming
from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import format_mm
from cmpdesign.products.laser.formats.svg import path_data
from cmpdesign.products.laser.job import LaserJob, LaserPass

_STYLE = """
@page { size: A4; margin: 14mm }
body { font: 10.5pt/1.4 system-ui, sans-serif; color: #1c1a18; max-width: 182mm; margin: 8mm auto }
h1 { font-size: 18pt; margin: 0 } h2 { font-size: 12.5pt; margin: 7mm 0 2mm; border-bottom: .3mm solid #1c1a18 }
p { margin: 1.5mm 0 } table { border-collapse: collapse; width: 100% } .facts td:first-child { width: 42mm }
td, th { text-align: left; padding: .9mm 2mm; border-bottom: .15mm solid #bbb; vertical-align: top }
th { font-weight: 600 } td.n, th.n, td b { white-space: nowrap }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums }
.passes { display: grid; grid-template-columns: 1fr 1fr; gap: 6mm } .pass { break-inside: avoid }
.pass h3 { margin: 0 0 1mm; font-size: 11pt } .pass svg { width: 100%; max-height: 78mm; background: #f4f2ee }
.warn { border: .5mm solid #b3261e; padding: 2mm 3mm; margin: 3mm 0 } .box { font-size: 12pt }
ol { margin: 1mm 0; padding-left: 6mm } small { color: #5c5650 }
"""

_CORNERS = {
    "plain": "Plain corners: the beam leaves up to half a kerf of every 60 degree corner; cells are smaller by "
    "this area (2.05 r² a triangle, r being half the kerf).",
    "overcut": "Overcut corners: a short spur runs into every corner. The area burnt beside the cell equals the area "
    "left at the tip; cells keep their area. Choose plain where the neighbour must not be touched.",
}


def job_sheet_html(
    job: LaserJob, figures: tuple[PassFigures, ...], timings: tuple[PassTiming, ...], coupon: LaserDrawing
) -> str:
    """Format the page.

    Args:
        job: the job.
        figures: figures of every pass of cells.
        timings: time of every pass, in burning order.
        coupon: the drawing of the coupon.
    """
    lines = [
        "<!doctype html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(job.name)}: laser job</title>',
        f"<style>{_STYLE}</style></head><body>",
        f"<h1>{escape(job.name)}: laser job</h1>",
        _uncompensated_html(job),
        _warning_html(job),
        _facts_html(job, timings),
        "<h2>Order of work</h2>",
        _passes_html(job, timings),
        "<h2>Passes</h2>",
        _pictures_html(job),
        "<h2>As made</h2>",
        _corners_html(job),
        _as_made_html(figures),
        "<h2>Coupon</h2>",
        _coupon_html(coupon),
        "<h2>Registration</h2>",
        _registration_html(job),
        f"<p><small>Layout {job.layout.digest[:16]}. {escape(job.setup.material.fumes)}</small></p>",
        "</body></html>",
        "",
    ]
    return "\n".join(lines)


def format_duration(seconds: float) -> str:
    """Format a duration: 48 s, 3 min 20 s, 2 h 05 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def _warning_html(job: LaserJob) -> str:
    if not job.setup.assumed:
        return ""
    names = escape(", ".join(job.setup.assumed))
    return (
        f'<div class="warn"><b>Not measured yet:</b> {names}. Cut <code>coupon</code> in this material first, '
        "photograph the coupon, and read the photo with <code>cmpdesign kerf</code>.</div>"
    )


def _uncompensated_html(job: LaserJob) -> str:
    if job.setup.compensated:
        return ""
    return (
        '<div class="warn"><b>Not compensated for the kerf</b> (laser.kerf_mm = 0): paths are the nominal outlines. '
        "Set the compensation in the laser's program: half the kerf inward for cells and holes, outward for the pad's "
        "outline. Without this compensation, cells and holes are one kerf too wide.</div>"
    )


def _corners_html(job: LaserJob) -> str:
    if job.setup.compensated:
        return f"<p>{_CORNERS[job.setup.options.corner]}</p>"
    return "<p>The nominal outlines, which the laser's program has to compensate.</p>"


def _facts_html(job: LaserJob, timings: tuple[PassTiming, ...]) -> str:
    setup, extent = job.setup, job.extent_mm
    bed = f"{setup.machine.bed_width_mm.value:g} x {setup.machine.bed_height_mm.value:g} mm"
    rows = {
        "Machine": f"{setup.machine.name}, bed {bed}, full power S{setup.machine.s_max.value:g}",
        "Material": f"{setup.material.name}, {setup.material.thickness_mm.value:g} mm",
        "Cavities": f"{setup.options.mode}, {setup.depth_mm:g} mm deep, {setup.options.corner} corners, "
        f"nominal size at the {job.nominal_face}; the camera sees the {seen_side(job.layout.mirrored)}"
        if setup.compensated
        else f"{setup.options.mode}, {setup.depth_mm:g} mm deep",
        "Kerf": f"front {_format_kerf(job.front.kerf_mm)}, back {_format_kerf(job.back.kerf_mm)} (cuts "
        f"along y, along x); "
        f"walls have a taper of {setup.taper_deg:g}°"
        if setup.compensated
        else "not compensated: paths are the nominal outlines",
        "On the bed": f"{extent.right - extent.left:.2f} x {extent.top - extent.bottom:.2f} mm, "
        f"lower left corner at X{extent.left:.2f} Y{extent.bottom:.2f}",
        "Laser time": format_duration(sum(timing.time_s for timing in timings))
        + f", order: {setup.options.order}",
    }
    lines = [f"<tr><td>{name}</td><td>{escape(text)}</td></tr>" for name, text in rows.items()]
    return f'<table class="facts">{"".join(lines)}</table>'


def _passes_html(job: LaserJob, timings: tuple[PassTiming, ...]) -> str:
    head = (
        "<tr><th></th><th>Pass</th><th class=n>Paths</th><th class=n>Power</th><th class=n>Speed</th>"
        "<th class=n>Times over</th><th class=n>Laser time</th><th>Then</th></tr>"
    )
    rows = []
    for laser_pass, timing in zip(job.passes, timings, strict=True):
        rows.append(
            f"<tr><td class=box>☐</td><td><b>{laser_pass.name}</b></td>"
            f"<td class=n>{len(laser_pass.walls)}</td><td class=n>{laser_pass.power_percent:g} %</td>"
            f"<td class=n>{laser_pass.speed_mm_s:g} mm/s</td><td class=n>{laser_pass.repeats}</td>"
            f"<td class=n>{format_duration(timing.time_s)}</td><td>{_after_pass_text(laser_pass)}</td></tr>"
        )
    setup = job.setup
    return (
        f"<table>{head}{''.join(rows)}</table>"
        "<p>Each pass is a file of its name for every program: .svg, .dxf, .lbrn2 (LightBurn), .gcode (GRBL); job.* "
        "holds all passes, one layer each.</p>"
        f"<p><b>Fill.</b> {escape(setup.material.fill)}</p><p><b>Cure.</b> {escape(setup.material.cure)}</p>"
        f"{_pocket_html(job)}"
    )


def _after_pass_text(laser_pass: LaserPass) -> str:
    if laser_pass.kind == "holes":
        return "put the pins in; the pins stay until the end"
    if laser_pass.kind == "outline":
        return "take the pad out, done"
    assert laser_pass.color is not None
    return f"take out, fill <b>{COLORS[laser_pass.color]}</b>, cure, put back on the pins"


def _pocket_html(job: LaserJob) -> str:
    options = job.setup.options
    if options.mode != "pocket":
        return ""
    text = f"pitch {format_mm(job.setup.hatch_mm)} mm"
    if options.fill == "hatch":
        text += f", {options.hatch_deg:g}° and {options.hatch_turn_deg:g}° further at every repeat"
        text += "; the G-code holds the lines, in SVG and DXF set them as the fill of the outlines"
    return f"<p><b>Pocket.</b> {options.fill}, {text}.</p>"


def _pictures_html(job: LaserJob) -> str:
    return f'<div class="passes">{"".join(_pass_picture_svg(job, laser_pass) for laser_pass in job.passes)}</div>'


def _pass_picture_svg(job: LaserJob, laser_pass: LaserPass) -> str:
    """The pad during a pass: cells of earlier passes pale, cells of this pass in full color under their paths."""
    extent = job.extent_mm
    width, height, margin = extent.right - extent.left, extent.top - extent.bottom, 1.0
    box = f"{format_mm(extent.left - margin)} {format_mm(-margin)} {format_mm(width + 2 * margin)} "
    box += format_mm(height + 2 * margin)
    inks = job.layout.palette
    shapes = [_polygons_svg([job.outline_mm], extent.top, inks[COLORS[BLACK]], "")]
    for other in job.passes[: job.passes.index(laser_pass) + 1]:
        if other.cavities is None or other.color is None:
            continue
        opacity = "" if other is laser_pass else ' opacity="0.45"'
        ink = inks[COLORS[other.color]]
        shapes.append(_polygons_svg(list(other.cavities.nominal_mm), extent.top, ink, opacity))
    line = 0.004 * max(width, height)
    style = f'fill="none" stroke="#e0a100" stroke-width="{format_mm(line / 2)}"'
    shapes.append(f'<path {style} d="{"".join(path_data(laser_pass.walls, extent.top))}"/>')
    radius = format_mm(job.layout.fiducial_diameter_mm / 2)
    for x, y in job.fiducials_mm.tolist():
        place = f'cx="{format_mm(x)}" cy="{format_mm(extent.top - y)}" r="{radius}"'
        shapes.append(f'<circle {place} fill="none" stroke="#1c1a18" stroke-width="{format_mm(line)}"/>')
    return (
        f'<div class="pass"><h3>{laser_pass.name}</h3><svg viewBox="{box}" role="img" '
        f'aria-label="{laser_pass.name}">{"".join(shapes)}</svg></div>'
    )


def _polygons_svg(polygons: list, top: float, fill: str, attributes: str) -> str:  # type: ignore[type-arg]
    """One path of all polygons, y down from ``top``."""
    data = []
    for polygon in polygons:
        points = [f"{x:.2f} {top - y:.2f}" for x, y in polygon.tolist()]
        data.append(f"M{'L'.join(points)}Z")
    return f'<path fill="{fill}"{attributes} d="{"".join(data)}"/>'


def _coupon_html(coupon: LaserDrawing) -> str:
    """The coupon true to size, and what its patches are."""
    extent = coupon.extent_mm
    width, height = extent.right - extent.left + 2, extent.top - extent.bottom + 2
    paths = "".join(
        f'<path d="{data}"/>'
        for one in coupon.passes
        for data in path_data(one.walls.moved(np.array([1 - extent.left, 1 - extent.bottom])), height)
    )
    rows = "".join(
        f"<tr><td class=box>☐</td><td>{one.name.removeprefix('patch-')}</td><td class=n>{one.power_percent:g} %</td>"
        f"<td class=n>{one.speed_mm_s:g} mm/s</td><td class=n>{one.repeats}</td></tr>"
        for one in coupon.passes
        if one.name.startswith("patch-")
    )
    size = f'width="{width:.1f}mm" height="{height:.1f}mm" viewBox="0 0 {width:.3f} {height:.3f}"'
    return (
        f'<svg {size} fill="none" stroke="#1c1a18" stroke-width=".12">{paths}</svg>'
        "<p>True to size; the arrow points up. <code>grid</code> is burnt first where power and speed are unknown: its "
        "photograph says which field cuts through.</p><table><tr><th></th><th>Patch</th><th class=n>Power</th>"
        f"<th class=n>Speed</th><th class=n>Times over</th></tr>{rows}</table>"
    )


def _as_made_html(figures: tuple[PassFigures, ...]) -> str:
    head = (
        "<tr><th>Pass</th><th>Face</th><th class=n>Area</th><th class=n>Worst cell</th><th class=n>Corner lost</th>"
        "<th class=n>Burnt beside</th><th class=n>Web in the pass</th><th class=n>Web to filled cells</th></tr>"
    )
    rows = []
    for one_pass in figures:
        faces = [("front", one_pass.front)] + ([("back", one_pass.back)] if one_pass.back else [])
        rows += [_as_made_row(one_pass.name if side == "front" else "", side, face) for side, face in faces]
    return (
        f"<table>{head}{''.join(rows)}</table><p><small>Lengths in mm; areas against the nominal cells. A web to "
        "filled cells of 0 means that the cells meet; below 0, the burn runs into the cured cell.</small></p>"
    )


def _as_made_row(name: str, side: str, face: FaceFigures) -> str:
    lengths = [face.corner_loss_mm, face.burnt_beside_mm, face.web_mm, face.web_to_filled_mm]
    texts = ["-" if value is None else f"{value:.3f}" for value in lengths]
    areas = [f"{face.area_error_percent:+.2f} %", f"{face.area_error_worst_percent:+.2f} %"]
    fields = "".join(f"<td class=n>{text}</td>" for text in [*areas, *texts])
    return f"<tr><td>{name}</td><td>{side}</td>{fields}</tr>"


def _registration_html(job: LaserJob) -> str:
    if not len(job.fiducials_mm):
        text = "This design has no fiducials (fiducials.count = 0): do not move the pad between passes."
        return f'<div class="warn">{text}</div>'
    diameter = f"{job.layout.fiducial_diameter_mm:g} mm"
    rows = "".join(
        f"<tr><td>{number}</td><td class=n>{x:.3f}</td><td class=n>{y:.3f}</td></tr>"
        for number, (x, y) in enumerate(job.fiducials_mm.tolist(), start=1)
    )
    holes = (
        f"Pass 0 cuts the fiducials as pin holes of {diameter}."
        if job.setup.options.holes
        else f"The fiducials are marks of {diameter} that the pad must already have (laser.holes = false)."
    )
    return (
        f"<p>{holes} The fiducials are in layout.json and in every file (LightBurn: tool layer T1, never burnt), at "
        "the same "
        f"place on the bed in every pass. They are in three corners, so that a turned pad does not fit.</p>"
        f"<table><tr><th>Fiducial</th><th class=n>X mm</th><th class=n>Y mm</th></tr>{rows}</table>"
    )


def _format_kerf(kerf_mm: tuple[float, float]) -> str:
    return f"{kerf_mm[0]:.3f} / {kerf_mm[1]:.3f} mm"
