"""SVG for laser programs: the page is the bed, 1 user unit is 1 mm, one group per pass, closed paths without fill.

The color stands on the group and on every path: simple programs (K40 Whisperer) read it from the paths only.

Coordinates are final (no transform), so every program puts every pass at the same place.
"""

from __future__ import annotations

from itertools import pairwise

from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import format_mm, hex_color
from cmpdesign.products.laser.paths.strokes import Strokes


def drawing_to_svg(drawing: LaserDrawing) -> str:
    """Format the walls of the passes; y runs down from the bed's upper edge."""
    machine = drawing.setup.machine
    width, height = machine.bed_width_mm.value, machine.bed_height_mm.value
    lines = [
        '<?xml version="1.0" encoding="utf-8" ?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" version="1.1" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">',
    ]
    for laser_pass in drawing.passes:
        stroke = hex_color(drawing.laser_layers[laser_pass.name])
        lines.append(f'<g id="{laser_pass.name}" fill="none" stroke="{stroke}" stroke-width="0.05">')
        lines += [f'<path stroke="{stroke}" d="{data}"/>' for data in path_data(laser_pass.walls, height)]
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""])


def path_data(strokes: Strokes, height_mm: float) -> list[str]:
    """Closed paths as SVG path data, y down from ``height_mm``."""
    pairs = [f"{format_mm(x)} {format_mm(height_mm - y)}" for x, y in strokes.xy_mm.tolist()]
    first = strokes.first.tolist()
    return ["M" + "L".join(pairs[start:end]) + "Z" for start, end in pairwise(first)]
