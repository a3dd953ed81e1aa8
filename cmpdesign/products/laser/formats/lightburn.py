"""LightBurn projects (.lbrn2): one CutSetting per pass, run in order; fiducials on the tool layer T1, never burnt.

The format is XML without a published specification. This module writes elements that LightBurn itself writes:
CutSetting elements with a Value for each setting, Path shapes with a VertList and the PrimList "LineClosed".
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import TOOL_LAYER, format_mm
from cmpdesign.products.laser.job import LaserPass

APP_VERSION = "1.7.08"


def drawing_to_lightburn(drawing: LaserDrawing) -> str:
    """Format the passes as a project. A hatched pocket is a Fill + Line layer: LightBurn draws the lines."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<LightBurnProject AppVersion="{APP_VERSION}" FormatVersion="1" MaterialHeight="0" '
        'MirrorX="False" MirrorY="False">',
    ]
    for priority, laser_pass in enumerate(drawing.passes):
        lines += _cut_setting_lines(drawing, laser_pass, priority)
    lines += _tool_layer_lines()
    vertices = 0
    for laser_pass in drawing.passes:
        lines += _path_lines(laser_pass, drawing.laser_layers[laser_pass.name].index, vertices)
        vertices += len(laser_pass.walls)
    radius = format_mm(drawing.fiducial_diameter_mm / 2)
    for x, y in drawing.fiducials_mm.tolist():
        lines.append(f'<Shape Type="Ellipse" CutIndex="{TOOL_LAYER.index}" Rx="{radius}" Ry="{radius}">')
        lines.append(f"<XForm>1 0 0 1 {format_mm(x)} {format_mm(y)}</XForm></Shape>")
    note = f"{drawing.name}: fill and cure after every pass; T1 holds the fiducials, see the job sheet"
    lines.append(f'<Notes ShowOnLoad="0" Notes={quoteattr(note)}/>')
    return "\n".join([*lines, "</LightBurnProject>", ""])


def _cut_setting_lines(drawing: LaserDrawing, laser_pass: LaserPass, priority: int) -> list[str]:
    values: dict[str, object] = {
        "index": drawing.laser_layers[laser_pass.name].index,
        "name": laser_pass.name,
        "minPower": f"{laser_pass.power_percent:g}",
        "maxPower": f"{laser_pass.power_percent:g}",
        "maxPower2": f"{laser_pass.power_percent:g}",
        "speed": f"{laser_pass.speed_mm_s:g}",
        "numPasses": laser_pass.repeats,
        "kerf": 0,
        "priority": priority,
    }
    if laser_pass.fills:
        options = drawing.setup.options
        values["interval"] = format_mm(drawing.setup.hatch_mm)
        values["angle"] = f"{options.hatch_deg:g}"
        values["anglePerPass"] = f"{options.hatch_turn_deg:g}"
    kind = "Scan+Cut" if laser_pass.fills else "Cut"
    inner = [f"<{name} Value={quoteattr(str(value))}/>" for name, value in values.items()]
    return [f'<CutSetting type="{kind}">', *inner, "</CutSetting>"]


def _tool_layer_lines() -> list[str]:
    inner = [f'<index Value="{TOOL_LAYER.index}"/>', '<name Value="T1"/>', '<priority Value="100"/>']
    return ['<CutSetting type="Tool">', *inner, "</CutSetting>"]


def _path_lines(laser_pass: LaserPass, index: int, first_number: int) -> list[str]:
    vertices = [f"V{format_mm(x)} {format_mm(y)}c0x1c1x1" for x, y in laser_pass.walls.xy_mm.tolist()]
    bounds = zip(laser_pass.walls.first[:-1].tolist(), laser_pass.walls.first[1:].tolist(), strict=True)
    return [
        f'<Shape Type="Path" CutIndex="{index}" VertID="{n}" PrimID="{n}"><XForm>1 0 0 1 0 0</XForm>'
        f"<VertList>{''.join(vertices[start:end])}</VertList><PrimList>LineClosed</PrimList></Shape>"
        for n, (start, end) in zip(np.arange(len(laser_pass.walls)) + first_number, bounds, strict=True)
    ]
