"""G-code for GRBL 1.1.

M4 (dynamic power) scales S with the actual speed, so corners are not burnt deeper than sides. With laser mode on
($32=1), G0 does not burn. The speed is written once per pass, the power at each change.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from cmpdesign import __version__
from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import format_mm
from cmpdesign.products.laser.job import LaserPass, PassKind
from cmpdesign.products.laser.paths.strokes import Strokes

# Pauses after the kinds of passes that are followed by manual work; the last pass has no pause.
PAUSES: Mapping[PassKind, str] = {
    "holes": "M0 ; put the pins into the holes, they stay to the end",
    "cells": "M0 ; take the pad out, fill, cure, put it back on its pins",
}


def drawing_to_gcode(drawing: LaserDrawing) -> str:
    """Format the program of the passes; the program pauses after holes and cells, but not after the last pass."""
    machine = drawing.setup.machine
    lines = [
        f"; cmpdesign {__version__}: {_plain_comment(drawing.name)}",
        f"; machine: {_plain_comment(machine.name)}, $30={machine.s_max.value:g}, $32=1",
        "; origin: lower left corner of the bed, mm",
        *([] if drawing.setup.compensated else ["; paths are the outlines: not compensated for the kerf"]),
        "G21",
        "G90",
        "G94",
        "G17",
        "M5",
    ]
    for index, laser_pass in enumerate(drawing.passes):
        lines += _pass_program(laser_pass, machine.s_max.value)
        if index + 1 < len(drawing.passes) and laser_pass.kind in PAUSES:
            lines.append(PAUSES[laser_pass.kind])
    return "\n".join([*lines, "G0 X0 Y0 S0", "M2", ""])


def _pass_program(laser_pass: LaserPass, s_max: float) -> list[str]:
    power = f"S{format_mm(laser_pass.power_percent / 100 * s_max)}"
    settings = f"{laser_pass.power_percent:g} %, {laser_pass.speed_mm_s:g} mm/s, {laser_pass.repeats} times"
    lines = [f"; {laser_pass.name}: {settings}"]
    lines += ["M4 S0", f"G1 F{format_mm(60 * laser_pass.speed_mm_s)}"]
    repeated = None if laser_pass.fills else _move_lines(laser_pass.burn_strokes(0), power)
    for repeat in range(laser_pass.repeats):
        lines += repeated or _move_lines(laser_pass.burn_strokes(repeat), power)
    return [*lines, "M5"]


def _move_lines(strokes: Strokes, power: str) -> list[str]:
    places = [f"X{format_mm(x)} Y{format_mm(y)}" for x, y in strokes.xy_mm.tolist()]
    lines: list[str] = []
    first = strokes.first.tolist()
    for start, end in pairwise(first):
        lines += [f"G0 {places[start]} S0", f"G1 {places[start + 1]} {power}"]
        lines += [f"G1 {place}" for place in places[start + 2 : end]]
    return lines


def _plain_comment(text: str) -> str:
    """A comment in printable ASCII without the characters that end or begin a comment."""
    return "".join(c if c.isascii() and c.isprintable() and c not in "();%" else "_" for c in text)
