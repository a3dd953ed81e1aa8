"""The product "print": several pads on a page, with all that tells how true the print is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.design import Design
from cmpdesign.errors import DesignError
from cmpdesign.layout import BLACK, COLORS, Layout
from cmpdesign.outline import mitres
from cmpdesign.products import Made
from cmpdesign.sheet_key import BAR_MM, CODE_MM, THICK_MM, X_BAR, Y_BAR, SheetKey
from cmpdesign.writers.page import Page, Shapes, Text, box, page_to_pdf, page_to_svg
from cmpdesign.writers.sheet_options import PAGES_MM, SheetOptions

FOLDER = "print"
INK, PAPER = "#000000", "#ffffff"
# Free for the printer's grip, and for the key at the left and the bottom.
MARGIN_MM, KEY_LEFT_MM, KEY_BOTTOM_MM = 10.0, 10.0, 32.0
CROP_MM, CROP_APART_MM, HAIRLINE_MM = 4.0, 1.0, 0.1
PATCH_MM, FRAME_MM = 6.0, 0.2
Points = NDArray[np.float64]


def make_print_sheet(design: Design, layout: Layout) -> Made:
    """``print/sheet.svg`` and ``print/sheet.pdf``.

    Raises:
        DesignError: not one pad fits on the page.
    """
    page, pads = print_page(design, layout)
    files: dict[str, str | bytes] = {f"{FOLDER}/sheet.svg": page_to_svg(page)}
    files[f"{FOLDER}/sheet.pdf"] = page_to_pdf(page)
    return Made(files, {"pads": pads, "page": design.sheet.page, "bleed_mm": design.sheet.bleed_mm})


def print_page(design: Design, layout: Layout) -> tuple[Page, int]:
    """The page, and how many pads are on it."""
    width, height = PAGES_MM[design.sheet.page]
    places = _places(design.sheet, layout, width, height)
    # A transparent page becomes black in many a viewer, and its code unreadable.
    items: list[Shapes | Text] = [Shapes([box(0, 0, width, height)], PAPER, "paper")]
    for place in places:
        items += _pad(layout, place, design.sheet.bleed_mm, design.print_mirror)
    items += _key(layout, height)
    items += _patches(layout, width, height)
    return Page(width, height, f"{layout.parameters.get('name') or layout.pattern}, print sheet", items), len(
        places
    )


def _places(option: SheetOptions, layout: Layout, width: float, height: float) -> list[Points]:
    """Upper left corner of each pad's bounding box, row by row."""
    around = 2 * (max(option.bleed_mm, CROP_APART_MM) + CROP_MM)
    step = np.array(layout.size_mm) + around
    left, bottom = MARGIN_MM + KEY_LEFT_MM, MARGIN_MM + KEY_BOTTOM_MM
    room = np.array([width - left - MARGIN_MM, height - MARGIN_MM - bottom])
    columns, rows = (int(n) for n in np.floor(room / step + 1e-9))
    if columns < 1 or rows < 1:
        raise DesignError(
            f"a pad of {layout.size_mm[0]:.4g} x {layout.size_mm[1]:.4g} mm with bleed and crop marks "
            "does not fit into "
            f"{room[0]:.4g} x {room[1]:.4g} mm on {option.page}; choose a larger sheet.page or a "
            "smaller pattern"
        )
    wanted = option.pads or columns * rows
    if wanted > columns * rows:
        raise DesignError(
            f"sheet.pads = {wanted}: only {columns * rows} fit on {option.page}; ask for fewer or "
            "choose a larger page"
        )
    # In the middle of the room across.
    corner = np.array([left + (room[0] - columns * step[0]) / 2, MARGIN_MM]) + around / 2
    return [corner + step * (n % columns, n // columns) for n in range(wanted)]


def _pad(layout: Layout, place: Points, bleed_mm: float, mirror: bool) -> list[Shapes | Text]:
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)

    def on_page(xy: Points) -> Points:
        x = high[0] - xy[..., 0] if mirror else xy[..., 0] - low[0]
        return np.stack([place[0] + x, place[1] + high[1] - xy[..., 1]], axis=-1)

    bleed = layout.outline_mm + bleed_mm * mitres(layout.outline_mm)
    items: list[Shapes | Text] = [Shapes([on_page(bleed)], layout.palette[COLORS[BLACK]])]
    for color, name in enumerate(COLORS):
        cells = layout.cell_corners[layout.cell_color == color]
        if color != BLACK and len(cells):
            items.append(Shapes(list(on_page(layout.marker_xy_mm[cells])), layout.palette[name]))
    items.append(Shapes(_crop_marks(place, layout.size_mm, max(bleed_mm, CROP_APART_MM)), INK))
    return items


def _crop_marks(place: Points, size_mm: tuple[float, float], away: float) -> list[Points]:
    """Two hairlines at each corner of the pad's bounding box, beginning outside the bleed."""
    (left, top), (right, bottom) = place, place + size_mm
    half = HAIRLINE_MM / 2
    marks = []
    for x in (left, right):
        marks += [
            box(x - half, top - away - CROP_MM, 2 * half, CROP_MM),
            box(x - half, bottom + away, 2 * half, CROP_MM),
        ]
    for y in (top, bottom):
        marks += [
            box(left - away - CROP_MM, y - half, CROP_MM, 2 * half),
            box(right + away, y - half, CROP_MM, 2 * half),
        ]
    return marks


def _key(layout: Layout, height: float) -> list[Shapes | Text]:
    """QR code, scale bars and text, in the lower left corner."""
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
        box(left + module * c, top + module * r, module, module) for r, c in np.argwhere(matrix).tolist()
    ]
    half = THICK_MM / 2
    x_bar = box(left + X_BAR[0][0], top + X_BAR[0][1] - half, BAR_MM, THICK_MM)
    y_bar = box(left + Y_BAR[1][0] - half, top + Y_BAR[1][1], THICK_MM, BAR_MM)
    text_x = left + X_BAR[0][0]
    width, tall = layout.size_mm
    lines = (
        name,
        f"{layout.pattern}, {key.layers} layers, pitch {key.pitch_mm:.6g} mm, {width:.4g} x {tall:.4g} mm",
        f"digest {layout.digest[:32]}",
        f"{layout.digest[32:]}",
        "print at 100 %, not fitted to the page",
    )
    items: list[Shapes | Text] = [Shapes(modules, INK, "code"), Shapes([x_bar, y_bar], INK, "scale")]
    items += [Text(line, text_x, top + 3 + 3.4 * n, 2.6) for n, line in enumerate(lines)]
    items.append(Text(f"{BAR_MM:g} mm", text_x, top + X_BAR[0][1] + 4, 2.6))
    items.append(Text(f"{BAR_MM:g} mm", left + Y_BAR[0][0] - 2, top + Y_BAR[0][1], 2.6, turned=True))
    return items


def _patches(layout: Layout, width: float, height: float) -> list[Shapes | Text]:
    """One patch a color, with its name and value, in the lower right corner."""
    names = [name for number, name in enumerate(COLORS) if (layout.cell_color == number).any()]
    items: list[Shapes | Text] = []
    for number, name in enumerate(names):
        x = width - MARGIN_MM - (len(names) - number) * (PATCH_MM + 8)
        y = height - MARGIN_MM - PATCH_MM - 6
        frame = box(x - FRAME_MM, y - FRAME_MM, PATCH_MM + 2 * FRAME_MM, PATCH_MM + 2 * FRAME_MM)
        items += [Shapes([frame], INK), Shapes([box(x, y, PATCH_MM, PATCH_MM)], layout.palette[name])]
        items += [
            Text(name, x, y + PATCH_MM + 3, 2.2),
            Text(layout.palette[name], x, y + PATCH_MM + 5.6, 2.2),
        ]
    return items
