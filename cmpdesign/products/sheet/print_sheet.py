"""The product "print": several pads on a page, with crop marks, scale bars, color patches and a QR code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design.design import Design
from cmpdesign.design.sheet_options import SheetOptions, page_size_mm
from cmpdesign.errors import DesignError
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.measures import cell_widths_mm
from cmpdesign.layout.outline import Points
from cmpdesign.libraries import extra
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.as_made.made_pad import Cause, MadePad, make_pad
from cmpdesign.products.registry import ProductFiles
from cmpdesign.products.sheet.film import film_pages
from cmpdesign.products.sheet.key import BAR_MM, CODE_MM, THICK_MM, X_BAR, Y_BAR, SheetKey
from cmpdesign.products.sheet.page import (
    FilledPolygons,
    Page,
    TextLine,
    fitted_size_mm,
    page_to_svg,
    pages_to_pdf,
    rectangle_points,
)
from cmpdesign.products.sheet.printed_pad import (
    bleed_outline,
    crop_mark_polygons,
    crop_marks,
    pad_items,
    print_side,
)
from cmpdesign.products.sheet.ruler import RULER_MM, ruler_items

FOLDER = "print"
INK, PAPER = "#000000", "#ffffff"
# Margin for the printer's grip; further margin at the left and the bottom, for the key.
MARGIN_MM, KEY_LEFT_MM, KEY_BOTTOM_MM = 10.0, 10.0, 32.0
PATCH_MM, FRAME_MM = 6.0, 0.2
PATCH_STEP_MM = 9.0, 14.0  # from patch to patch: smallest, for the text below, and usual
TEXT_MM = 2.6


def make_print_sheet(design: Design, layout: Layout) -> ProductFiles:
    """Make ``print/sheet.svg``, ``print/sheet.pdf`` and ``print/film.pdf``.

    Raises:
        DesignError: no pad fits on the page, or fewer pads fit than the design states.
    """
    page, pads = make_print_page(design, layout)
    files: dict[str, str | bytes] = {f"{FOLDER}/sheet.svg": page_to_svg(page)}
    files[f"{FOLDER}/sheet.pdf"] = pages_to_pdf(page)
    files[f"{FOLDER}/film.pdf"] = pages_to_pdf(*film_pages(design, layout))
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
    """The pad as printed: the black ground spreads into every cell, but not where two cells touch.

    Raises:
        DesignError: nothing of a cell stays.
    """
    gain_mm = design.sheet.dot_gain_mm
    free_mm = float(cell_widths_mm(layout)[layout.colored_cells].min()) / 2
    if gain_mm >= free_mm:
        raise DesignError(
            f"sheet.dot_gain_mm = {gain_mm:g}: the ink closes cells, whose smallest inner radius is {free_mm:.3g} mm; "
            "make pitch_mm larger"
        )
    corners = layout.cell_corners[layout.colored_cells]
    sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1), axis=-1)
    _, place, cells_beside = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    gains = np.where(cells_beside[place.ravel()] == 1, gain_mm, 0.0).reshape(corners.shape)
    cells = [_moved_inward(ring, gain) for ring, gain in zip(layout.colored_outlines_mm, gains, strict=True)]
    return make_pad(layout, "print", cells, (Cause("sheet.dot_gain_mm", gain_mm),))


def _moved_inward(ring: Points, gains_mm: NDArray[np.float64]) -> Points:
    """(K, 2) corners whose sides, each from its corner to the next one, moved inward by (K,) lengths."""
    side = np.roll(ring, -1, axis=0) - ring
    inward = np.stack([-side[:, 1], side[:, 0]], axis=-1) / np.hypot(*side.T)[:, None]
    lines = np.stack([np.roll(inward, 1, axis=0), inward], axis=1)
    moved: Points = (
        ring + np.linalg.solve(lines, np.stack([np.roll(gains_mm, 1), gains_mm], axis=1)[..., None])[..., 0]
    )
    return moved


def make_print_page(design: Design, layout: Layout) -> tuple[Page, int]:
    """The page, and the number of pads on the page."""
    width, height = page_size_mm(design.sheet.page)
    places = _pad_places(design.sheet, layout, width, height)
    # Many viewers show a transparent page black, which makes the code unreadable.
    items: list[FilledPolygons | TextLine] = [
        FilledPolygons([rectangle_points(0, 0, width, height)], PAPER, "paper")
    ]
    for place in places:
        items += pad_items(layout, place, design)
    items.append(
        FilledPolygons(
            [mark for place in places for mark in crop_mark_polygons(layout, place, design)], INK, "crop"
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
    printed = np.concatenate([bleed_outline(layout, option), *crop_marks(layout.outline_mm, option.bleed_mm)])
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
    size = fitted_size_mm(lines, width - MARGIN_MM - text_x, TEXT_MM)
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
