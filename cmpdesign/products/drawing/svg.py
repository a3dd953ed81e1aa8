"""pattern.svg: true size (1 user unit = 1 mm), one group per color, one closed path per cell."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.files.atomic import write_file
from cmpdesign.layout.layout import DECIMALS, Layout
from cmpdesign.patterns.colors import BLACK, COLORS

# Height of the strip for scale bar and caption.
SCALE_STRIP_MM = 6.0
_TEXT_COLOR = "#000000"
_FONT = {"font_family": "sans-serif"}
# Width of the mean letter of a wide sans-serif face, in units of the font size.
_EM_PER_LETTER = 0.6

SheetMap = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def write_svg(
    layout: Layout, path: str | Path, *, ids: bool = False, scale: bool = False, mirror: bool = False
) -> None:
    """Write ``layout_to_svg`` to a file.

    Raises:
        OutputError: the file cannot be written.
    """
    write_file(path, layout_to_svg(layout, ids=ids, scale=scale, mirror=mirror))


def layout_to_svg(layout: Layout, *, ids: bool = False, scale: bool = False, mirror: bool = False) -> str:
    """Format the pattern as SVG: width, height and viewBox in mm, y down from the top of the outline.

    Path data hold final coordinates; no transform is applied. The ground (group "black") is drawn first. Black
    cells belong to the ground and have no path of their own.

    Args:
        layout: the pattern.
        ids: add the id of every present marker in small white letters (group "ids").
        scale: add a scale bar and a caption below the pattern (group "scale").
        mirror: mirror the drawing left to right, for film that is transferred face down.

    Returns:
        The text of the file.
    """
    import svgwrite

    width, height = layout.size_mm
    sheet_height = round(height + (SCALE_STRIP_MM if scale else 0.0), DECIMALS)
    to_sheet = sheet_from_layout(layout, mirror)
    drawing = svgwrite.Drawing(
        size=(f"{width!r}mm", f"{sheet_height!r}mm"),
        viewBox=f"0 0 {width!r} {sheet_height!r}",
        debug=False,
    )
    drawing.set_desc(title=_caption_text(layout))
    ground = drawing.g(id=COLORS[BLACK], fill=layout.palette[COLORS[BLACK]])
    ground.add(drawing.path(d=_closed_path(to_sheet(layout.outline_mm).tolist())))
    drawing.add(ground)

    xy = to_sheet(layout.marker_xy_mm)
    for color, name in enumerate(COLORS):
        if color != BLACK:
            drawing.add(_cell_group(drawing, layout, xy, color, name))
    if ids:
        drawing.add(_id_group(drawing, layout, xy, mirror))
    if scale:
        drawing.add(_scale_group(drawing, layout, mirror))
    return f'<?xml version="1.0" encoding="utf-8" ?>\n{drawing.tostring()}\n'


def layout_to_compact_svg(layout: Layout, *, mirror: bool = False) -> str:
    """The pattern for a screen: the same coordinates as in ``layout_to_svg``, with one path a color.

    Args:
        layout, mirror: see ``layout_to_svg``.
    """
    width, height = layout.size_mm
    to_sheet = sheet_from_layout(layout, mirror)
    places = [f"{x!r} {y!r}" for x, y in to_sheet(layout.marker_xy_mm).tolist()]
    data = {COLORS[BLACK]: _closed_path(to_sheet(layout.outline_mm).tolist())}
    for color, name in enumerate(COLORS):
        if color != BLACK:
            cells = layout.cell_corners[layout.cell_color == color].tolist()
            data[name] = "".join(f"M{'L'.join([places[marker] for marker in cell])}Z" for cell in cells)
    paths = "".join(
        f'<path class="{name}" fill="{layout.palette[name]}" d="{of_color}"/>'
        for name, of_color in data.items()
    )
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width!r} {height!r}">{paths}</svg>\n'


def sheet_from_layout(layout: Layout, mirror: bool) -> SheetMap:
    """The map of (N, 2) points, mm, from the layout's frame to the drawing's: x right, y down, from its top left."""
    left = layout.outline_mm[:, 0].min()
    right, top = layout.outline_mm.max(axis=0)

    def to_sheet(xy_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        x = right - xy_mm[:, 0] if mirror else xy_mm[:, 0] - left
        return np.round(np.stack([x, top - xy_mm[:, 1]], axis=-1), DECIMALS) + 0.0

    return to_sheet


def _closed_path(points: list[list[float]]) -> str:
    return "M" + "L".join(f"{x!r} {y!r}" for x, y in points) + "Z"


def _cell_group(drawing: Any, layout: Layout, xy: NDArray[np.float64], color: int, name: str) -> Any:
    group = drawing.g(id=name, fill=layout.palette[name])
    for corners in xy[layout.cell_corners[layout.cell_color == color]].tolist():
        group.add(drawing.path(d=_closed_path(corners)))
    return group


def _id_group(drawing: Any, layout: Layout, xy: NDArray[np.float64], mirror: bool) -> Any:
    size = round(0.22 * float(layout.parameters["pitch_mm"]), 3)
    group = drawing.g(id="ids", fill="#ffffff", font_size=size, **_FONT, text_anchor="middle")
    for marker in np.flatnonzero(layout.present).tolist():
        x, y = xy[marker].tolist()
        group.add(_text_element(drawing, str(marker), x, round(y + 0.35 * size, DECIMALS), mirror))
    return group


def _scale_group(drawing: Any, layout: Layout, mirror: bool) -> Any:
    """A bar labelled with its length, and below it a caption whose font is at most as wide as the drawing."""
    width, height = layout.size_mm
    length = scale_length_mm(width)
    caption = _caption_text(layout)
    size = round(min(2.0, width / (_EM_PER_LETTER * len(caption))), 3)
    group = drawing.g(id="scale", fill=_TEXT_COLOR, font_size=size, **_FONT)
    group.add(drawing.rect(insert=(width - length if mirror else 0.0, height + 1.5), size=(length, 0.4)))
    for text, left, y in ((f"{length:g} mm", length + 0.5, height + 2.2), (caption, 0.0, height + 5.0)):
        group.add(_text_element(drawing, text, width - left if mirror else left, y, mirror))
    return group


def scale_length_mm(width_mm: float) -> float:
    """The largest of 1, 2, 5, 10, ... mm that is at most half the width."""
    decade = 10.0 ** np.floor(np.log10(width_mm / 2))
    return float(max(digit * decade for digit in (1, 2, 5) if digit * decade <= width_mm / 2))


def _text_element(drawing: Any, text: str, x: float, y: float, mirror: bool) -> Any:
    """A text at a place in mm; mirrored with the drawing, so that the text is legible after the transfer."""
    if not mirror:
        return drawing.text(text, insert=(x, y))
    return drawing.text(text, insert=(0, 0), transform=f"translate({x!r} {y!r}) scale(-1 1)")


def _caption_text(layout: Layout) -> str:
    width, height = layout.size_mm
    name = layout.parameters.get("name") or layout.pattern
    pitch = float(layout.parameters["pitch_mm"])
    return f"{name}: {int(layout.present.sum())} markers, pitch {pitch:.4g} mm, {width:.4g} x {height:.4g} mm"
