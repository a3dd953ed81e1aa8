"""Laser layers: LightBurn's numbers and colors. LightBurn matches colors by exact value only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.laser.job import LaserJob
from cmpdesign.products.laser.paths.strokes import DECIMALS


@dataclass(frozen=True)
class LaserLayer:
    """A laser layer: LightBurn's index and color (0xRRGGBB), and the AutoCAD color index."""

    index: int
    rgb: int
    aci: int


# Palette of LightBurn: https://docs.lightburnsoftware.com, colors 00 to 11, tool layer T1 (index 30).
LASER_LAYERS = (
    LaserLayer(0, 0x000000, 7),
    LaserLayer(1, 0x0000FF, 5),
    LaserLayer(2, 0xFF0000, 1),
    LaserLayer(3, 0x00E000, 3),
    LaserLayer(4, 0xD0D000, 2),
    LaserLayer(5, 0xFF8000, 30),
    LaserLayer(6, 0x00E0E0, 4),
    LaserLayer(7, 0xFF00FF, 6),
    LaserLayer(8, 0xB4B4B4, 9),
    LaserLayer(9, 0x0000A0, 174),
    LaserLayer(10, 0xA00000, 14),
    LaserLayer(11, 0x00A000, 94),
)
TOOL_LAYER = LaserLayer(30, 0xF36926, 30)
_LAYER_OF_COLOR = {"red": 2, "green": 3, "blue": 1, "white": 4}
_LAYER_OF_KIND = {"holes": 5, "outline": 0}
_SPARE_LAYERS = (6, 7)


def job_layers(job: LaserJob) -> Mapping[str, LaserLayer]:
    """The laser layer of every pass, by the pass' name; the second pass of a color gets a spare laser layer."""
    chosen: dict[str, LaserLayer] = {}
    spare = iter(_SPARE_LAYERS)
    for laser_pass in job.passes:
        number = (
            _LAYER_OF_KIND.get(laser_pass.kind)
            if laser_pass.color is None
            else _LAYER_OF_COLOR[COLORS[laser_pass.color]]
        )
        assert number is not None
        taken = LASER_LAYERS[number] in chosen.values()
        chosen[laser_pass.name] = LASER_LAYERS[next(spare)] if taken else LASER_LAYERS[number]
    return chosen


def hex_color(laser_layer: LaserLayer) -> str:
    """The color as "#RRGGBB"."""
    return f"#{laser_layer.rgb:06X}"


def format_mm(value: float) -> str:
    """Format a coordinate in mm, to 0.1 micrometre, without trailing zeros."""
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
