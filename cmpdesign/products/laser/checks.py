"""Checks of a laser job before a file is written: findings with value, limit, unit and remedy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.errors import DesignError
from cmpdesign.layout.checks import Finding
from cmpdesign.layout.side import seen_side
from cmpdesign.products.laser.as_made import FaceFigures, PassFigures
from cmpdesign.products.laser.job import LaserJob, LaserPass
from cmpdesign.products.laser.paths.strokes import Strokes

# Largest depth of the burn into a cured neighbour, in kerfs. At the side that the camera sees a deeper burn changes the
# neighbour's corners; at the hidden side it may not pass through the neighbour's edge altogether.
BURN_LIMIT_KERFS, HIDDEN_BURN_LIMIT_KERFS = 0.5, 1.0
# Paths whose points agree to within this distance count as one path burnt twice.
SAME_MM = 1e-3


def require_no_errors(findings: Iterator[Finding]) -> tuple[Finding, ...]:
    """Return the warnings among the findings.

    Raises:
        DesignError: the findings contain errors; all errors in one line.
    """
    collected = tuple(findings)
    errors = [str(finding) for finding in collected if finding.severity == "error"]
    if errors:
        raise DesignError("the laser job is refused: " + "; and ".join(errors))
    return tuple(finding for finding in collected if finding.severity == "warning")


def setup_findings(design: Design, job: LaserJob) -> Iterator[Finding]:
    """Findings that need no figures: text, limits of the machine, a beam that closes, cells that vanish."""
    setup = job.setup
    texts = [name for name in ("print_ids", "print_scale") if getattr(design, name)]
    if texts:
        remedy = f"a laser burns outlines only; leave {' and '.join(texts)} out"
        yield _error_finding("texts in the job", len(texts), 0, "", remedy)
    speed_max = setup.machine.speed_max_mm_s.value
    if max(setup.speed_mm_s, setup.cut_speed_mm_s) > speed_max:
        speed = max(setup.speed_mm_s, setup.cut_speed_mm_s)
        yield _error_finding(
            "speed", speed, speed_max, "mm/s", "lower laser.speed_mm_s to the machine's maximum"
        )
    thickness = setup.material.thickness_mm.value
    if setup.depth_mm > thickness + 1e-9:
        remedy = "lower laser.depth_mm or take a thicker material"
        yield _error_finding(
            "depth of the cavities in this material", setup.depth_mm, thickness, "mm", remedy
        )
    yield from _hole_findings(job)
    if setup.depth_mm < thickness - 1e-9 and seen_side(job.layout.mirrored) == "back":
        remedy = "cut through the sheet (leave laser.depth_mm out), or set mirrored = false: the floor hides the cells"
        yield _error_finding(
            "depth of cavities whose back the camera sees", setup.depth_mm, thickness, "mm", remedy
        )
    if not setup.compensated:
        yield from _uncompensated_findings(job)
    elif min(job.back.x_mm, job.back.y_mm) <= 0:
        remedy = "lower laser.taper_deg or laser.depth_mm, or widen the kerf: the beam closes before the back"
        yield _error_finding("kerf at the back", 2 * min(job.back.x_mm, job.back.y_mm), 0, "mm", remedy)
    yield from _spacing_findings(job)
    for laser_pass in job.cell_passes:
        assert laser_pass.cavities is not None
        lost = laser_pass.cavities.cell[~laser_pass.cavities.exists]
        if len(lost):
            remedy = f"cell {int(lost[0])} is among them; make pitch_mm larger or the kerf smaller"
            yield _error_finding(
                f"cells of {laser_pass.name} that are narrower than the kerf", len(lost), 0, "", remedy
            )


def path_findings(job: LaserJob) -> Iterator[Finding]:
    """Findings on the paths: off the bed, drawn twice, not closed, crossing themselves."""
    extent, machine = job.extent_mm, job.setup.machine
    width = ("width", extent.left, extent.right, machine.bed_width_mm.value)
    height = ("height", extent.bottom, extent.top, machine.bed_height_mm.value)
    for axis, low, high, size in (width, height):
        if high - low > size:
            yield _error_finding(
                f"{axis} of the job, on the bed",
                high - low,
                size,
                "mm",
                "split the design, or take a larger bed",
            )
        elif low < 0 or high > size:
            name = "laser.x_mm" if axis == "width" else "laser.y_mm"
            edge = high if high > size else low
            yield _error_finding(
                f"edge of the job beyond the bed's {axis}", edge, size, "mm", f"move it by {name}"
            )
    for laser_pass in job.passes:
        duplicates, open_paths = count_duplicate_paths(laser_pass.walls), count_open_paths(laser_pass.walls)
        if duplicates:
            subject = f"paths of {laser_pass.name} that are drawn twice"
            yield _error_finding(subject, duplicates, 0, "", "remove the repeated cells")
        if open_paths:
            subject = f"paths of {laser_pass.name} that enclose nothing"
            yield _error_finding(subject, open_paths, 0, "", "close them, or remove them")
        if laser_pass.kind == "outline":
            yield from _crossing_findings(laser_pass)


def as_made_findings(job: LaserJob, figures: tuple[PassFigures, ...]) -> Iterator[Finding]:
    """Findings on the resulting geometry: webs too thin, cured neighbours burnt, assumed values."""
    limit, seen = job.setup.minimum_web_mm, seen_side(job.layout.mirrored)
    for one_pass in figures:
        for side, face, beam in (("front", one_pass.front, job.front), ("back", one_pass.back, job.back)):
            if face is not None:
                kerfs = BURN_LIMIT_KERFS if side == seen else HIDDEN_BURN_LIMIT_KERFS
                burn_limit = kerfs * beam.narrow_mm
                yield from _web_findings(f"{one_pass.name} at the {side}", face, limit, burn_limit)
    if job.setup.options.holes and len(job.fiducials_mm):
        yield from _hole_web_findings(job, limit)
    if job.setup.assumed:
        remedy = "cut the coupon and measure it: " + ", ".join(job.setup.assumed)
        yield Finding(
            "values of machine and material that are assumed",
            len(job.setup.assumed),
            0,
            "",
            remedy,
            "warning",
            is_measure=False,
        )


def count_duplicate_paths(strokes: Strokes) -> int:
    """The number of closed paths that repeat another path, regardless of start and direction."""
    counts = np.diff(strokes.first)
    means = np.add.reduceat(strokes.xy_mm, strokes.first[:-1]) / counts[:, None]
    squares = np.add.reduceat(strokes.xy_mm**2, strokes.first[:-1]) / counts[:, None]
    spread = np.sqrt(np.maximum(squares - means**2, 0))
    key = np.round(np.column_stack([means, spread, counts]) / SAME_MM).astype(np.int64)
    return len(key) - len(np.unique(key, axis=0))


def count_open_paths(strokes: Strokes) -> int:
    """The number of paths that do not enclose an area."""
    if not strokes.closed:
        return len(strokes)
    opened = strokes.opened()
    cross = opened.xy_mm[:-1, 0] * opened.xy_mm[1:, 1] - opened.xy_mm[1:, 0] * opened.xy_mm[:-1, 1]
    cross[opened.first[1:-1] - 1] = 0
    area = np.add.reduceat(cross, opened.first[:-1]) / 2
    return int(np.count_nonzero(np.abs(area) < SAME_MM**2))


def _hole_findings(job: LaserJob) -> Iterator[Finding]:
    """A beam cannot burn a round hole that is more sharply curved than its footprint: the path has no inside."""
    diameter, limit = job.layout.fiducial_diameter_mm, job.front.smallest_hole_mm
    if job.setup.options.holes and len(job.fiducials_mm) and diameter <= limit:
        remedy = "make fiducials.diameter_mm larger, the kerf smaller, or leave the holes out (laser.holes = false)"
        yield _error_finding(
            "diameter of the fiducial holes, against the kerf", diameter, limit, "mm", remedy
        )


def _uncompensated_findings(job: LaserJob) -> Iterator[Finding]:
    options = job.setup.options
    if options.mode == "pocket":
        remedy = (
            'give the kerf, or choose laser.mode = "cut": lines of a pocket keep half a kerf from its walls'
        )
        yield _error_finding("kerf of a pocket", 0, 0, "mm", remedy)
    idle = sorted({"corner", "face", "taper_deg"} & options.model_fields_set)
    if idle:
        names = " and ".join(f"laser.{name}" for name in idle)
        remedy = f"leave {names} out: without compensation (laser.kerf_mm = 0) paths are the outlines"
        yield Finding("options without effect", len(idle), 0, "", remedy, "warning", is_measure=False)


def _spacing_findings(job: LaserJob) -> Iterator[Finding]:
    options = job.setup.options
    if options.mode != "pocket" or not job.setup.compensated:
        return
    share = 1.0 if options.fill == "hatch" else 0.5
    limit = share * job.back.narrow_mm
    if 0 < limit < job.setup.hatch_mm:
        remedy = "lower laser.hatch_mm, or ridges stay between the lines"
        yield _error_finding(
            "spacing of the fill, against the kerf at the bottom", job.setup.hatch_mm, limit, "mm", remedy
        )


def _web_findings(subject: str, face: FaceFigures, limit: float, burn_limit: float) -> Iterator[Finding]:
    if face.web_mm is not None and face.web_mm < limit:
        remedy = (
            "make pitch_mm larger, the kerf smaller, or laser.minimum_web_mm if thinner walls do not break"
        )
        yield _error_finding(f"smallest web of {subject}", face.web_mm, limit, "mm", remedy)
    if face.web_to_filled_mm is not None and -face.web_to_filled_mm > burn_limit:
        remedy = 'choose laser.corner = "plain" or laser.face = "front"'
        yield _error_finding(
            f"burn of {subject} into cured cells", -face.web_to_filled_mm, burn_limit, "mm", remedy
        )


def _hole_web_findings(job: LaserJob, limit: float) -> Iterator[Finding]:
    import shapely

    pad = shapely.Polygon(job.outline_mm)
    web = (
        float(shapely.distance(shapely.points(job.fiducials_mm), pad).min())
        - job.layout.fiducial_diameter_mm / 2
    )
    if web < limit:
        yield _error_finding(
            "web between a fiducial hole and the pattern", web, limit, "mm", "make fiducials.gap_mm larger"
        )


def _crossing_findings(laser_pass: LaserPass) -> Iterator[Finding]:
    import shapely

    crossed = sum(not shapely.LinearRing(path).is_simple for path in laser_pass.walls)
    if crossed:
        yield _error_finding(
            f"paths of {laser_pass.name} that cross themselves", crossed, 0, "", "smooth the clip outline"
        )


def _error_finding(subject: str, value: float, limit: float, unit: str, remedy: str) -> Finding:
    return Finding(subject, value, limit, unit, remedy, "error")
