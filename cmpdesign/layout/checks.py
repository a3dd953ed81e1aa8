"""Checks of a design: features that cannot be made or read, each with its value, limit, unit and remedy."""

from __future__ import annotations

import colorsys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.measures import cell_angles_deg, cell_widths_mm, edge_lengths_mm
from cmpdesign.patterns.colors import BLACK, BLUE, COLORS, GREEN, RED, WHITE

# A desktop CO2 laser removes a kerf of 0.1 to 0.2 mm, and an inkjet dot on film spreads to about 0.1 mm. A cell
# with an inscribed circle of this diameter becomes a dot; up to three times that, its corners become round.
CELL_ERROR_MM, CELL_WARNING_MM = 0.1, 0.3
# A corner rounded to the radius r is missing over r / sin(angle / 2): 2 r at 60 degrees, 6 r at 20 degrees.
CORNER_WARNING_DEG = 20.0
# The three inks are distinguished by hue alone; at best they are 120 degrees apart. LEDs and white balance shift
# each hue by about 20 degrees, so that two inks less than 45 degrees apart may be confused.
HUE_ERROR_DEG = 45.0
# Below this saturation, noise of 2/255 turns the hue of a mid-bright ink by several degrees.
SATURATION_ERROR = 0.35
# The error of a corner is inversely proportional to the contrast between ink and black, in 1/255.
CONTRAST_ERROR, CONTRAST_WARNING = 40, 80
# White must be brighter than the inks' dark channels and must have no hue.
WHITE_SATURATION_ERROR, WHITE_VALUE_ERROR = 0.2, 0.6
# A triangle with edges of 6 px covers 16 px, and most of these are blurred by its border. 12 px is the smallest
# edge that is tested at every rotation and tilt.
CAMERA_PX = (640, 480)
EDGE_ERROR_PX, EDGE_WARNING_PX = 6.0, 12.0
# Without a black border, the background is on the other side of the rim's gridlines.
BORDER_WARNING_PITCHES = 0.25
# Markers removed by the clip outline still have entries in every array. A hexagon around a rectangle loses half.
PRESENT_WARNING = 0.33


@dataclass(frozen=True)
class Finding:
    """One feature that cannot be made or read.

    Attributes:
        subject: the checked quantity.
        value, limit: the measured value and its limit.
        unit: the unit of both; "" for a plain number.
        remedy: the change to make.
        severity: "error" (will not work) or "warning" (works under good conditions only).
        is_measure: the subject is a quantity with a limit; False: the subject says all, and value and limit only count.
    """

    subject: str
    value: float
    limit: float
    unit: str
    remedy: str
    severity: Literal["error", "warning"]
    is_measure: bool = True

    def __str__(self) -> str:
        if not self.is_measure:
            return f"{self.subject}; {self.remedy}"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.subject}: {self.value:.3g}{unit}, limit {self.limit:.3g}{unit}; {self.remedy}"


def check_design(
    design: Design, layout: Layout | None = None, camera_px: tuple[int, int] = CAMERA_PX
) -> list[Finding]:
    """Check a design. Returns the findings, errors first; an empty list when there are none.

    Args:
        design: the design.
        layout: its layout; None: it is built.
        camera_px: width and height of a camera image that the pattern just fills.

    Raises:
        DesignError: the design has no layout.

    >>> from cmpdesign import load
    >>> [str(finding) for finding in check_design(load("honeycomb", {"pitch_mm": "0.3mm"}))]
    ['smallest cell (inscribed circle): 0.173 mm, limit 0.3 mm; make pitch_mm larger']
    """
    layout = layout or build_layout(design)
    findings = [
        *_size_findings(design, layout),
        *_camera_findings(layout, camera_px),
        *_structure_findings(design, layout),
        *_color_findings(layout),
    ]
    return sorted(findings, key=lambda finding: finding.severity)


def _size_findings(design: Design, layout: Layout) -> Iterator[Finding]:
    width_mm = float(cell_widths_mm(layout).min())
    yield from _findings_below(
        "smallest cell (inscribed circle)",
        width_mm,
        CELL_ERROR_MM,
        CELL_WARNING_MM,
        "mm",
        _larger_cells_remedy(design),
    )
    angle_deg = float(cell_angles_deg(layout).min())
    yield from _findings_below(
        "sharpest corner of a cell",
        angle_deg,
        None,
        CORNER_WARNING_DEG,
        "deg",
        'bring aspect nearer to 1, or choose spacing = "arc"',
    )


def _larger_cells_remedy(design: Design) -> str:
    """The remedy for small cells: with a given pitch a larger pitch, with an overall size also fewer layers."""
    if design.pitch_mm is not None:
        return "make pitch_mm larger"
    sizes = [name for name in ("width_mm", "height_mm") if getattr(design, name) is not None]
    return f"make {' and '.join(sizes)} larger or layers fewer"


def _camera_findings(layout: Layout, camera_px: tuple[int, int]) -> Iterator[Finding]:
    width_mm, height_mm = layout.size_mm
    # The image's longer side may lie along the pattern's shorter side.
    scale_px_per_mm = max(
        min(camera_px[0] / width_mm, camera_px[1] / height_mm),
        min(camera_px[1] / width_mm, camera_px[0] / height_mm),
    )
    yield from _findings_below(
        f"shortest edge in a {camera_px[0]}x{camera_px[1]} picture filled by the pattern",
        scale_px_per_mm * float(edge_lengths_mm(layout).min()),
        EDGE_ERROR_PX,
        EDGE_WARNING_PX,
        "px",
        "use fewer layers or a camera with more pixels",
    )


def _structure_findings(design: Design, layout: Layout) -> Iterator[Finding]:
    layers, pitch_mm = int(layout.parameters["layers"]), float(layout.parameters["pitch_mm"])
    corners = layout.cell_corners.shape[1]
    triangular = corners == 3
    if not triangular:
        yield Finding(
            "the extractor reads cells with three corners only",
            corners,
            3,
            "",
            "choose a triangular pattern; only `cmpdesign evaluate` reads the square pattern, as the baseline",
            "error",
            is_measure=False,
        )
    if triangular and layers < 2:
        yield Finding(
            "layers (the white cell's third neighbour lies in layer 2)",
            layers,
            2,
            "",
            "use two layers or more; with one layer, two cells alone fix the orientation",
            "warning",
        )
    yield from _findings_below(
        "black border",
        layout.border_mm,
        None,
        BORDER_WARNING_PITCHES * pitch_mm,
        "mm",
        "make border_mm larger, or the rim's gridlines lack contrast",
    )
    yield from _findings_below(
        "share of markers inside the clip outline",
        float(layout.present.mean()),
        None,
        PRESENT_WARNING,
        "",
        "use fewer layers: the outer layers are numbered but not visible",
    )


def _color_findings(layout: Layout) -> Iterator[Finding]:
    inks = [RED, GREEN, BLUE] if layout.cell_corners.shape[1] == 3 else [RED]
    hsv = {color: _hsv(layout, color) for color in range(len(COLORS))}
    for first, second in combinations(inks, 2):
        hue_distance_deg = abs(hsv[first][0] - hsv[second][0])
        yield from _findings_below(
            f"hue distance of {COLORS[first]} and {COLORS[second]}",
            min(hue_distance_deg, 360 - hue_distance_deg),
            HUE_ERROR_DEG,
            None,
            "deg",
            "choose inks further apart",
        )
    for color in inks:
        yield from _findings_below(
            f"saturation of {COLORS[color]}", hsv[color][1], SATURATION_ERROR, None, "", "choose a purer ink"
        )
    black = _rgb(layout, BLACK)
    for color in [*inks, WHITE]:
        contrast = float((_rgb(layout, color) - black).max())
        yield from _findings_below(
            f"contrast of {COLORS[color]} against black",
            contrast,
            CONTRAST_ERROR,
            CONTRAST_WARNING,
            "of 255",
            "choose a brighter ink or a darker black",
        )
    yield from _findings_below(
        "brightness of white", hsv[WHITE][2], WHITE_VALUE_ERROR, None, "", "choose a brighter white"
    )
    if hsv[WHITE][1] > WHITE_SATURATION_ERROR:
        yield Finding(
            "saturation of white",
            hsv[WHITE][1],
            WHITE_SATURATION_ERROR,
            "",
            "choose a white without a tint",
            "error",
        )


def _findings_below(
    subject: str, value: float, error: float | None, warning: float | None, unit: str, remedy: str
) -> Iterator[Finding]:
    """A finding when the value is below a limit. An error takes precedence over a warning."""
    if error is not None and value < error:
        yield Finding(subject, value, error, unit, remedy, "error")
    elif warning is not None and value < warning:
        yield Finding(subject, value, warning, unit, remedy, "warning")


def _rgb(layout: Layout, color: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    text = layout.palette[COLORS[color]]
    return np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)], dtype=np.float64)


def _hsv(layout: Layout, color: int) -> tuple[float, float, float]:
    """Hue in degrees, saturation and value from 0 to 1."""
    hue, saturation, value = colorsys.rgb_to_hsv(*(_rgb(layout, color) / 255))
    return 360 * hue, saturation, value
