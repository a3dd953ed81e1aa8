"""Line drawings as SVG with y up and their own units: arrows, labels, cells of a layout."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, COLORS

INK, FAINT, ACCENT, PAPER = "#2b2f36", "#8a9099", "#d9480f", "#ffffff"
FONT = "Helvetica, Arial, sans-serif"
Point = tuple[float, float] | NDArray[np.float64]


class Sketch:
    """A drawing of ``size`` px that shows ``window`` (left, bottom, right, top) in its own units, y up."""

    def __init__(self, size: tuple[int, int], window: tuple[float, float, float, float]) -> None:
        import svgwrite

        self._svg = svgwrite.Drawing(size=size, viewBox=f"0 0 {size[0]} {size[1]}", debug=False)
        self._svg.add(self._svg.rect((0, 0), size, rx=8, fill=PAPER))
        self.scale = size[0] / (window[2] - window[0])
        self._corner = np.array([window[0], window[3]])

    def text_of(self) -> str:
        return f'<?xml version="1.0" encoding="utf-8" ?>\n{self._svg.tostring()}\n'

    def px(self, point: Point) -> tuple[float, float]:
        x, y = self.scale * (np.asarray(point, dtype=np.float64) - self._corner) * (1, -1)
        return round(float(x), 2), round(float(y), 2)

    def polygon(self, points: Iterable[Point], fill: str, stroke: str = "none", width: float = 1.0) -> None:
        places = [self.px(point) for point in points]
        self._svg.add(self._svg.polygon(places, fill=fill, stroke=stroke, stroke_width=width))

    def line(self, start: Point, end: Point, color: str = INK, width: float = 1.5, dash: str = "") -> None:
        style = {"stroke_dasharray": dash} if dash else {}
        self._svg.add(self._svg.line(self.px(start), self.px(end), stroke=color, stroke_width=width, **style))

    def dot(self, at: Point, radius_px: float = 4.0, fill: str = PAPER, stroke: str = INK) -> None:
        self._svg.add(self._svg.circle(self.px(at), radius_px, fill=fill, stroke=stroke, stroke_width=1.2))

    def text(self, at: Point, words: str, size: float = 13, color: str = INK, **options: Any) -> None:
        """Write a text. Options: ``anchor`` start, middle or end; ``bold``; ``halo``, a color behind the letters."""
        x, y = self.px(at)
        style: dict[str, Any] = {
            "font_family": FONT,
            "font_size": size,
            "text_anchor": options.get("anchor", "middle"),
            "font_weight": "bold" if options.get("bold") else "normal",
        }
        place = (x, round(y + 0.35 * size, 2))
        if options.get("halo"):
            halo = {"stroke": options["halo"], "stroke_width": 3.5, "stroke_linejoin": "round"}
            self._svg.add(self._svg.text(words, insert=place, fill=options["halo"], **halo, **style))
        self._svg.add(self._svg.text(words, insert=place, fill=color, **style))

    def arrow(self, start: Point, end: Point, color: str = INK, width: float = 1.8) -> None:
        tip, tail = np.array(self.px(end)), np.array(self.px(start))
        along = (tip - tail) / np.hypot(*(tip - tail))
        base = tip - (6 + 2 * width) * along
        self._line_px(tail, base, color, width)
        self._head_px(tip, along, color, width)

    def length(self, start: Point, end: Point, name: str, at: Point, anchor: str = "middle") -> None:
        """Draw a dimension: thin ends, an arrow to both sides, and the name of the length at ``at``."""
        ends = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
        across = 7 / self.scale * np.array([-along[1], along[0]])
        for each in ends:
            self.line(each - across, each + across, ACCENT, 1.0)
        if self.scale * np.hypot(*(ends[1] - ends[0])) > 24:
            middle = (ends[0] + ends[1]) / 2
            self.arrow(middle, ends[0], ACCENT, 1.2)
            self.arrow(middle, ends[1], ACCENT, 1.2)
        else:
            self.line(*ends, ACCENT, 2.4)
        self.text(at, name, 12, ACCENT, anchor=anchor, bold=True, halo=PAPER)

    def turn(
        self, centre: Point, radius: float, start_deg: float, end_deg: float, color: str = ACCENT
    ) -> None:
        """Draw an arc with an arrowhead about ``centre``, angles counter-clockwise from the right."""
        angles = np.radians(np.linspace(start_deg, end_deg, 40))
        places = [self.px(np.asarray(centre) + radius * np.array([np.cos(a), np.sin(a)])) for a in angles]
        self._svg.add(self._svg.polyline(places[:-2], fill="none", stroke=color, stroke_width=2.2))
        tip, before = np.array(places[-1]), np.array(places[-4])
        self._head_px(tip, (tip - before) / np.hypot(*(tip - before)), color, 2.2)

    def _line_px(self, start: Any, end: Any, color: str, width: float) -> None:
        ends = [tuple(round(float(v), 2) for v in point) for point in (start, end)]
        self._svg.add(self._svg.line(*ends, stroke=color, stroke_width=width))

    def _head_px(self, tip: Any, along: Any, color: str, width: float) -> None:
        length, side = 6 + 2.4 * width, np.array([-along[1], along[0]]) * (2.2 + 1.1 * width)
        corners = [tip, tip - length * along + side, tip - length * along - side]
        self._svg.add(self._svg.polygon([tuple(np.round(c, 2).tolist()) for c in corners], fill=color))

    def cells(self, layout: Layout, shift: Point = (0, 0), mirrored: bool = False) -> None:
        """Draw the ground and the colored cells of a layout; millimetres are the drawing's units."""

        def placed(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(points * ((-1 if mirrored else 1), 1) + np.asarray(shift))

        self.polygon(placed(layout.outline_mm), layout.palette["black"])
        for corners, color in zip(layout.cell_corners, layout.cell_color, strict=True):
            if color != BLACK:
                self.polygon(placed(layout.marker_xy_mm[corners]), layout.palette[COLORS[color]])
