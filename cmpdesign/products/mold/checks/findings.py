"""Checks of a mold from its dimensions, before a solid is built: findings on making and casting."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cmpdesign.errors import DesignError
from cmpdesign.layout.checks import Finding
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.materials.silicones import load_silicone, silicones
from cmpdesign.products.mold.checks.clearances import MIN_WALL_MM, clearance_findings
from cmpdesign.products.mold.shapes.bosses import boss_features
from cmpdesign.products.mold.shapes.cavities import cavities, open_insets, seen_inset_mm
from cmpdesign.products.mold.solids.loops import Points, frusta_volume_mm3
from cmpdesign.products.mold.stack.crown import Crown
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack, crown_edge_mm


@dataclass(frozen=True)
class ToolLimits:
    """Limits of a tool: smallest boss or slot, and thinnest sheet, mm."""

    feature_mm: float
    sheet_mm: float


# Usual values of design guides: 0.2 mm is four pixels of a desktop resin printer, 0.4 mm the line of a nozzle,
# 0.5 and 0.3 mm the smallest common end mill and eroding wire with its gap.
TOOL_LIMITS = {
    "sla-resin": ToolLimits(0.2, 0.4),
    "fdm-pla": ToolLimits(0.4, 0.6),
    "fdm-petg": ToolLimits(0.4, 0.6),
    "aluminium": ToolLimits(0.5, 0.3),
    "steel": ToolLimits(0.3, 0.1),
}
# Height over width of bosses: printed bosses break above the first value and bend above the second.
SLENDER_ERROR, SLENDER_WARNING = 3.0, 1.5
DRAFT_MAX_DEG = 15.0
DRAFT_WARNING_DEG = 0.5
# Every color's cavities are filled before the next plate is pressed in, so every web is supported. Thinner webs close
# where two plates are off by some micrometres.
WEB_WARNING_MM = 0.01
# Silicone layers whose sizes differ by more than this at the pad's edge wrinkle.
MISMATCH_WARNING_MM = 0.1
# Largest height of the crown over flat tips of bosses, as a share of the black layer, before the base layer bulges.
SAG_WARNING = 0.1
# Least thickness of a dome's silicone layers at the foot, measured across, as a share of that at the apex.
THIN_WARNING = 0.85


def check_mold(stack: MoldStack) -> list[Finding]:
    """Check the dimensions of a mold; the findings, errors first."""
    findings = [
        *_boss_findings(stack),
        *_draft_findings(stack),
        *_sheet_findings(stack),
        *_curing_findings(stack),
        *_shape_findings(stack),
        *_unused_option_findings(stack),
        *_side_findings(stack),
    ]
    # Outlines have a shape only where the dimensions are possible.
    if all(finding.severity == "warning" for finding in findings):
        findings += clearance_findings(stack)
    return sorted(findings, key=lambda finding: finding.severity)


def require_no_errors(findings: list[Finding]) -> None:
    """Check that no finding is an error.

    Raises:
        DesignError: the first error among the findings.
    """
    for finding in findings:
        if finding.severity == "error":
            raise DesignError(f"mold: {finding}")


def min_feature_mm(stack: MoldStack) -> float:
    """The smallest feature that the tool can make: the design's value or the tool's limit."""
    return stack.options.minimum_feature_mm or TOOL_LIMITS[stack.options.tool].feature_mm


def tip_width_mm(stack: MoldStack) -> float:
    """Diameter of the inscribed circle of the narrowest boss's tip; negative if the tip vanishes."""
    inset = stack.options.gap_mm / 2 + seen_inset_mm(stack)
    return min(_inscribed_diameter_mm(stack.cells(color)) for color in stack.colors) - 2 * inset


def _inscribed_diameter_mm(cells: Points) -> float:
    """Least 4 area / perimeter of (N, k, 2) cells: the diameter of the inscribed circle."""
    side = np.roll(cells, -1, axis=1) - cells
    area = (
        np.abs(
            (cells[..., 0] * np.roll(cells[..., 1], -1, axis=1)).sum(1)
            - (np.roll(cells[..., 0], -1, axis=1) * cells[..., 1]).sum(1)
        )
        / 2
    )
    return float((4 * area / np.hypot(side[..., 0], side[..., 1]).sum(axis=1)).min())


def _boss_findings(stack: MoldStack) -> Iterator[Finding]:
    option, limit = stack.options, min_feature_mm(stack)
    if option.gap_mm == 0:
        yield Finding(
            "mold.gap_mm",
            0.0,
            WEB_WARNING_MM,
            "mm",
            "make it larger, or neighbouring cavities touch",
            "error",
        )
        return
    if option.gap_mm < WEB_WARNING_MM:
        remedy = "make mold.gap_mm larger, or fillings of two colors meet"
        yield Finding("mold.gap_mm", option.gap_mm, WEB_WARNING_MM, "mm", remedy, "warning")
    width, height = tip_width_mm(stack), stack.thickness_mm[1]
    if width < limit:
        remedy = "make pitch_mm larger, or mold.gap_mm, draft_deg or marker_mm smaller, or use a finer tool"
        yield Finding("narrowest boss at its tip", width, limit, "mm", remedy, "error")
        return
    if 2 * option.tip_radius_mm >= width:
        remedy = "make mold.tip_radius_mm smaller"
        yield Finding("mold.tip_radius_mm", option.tip_radius_mm, width / 2, "mm", remedy, "error")
    if stencil_width_mm(stack) < limit:
        remedy = "make pitch_mm larger or mold.clearance_mm smaller"
        yield Finding("narrowest stencil hole", stencil_width_mm(stack), limit, "mm", remedy, "error")
    elif 2 * option.tip_radius_mm >= stencil_width_mm(stack):
        remedy = "make mold.tip_radius_mm smaller"
        yield Finding(
            "mold.tip_radius_mm", option.tip_radius_mm, stencil_width_mm(stack) / 2, "mm", remedy, "error"
        )
    yield from _slenderness_findings(height / width)
    web, name = plate_web_mm(stack)
    if web < limit:
        remedy = "use a finer tool, or make pitch_mm or mold.gap_mm larger"
        yield Finding(f"valley between bosses of boss-{name}", web, limit, "mm", remedy, "warning")


def stencil_width_mm(stack: MoldStack) -> float:
    """Diameter of the inscribed circle of the narrowest stencil hole at the lower face."""
    return (
        min(
            _inscribed_diameter_mm(stack.cells(color)) - 2 * float(open_insets(stack, color).max())
            for color in stack.colors
        )
        - 2 * stack.options.clearance_mm
    )


def _slenderness_findings(ratio: float) -> Iterator[Finding]:
    remedy = "make mold.marker_mm smaller or pitch_mm larger"
    if ratio > SLENDER_ERROR:
        yield Finding("boss height over width", ratio, SLENDER_ERROR, "", remedy, "error")
    elif ratio > SLENDER_WARNING:
        yield Finding("boss height over width", ratio, SLENDER_WARNING, "", remedy, "warning")


def plate_web_mm(stack: MoldStack) -> tuple[float, str]:
    """The least distance between bosses of one plate at their roots, and the name of the plate's color."""
    import shapely

    least, name = float("inf"), ""
    for color in stack.colors:
        roots = np.array(
            [shapely.Polygon(cavity.open.with_chords().points) for cavity in cavities(stack, color)]
        )
        if len(roots) < 2:
            continue
        _, distances = shapely.STRtree(roots).query_nearest(roots, exclusive=True, return_distance=True)
        if distances.min() < least:
            least, name = float(distances.min()), COLORS[color]
    return least, name


def _draft_findings(stack: MoldStack) -> Iterator[Finding]:
    draft = stack.options.draft_deg
    if draft < 0:
        yield Finding("mold.draft_deg (an undercut)", draft, 0.0, "deg", "make it 0 or larger", "error")
    elif draft > DRAFT_MAX_DEG:
        yield Finding("mold.draft_deg", draft, DRAFT_MAX_DEG, "deg", "make it smaller", "error")
    elif draft < DRAFT_WARNING_DEG:
        remedy = "set a draft of one or two degrees, or the cavities tear when the plate is lifted"
        yield Finding("mold.draft_deg", draft, DRAFT_WARNING_DEG, "deg", remedy, "warning")


def _sheet_findings(stack: MoldStack) -> Iterator[Finding]:
    """Findings on the thickness of parts and walls, and on vents."""
    option = stack.options
    limit = TOOL_LIMITS[option.tool].sheet_mm
    thicknesses = {
        "frame": stack.thickness_mm[1],
        "cover": stack.thickness_mm[2],
        "stencils": option.stencil_mm,
    }
    for name, thickness in thicknesses.items():
        if thickness < limit:
            remedy = "cut the part from shim stock instead: its shape is flat"
            yield Finding(f"thickness of {name} as {option.tool}", thickness, limit, "mm", remedy, "warning")
    if option.vents and option.vent_mm < min_feature_mm(stack):
        remedy = "make mold.vent_mm larger, or drill the vents"
        yield Finding("mold.vent_mm", option.vent_mm, min_feature_mm(stack), "mm", remedy, "error")
    if not option.vents:
        remedy = "give the lid vents, or pour in a vacuum: air stays under the lid"
        yield Finding("no vents: mold.vents = false", 0, 1, "", remedy, "warning", is_measure=False)
    for field in ("wall_mm", "floor_mm", "plate_mm"):
        least = 2 * limit if field != "floor_mm" else 1.5
        if getattr(option, field) < least:
            yield Finding(
                f"mold.{field}", getattr(option, field), least, "mm", "make the wall thicker", "error"
            )
    if option.vents and stack.crown is None and stack.layout.border_mm < option.vent_mm + 0.2:
        remedy = "make border_mm larger or mold.vent_mm smaller, or vents leave marks on cells"
        yield Finding(
            "border_mm under the vents", stack.layout.border_mm, option.vent_mm + 0.2, "mm", remedy, "warning"
        )


def _curing_findings(stack: MoldStack) -> Iterator[Finding]:
    """Findings on inhibition, chemistry and shrinkage of the silicone layers."""
    tool = stack.options.tool
    by_remedy: dict[str, list[str]] = {}
    for name, silicone in zip(SILICONE_LAYERS, stack.silicones, strict=True):
        if tool in silicone.inhibited_by.value:
            by_remedy.setdefault(silicone.remedy, []).append(f"{name}: {silicone.name}")
    for remedy, names in by_remedy.items():
        subject = f"layers that may not cure on {tool} ({'; '.join(names)})"
        yield Finding(subject, len(names), 0, "", remedy, "warning", is_measure=False)
    silicone_layers = list(zip(SILICONE_LAYERS, stack.silicones, strict=True))
    for (lower_name, lower), (upper_name, upper) in pairwise(silicone_layers):
        # According to the makers, silicones of different chemistry do not cure against each other.
        if lower.cure != upper.cure:
            subject = (
                f"{lower.cure}-cured layers ({lower_name}: {lower.name}) under a {upper.cure}-cured one "
                f"({upper_name}: {upper.name})"
            )
            yield Finding(subject, 1, 0, "", "use one chemistry for all layers", "error", is_measure=False)
    scales = [silicone.scale for silicone in stack.silicones]
    reach = float(np.hypot(*stack.outline_mm.T).max())
    mismatch = (max(scales) - min(scales)) * reach
    if mismatch > MISMATCH_WARNING_MM:
        remedy = "choose silicones of similar shrinkage"
        subject = "difference of the layers' shrinkage at the pad's edge"
        yield Finding(subject, mismatch, MISMATCH_WARNING_MM, "mm", remedy, "warning")


def _side_findings(stack: MoldStack) -> Iterator[Finding]:
    """Findings on the layer between the camera and the pattern: the base layer."""
    base = stack.silicones[0]
    if base.clear is None:
        remedy = "add clear = { value = true, source = ... } to its file if light passes through it"
        subject = f"base silicone of unknown clarity ({base.name})"
        yield Finding(subject, 1, 0, "", remedy, "warning", is_measure=False)
    elif not base.clear.value:
        clear = ", ".join(name for name in silicones() if _is_clear(name))
        remedy = f"the camera looks at the pattern through the base layer: set mold.base_silicone to {clear}"
        subject = f"base silicone that is not clear ({base.name})"
        yield Finding(subject, 1, 0, "", remedy, "error", is_measure=False)


def _is_clear(name: str) -> bool:
    clear = load_silicone(name).clear
    return clear is not None and clear.value


def _shape_findings(stack: MoldStack) -> Iterator[Finding]:
    option = stack.options
    if stack.crown is not None and stack.layout.cell_corners.shape[1] != 3:
        remedy = "choose a triangular pattern, or make the pad flat"
        subject = "corners of a cell on a crown (four are in no plane)"
        yield Finding(subject, 4, 3, "", remedy, "error", is_measure=False)
    wall = moat_to_pin_mm(stack)
    if wall < MIN_WALL_MM:
        remedy = "make fiducials.gap_mm larger, or mold.parting_mm or mold.moat_mm smaller"
        yield Finding("wall between the moat and a pin hole", wall, MIN_WALL_MM, "mm", remedy, "error")
    if option.moat_depth_mm > stack.z_base_mm + option.floor_mm - 1:
        limit = stack.z_base_mm + option.floor_mm - 1
        yield Finding("mold.moat_depth_mm", option.moat_depth_mm, limit, "mm", "make it less deep", "error")
    size = np.ptp(stack.pins_mm, axis=0).min()
    if 2 * option.fillet_mm > size:
        yield Finding("mold.fillet_mm", option.fillet_mm, float(size) / 2, "mm", "make it smaller", "error")
    if stack.crown is None:
        return
    yield from _crown_findings(stack, stack.crown)


def _crown_findings(stack: MoldStack, crown: Crown) -> Iterator[Finding]:
    thin = float(np.cos(np.radians(crown.slope_deg)))
    if thin < THIN_WARNING:
        remedy = "make mold.crown_radius_mm larger, or expect thinner layers at the pad's edge"
        yield Finding(
            "thickness at the crown's foot over that at its apex", thin, THIN_WARNING, "", remedy, "warning"
        )
    if stack.layout.cell_corners.shape[1] != 3:
        return
    sag, limit = facet_sag_mm(stack), SAG_WARNING * stack.thickness_mm[1]
    if sag > limit:
        remedy = "make pitch_mm smaller or mold.crown_radius_mm larger: tips of bosses are flat"
        yield Finding("crown over a flat boss's tip", sag, limit, "mm", remedy, "warning")


def _unused_option_findings(stack: MoldStack) -> Iterator[Finding]:
    """Findings on options without effect, and on options with another effect than stated."""
    option, layout = stack.options, stack.layout
    if stack.crown is None:
        remedy = 'not used on a flat pad: set mold.crown = "sphere" or "cylinder", or leave it out'
        if option.crown_radius_mm is not None:
            yield Finding("mold.crown_radius_mm", option.crown_radius_mm, 0.0, "mm", remedy, "warning")
        if "projection" in option.model_fields_set and option.projection != "equidistant":
            subject = f'mold.projection = "{option.projection}"'
            yield Finding(subject, 1, 0, "", remedy, "warning", is_measure=False)
        return
    edge = crown_edge_mm(option, layout)
    if edge > layout.border_mm:
        remedy = "this width is taken around the crown for the vents: make it larger, or mold.vent_mm smaller"
        yield Finding("border_mm", layout.border_mm, edge, "mm", remedy, "warning")
    if "clip" in layout.parameters:
        subject = f"clip outlines of a pad whose edge follows its crown ({option.crown})"
        yield Finding(
            subject,
            1,
            0,
            "",
            "only cells are clipped; leave clip out to keep all cells",
            "warning",
            is_measure=False,
        )


def moat_to_pin_mm(stack: MoldStack) -> float:
    """The least wall between the moat and a pin hole in the base."""
    import shapely

    pad = shapely.Polygon(stack.edges(0)[1].points)
    pins = shapely.points(stack.pins_mm)
    occupied = stack.options.parting_mm + stack.options.moat_mm + stack.pin_diameter_mm / 2
    return float(shapely.distance(pad, pins).min()) - occupied


def facet_sag_mm(stack: MoldStack) -> float:
    """Largest height of the crown over the flat facets of plates, along z; 0 for a flat pad.

    A circle of radius R rises over a chord of half length a by R - sqrt(R^2 - a^2). For a triangle, a is the radius of
    the circumcircle. The height along z is this divided by the cosine of the slope.
    """
    if stack.crown is None:
        return 0.0
    corners = np.concatenate([stack.cells(color) for color in stack.colors])
    points = np.concatenate([corners, stack.crown.z_mm(corners.reshape(-1, 2)).reshape(-1, 3, 1)], axis=-1)
    sides = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=-1)
    double_area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=-1)
    circumradius = float((sides.prod(axis=1) / (2 * double_area)).max())
    radius = stack.crown.radius_mm
    rise = radius - np.sqrt(max(radius**2 - circumradius**2, 0.0))
    return float(rise / np.cos(np.radians(stack.crown.slope_deg)))


def boss_volume_mm3(stack: MoldStack, color: int) -> float:
    """Volume of the silicone that fills a color's cavities."""
    pairs = [(feature.root, feature.tip) for feature in boss_features(stack, color)]
    return frusta_volume_mm3(pairs, stack.thickness_mm[1])
