"""The product "print": several pads on a page, with crop marks, scale bars, color patches and a QR code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.design.sheet_options import SheetOptions, page_size_mm
from cmpdesign.errors import DesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.outline import corner_offsets
from cmpdesign.layout.side import seen_side
from cmpdesign.libraries import extra
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.as_made.made_pad import MadePad, make_pad
from cmpdesign.products.registry import ProductFiles
from cmpdesign.products.sheet.key import BAR_MM, CODE_MM, THICK_MM, X_BAR, Y_BAR, SheetKey
from cmpdesign.products.sheet.page import (
    FilledPolygons,
    Page,
    TextLine,
    page_to_pdf,
    page_to_svg,
    rectangle_points,
)
from cmpdesign.products.sheet.ruler import RULER_MM, ruler_items

FOLDER = "print"
INK, PAPER = "#000000", "#ffffff"
# Margin for the printer's grip; further margin at the left and the bottom, for the key.
MARGIN_MM, KEY_LEFT_MM, KEY_BOTTOM_MM = 10.0, 10.0, 32.0
CROP_MM, CROP_APART_MM, HAIRLINE_MM = 4.0, 0.5, 0.1
# Sine of the least turn of a corner with crop marks: 30 to 150 degrees.
SHARP = 0.5 - 1e-9
PATCH_MM, FRAME_MM = 6.0, 0.2
PATCH_STEP_MM = 9.0, 14.0  # from patch to patch: smallest, for the text below, and usual
# Height of letters, and width of the mean letter of Helvetica in units of it.
TEXT_MM, EM_PER_LETTER = 2.6, 0.56
Points = NDArray[np.float64]


def make_print_sheet(design: Design, layout: Layout) -> ProductFiles:
    """Make ``print/sheet.svg`` and ``print/sheet.pdf``.

    Raises:
        DesignError: no pad fits on the page, or fewer pads fit than the design states.
    """
    page, pads = make_print_page(design, layout)
    files: dict[str, str | bytes] = {f"{FOLDER}/sheet.svg": page_to_svg(page)}
    files[f"{FOLDER}/sheet.pdf"] = page_to_pdf(page)
    side = print_side(design)
    figures = {
        "pads": pads,
        "page": design.sheet.page,
        "bleed_mm": design.sheet.bleed_mm,
        "film": side.film,
        "mirrored": side.mirror,
    }
    return ProductFiles(files, figures, made_pad=made_pad(design, layout))


def made_pad(design: Design, layout: Layout) -> MadePad:
    """The pad as printed: nominal cells."""
    return make_pad(layout, "print", list(layout.colored_outlines_mm))


class PrintSide(NamedTuple):
    """The print of a pad on a film.

    Attributes:
        film: "opaque": the camera sees the print directly; "clear": through the film.
        seen: the side of the pattern that the camera sees.
        mirror: the page shows the pattern mirrored.
        text: one line for the page.
    """

    film: str
    seen: str
    mirror: bool
    text: str


def print_side(design: Design) -> PrintSide:
    """The film, the printed side and the mirroring of a design.

    The print is as seen by the camera if the camera sees the ink directly, and mirrored if the camera sees the ink
    through the film.
    """
    seen = seen_side(design.mirrored)
    film = design.sheet.film or ("opaque" if seen == "front" else "clear")
    mirror = (seen == "back") != (film == "clear")
    text = f"camera sees the {seen}: "
    text += "print on the side that faces it" if film == "opaque" else "print on the far side of a clear film"
    if design.print_mirror:
        mirror, text = not mirror, f"{text}, by transfer"
    return PrintSide(film, seen, mirror, text)


def make_print_page(design: Design, layout: Layout) -> tuple[Page, int]:
    """The page, and the number of pads on the page."""
    width, height = page_size_mm(design.sheet.page)
    places = _pad_places(design.sheet, layout, width, height)
    # Many viewers show a transparent page black, which makes the code unreadable.
    items: list[FilledPolygons | TextLine] = [
        FilledPolygons([rectangle_points(0, 0, width, height)], PAPER, "paper")
    ]
    for place in places:
        items += _pad_items(layout, place, design)
    items.append(
        FilledPolygons(
            [mark for place in places for mark in _fiducial_polygons(layout, place, design)], INK, "crop"
        )
    )
    items += _key_items(layout, width, height, print_side(design).text)
    items += _color_patch_items(layout, width, height)
    if design.sheet.ruler:
        items += ruler_items(MARGIN_MM + KEY_LEFT_MM, height - MARGIN_MM - KEY_BOTTOM_MM, width - MARGIN_MM)
    title = f"{layout.parameters.get('name') or layout.pattern}, print sheet"
    return Page(width, height, title, items), len(places)


def _pad_places(option: SheetOptions, layout: Layout, width: float, height: float) -> list[Points]:
    """(2,) upper left corner of each pad's bounding box on the page, row by row, mm."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    printed = np.concatenate(
        [_bleed_outline(layout, option), *crop_marks(layout.outline_mm, option.bleed_mm)]
    )
    margin = np.maximum(low - printed.min(axis=0), printed.max(axis=0) - high)
    spacing = np.array(layout.size_mm) + 2 * margin
    left, bottom = MARGIN_MM + KEY_LEFT_MM, MARGIN_MM + KEY_BOTTOM_MM + RULER_MM * option.ruler
    usable = np.array([width - left - MARGIN_MM, height - MARGIN_MM - bottom])
    columns, rows = (int(n) for n in np.floor(usable / spacing + 1e-9))
    if columns < 1 or rows < 1:
        raise DesignError(
            f"a pad of {layout.size_mm[0]:.4g} x {layout.size_mm[1]:.4g} mm with bleed and crop marks "
            "does not fit into "
            f"{usable[0]:.4g} x {usable[1]:.4g} mm on {option.page}; choose a larger sheet.page or a "
            "smaller pattern"
        )
    wanted = option.pads or columns * rows
    if wanted > columns * rows:
        raise DesignError(
            f"sheet.pads = {wanted}: only {columns * rows} fit on {option.page}; ask for fewer or "
            "choose a larger page"
        )
    # The columns are centred in the usable width.
    corner = np.array([left + (usable[0] - columns * spacing[0]) / 2, MARGIN_MM]) + margin
    return [corner + spacing * (n % columns, n // columns) for n in range(wanted)]


def _pad_items(layout: Layout, place: Points, design: Design) -> list[FilledPolygons | TextLine]:
    """The ground with bleed, then the cells color by color."""
    ground = _page_from_layout(_bleed_outline(layout, design.sheet), layout, place, design)
    items: list[FilledPolygons | TextLine] = [FilledPolygons([ground], layout.palette[COLORS[BLACK]])]
    for color, name in enumerate(COLORS):
        cells = layout.cell_corners[layout.cell_color == color]
        if color != BLACK and len(cells):
            corners = _page_from_layout(layout.marker_xy_mm[cells], layout, place, design)
            items.append(FilledPolygons(list(corners), layout.palette[name]))
    return items


def _bleed_outline(layout: Layout, option: SheetOptions) -> Points:
    """(K, 2) the pad's outline, ``bleed_mm`` further out."""
    outline: Points = layout.outline_mm + option.bleed_mm * corner_offsets(layout.outline_mm)
    return outline


def _fiducial_polygons(layout: Layout, place: Points, design: Design) -> list[Points]:
    marks = crop_marks(layout.outline_mm, design.sheet.bleed_mm)
    return [_page_from_layout(mark, layout, place, design) for mark in marks]


def _page_from_layout(xy: Points, layout: Layout, place: Points, design: Design) -> Points:
    """(..., 2) points from the layout's frame to the page; ``place``: corner of the pad, see ``_pad_places``."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    x = high[0] - xy[..., 0] if print_side(design).mirror else xy[..., 0] - low[0]
    return np.stack([place[0] + x, place[1] + high[1] - xy[..., 1]], axis=-1)


def crop_marks(outline_mm: Points, bleed_mm: float) -> list[Points]:
    """Hairlines that continue the pad's sides beyond the corners; a ruler laid on two hairlines shows the cut.

    The marks of a round or non-convex outline are those of its bounding box.

    Args:
        outline_mm: (N, 2) counter-clockwise.
        bleed_mm: width of the bleed; the marks begin ``CROP_APART_MM`` outside the bleed.

    Returns:
        Two (4, 2) outlines per corner.
    """
    corners, sine = outline_mm, _turn_sines(outline_mm)
    if (sine < SHARP).any():
        (left, low), (right, high) = outline_mm.min(axis=0), outline_mm.max(axis=0)
        corners = np.array([(left, low), (right, low), (right, high), (left, high)])
        sine = np.ones(4)
    before, after = (
        _unit_directions(np.roll(corners, 1, axis=0), corners),
        _unit_directions(np.roll(corners, -1, axis=0), corners),
    )
    marks = []
    # A continued side leaves the bleed of the next side at this distance from the corner.
    distances = (bleed_mm + CROP_APART_MM) / sine
    for corner, distance, *directions in zip(corners, distances, before, after, strict=True):
        marks += [_hairline_polygon(corner + distance * direction, direction) for direction in directions]
    return marks


def _turn_sines(outline: Points) -> Points:
    """(N,) sine of the angle by which the outline turns to the left at each corner."""
    before = _unit_directions(np.roll(outline, 1, axis=0), outline)
    after = _unit_directions(outline, np.roll(outline, -1, axis=0))
    sines: Points = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return sines


def _unit_directions(start: Points, end: Points) -> Points:
    """(N, 2) unit vectors from start to end."""
    direction: Points = (end - start) / np.hypot(*(end - start).T)[:, None]
    return direction


def _hairline_polygon(start: Points, direction: Points) -> Points:
    """(4, 2) corners of a hairline of length ``CROP_MM``."""
    half = HAIRLINE_MM / 2 * np.array([-direction[1], direction[0]])
    end = start + CROP_MM * direction
    return np.array([start - half, end - half, end + half, start + half])


def _key_items(
    layout: Layout, width: float, height: float, side_text: str
) -> list[FilledPolygons | TextLine]:
    """QR code, scale bars and text, in the lower left corner; the text stands above the color patches."""
    with extra("print"):
        import segno

    parameters = layout.parameters
    name = str(parameters.get("name") or layout.pattern)
    key = SheetKey(
        layout.digest, name[:40], layout.pattern, int(parameters["layers"]), float(parameters["pitch_mm"])
    )
    left, top = MARGIN_MM, height - MARGIN_MM - CODE_MM
    matrix = np.array([list(row) for row in segno.make_qr(key.text(), error="m").matrix], dtype=bool)
    module = CODE_MM / len(matrix)
    modules = [
        rectangle_points(left + module * c, top + module * r, module, module)
        for r, c in np.argwhere(matrix).tolist()
    ]
    half = THICK_MM / 2
    x_bar = rectangle_points(left + X_BAR[0][0], top + X_BAR[0][1] - half, BAR_MM, THICK_MM)
    y_bar = rectangle_points(left + Y_BAR[1][0] - half, top + Y_BAR[1][1], THICK_MM, BAR_MM)
    text_x = left + X_BAR[0][0]
    pad_width, pad_height = layout.size_mm
    lines = (
        name,
        f"{layout.pattern}, {key.layers} layers, pitch {key.pitch_mm:.6g} mm, "
        f"{pad_width:.4g} x {pad_height:.4g} mm",
        f"digest {layout.digest[:32]}"
        if layout.code is None
        else f"code {layout.code.id}, digest {layout.digest[:32]}",
        f"{layout.digest[32:]}",
        "print at 100 %, not fitted to the page",
        side_text,
    )
    items: list[FilledPolygons | TextLine] = [
        FilledPolygons(modules, INK, "code"),
        FilledPolygons([x_bar, y_bar], INK, "scale"),
    ]
    longest_em = EM_PER_LETTER * max(map(len, lines))
    size = min(TEXT_MM, (width - MARGIN_MM - text_x) / longest_em)
    items += [TextLine(line, text_x, top - 5.6 + 3.2 * n, size) for n, line in enumerate(lines)]
    items.append(TextLine(f"{BAR_MM:g} mm", text_x, top + X_BAR[0][1] + 4, 2.6))
    items.append(TextLine(f"{BAR_MM:g} mm", left + Y_BAR[0][0] - 2, top + Y_BAR[0][1], 2.6, turned=True))
    return items


def _color_patch_items(layout: Layout, width: float, height: float) -> list[FilledPolygons | TextLine]:
    """One patch per color with the color's name and value, in the lower right corner; none where the page has no room
    beside the scale bar.
    """
    names = [name for number, name in enumerate(COLORS) if (layout.cell_color == number).any()]
    items: list[FilledPolygons | TextLine] = []
    room_mm = width - 2 * MARGIN_MM - X_BAR[1][0] - 2
    step_mm = min(PATCH_STEP_MM[1], room_mm / len(names))
    if step_mm < PATCH_STEP_MM[0]:
        return items
    for number, name in enumerate(names):
        x = width - MARGIN_MM - (len(names) - number) * step_mm
        y = height - MARGIN_MM - PATCH_MM - 6
        frame = rectangle_points(x - FRAME_MM, y - FRAME_MM, PATCH_MM + 2 * FRAME_MM, PATCH_MM + 2 * FRAME_MM)
        items += [
            FilledPolygons([frame], INK),
            FilledPolygons([rectangle_points(x, y, PATCH_MM, PATCH_MM)], layout.palette[name]),
        ]
        items += [
            TextLine(name, x, y + PATCH_MM + 3, 2.2),
            TextLine(layout.palette[name], x, y + PATCH_MM + 5.6, 2.2),
        ]
    return items
