"""as-made.svg: the pattern as carved, at the side that the camera sees, filled with ink, at true size.

The drawing is not mirrored: the front's x points to the right. The file has the structure of ``pattern.svg``, so that
programs can compare and render the drawing and the extractor can read the rendering.
"""

from __future__ import annotations

from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.laser.as_made import drawn_outlines_mm
from cmpdesign.products.laser.formats.laser_layers import format_mm
from cmpdesign.products.laser.job import LaserJob
from cmpdesign.products.laser.paths.beam import Points


def as_made_svg(job: LaserJob) -> str:
    """Format the drawing: one group per pass in the pass' ink over the black ground; y down from the outline's top."""
    low, high = job.outline_mm.min(axis=0), job.outline_mm.max(axis=0)
    width, height = (high - low).tolist()
    lines = [
        '<?xml version="1.0" encoding="utf-8" ?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" version="1.1" width="{format_mm(width)}mm" '
        f'height="{format_mm(height)}mm" viewBox="0 0 {format_mm(width)} {format_mm(height)}">',
        _pass_group("black", job.layout.palette[COLORS[BLACK]], [job.outline_mm], low[0], high[1]),
    ]
    for laser_pass in job.cell_passes:
        assert laser_pass.color is not None
        outlines = list(drawn_outlines_mm(laser_pass, job))
        lines.append(
            _pass_group(
                laser_pass.name, job.layout.palette[COLORS[laser_pass.color]], outlines, low[0], high[1]
            )
        )
    return "\n".join([*lines, "</svg>", ""])


def _pass_group(name: str, ink: str, polygons: list[Points], left: float, top: float) -> str:
    paths = []
    for polygon in polygons:
        points = [f"{format_mm(x - left)} {format_mm(top - y)}" for x, y in polygon.tolist()]
        paths.append(f'<path d="M{"L".join(points)}Z"/>')
    return f'<g id="{name}" fill="{ink}">{"".join(paths)}</g>'
