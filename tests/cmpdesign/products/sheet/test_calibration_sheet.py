"""Sheets of any page, and the ruler line: true to size in the picture of another program's renderer."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import resvg_py

from cmpdesign import build_layout, load
from cmpdesign.errors import DesignError
from cmpdesign.products.sheet.print_sheet import prepare_print_sheet

DPI = 254  # 10 px/mm


def sheet_svg(**values: str) -> str:
    design = load("honeycomb", {"layers": "6", "sheet.pads": "1", **values})
    svg = prepare_print_sheet(design, build_layout(design)).make().files["print/sheet.svg"]
    assert isinstance(svg, str)
    return svg


def picture(svg: str) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    png = bytes(resvg_py.svg_to_bytes(svg_string=svg, dpi=DPI))
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE), np.uint8)


@pytest.mark.parametrize(
    ("page", "size_mm"),
    [
        ("a5", (148, 210)),
        ("legal", (215.9, 355.6)),
        ("300x200mm", (300, 200)),
        ("120x140.5 mm", (120, 140.5)),
    ],
)
def test_the_page_has_the_size_that_is_asked_for(page: str, size_mm: tuple[float, float]) -> None:
    height, width = picture(sheet_svg(**{"sheet.page": page, "sheet.ruler": "true"})).shape
    np.testing.assert_allclose((width / 10, height / 10), size_mm, atol=0.1)


def test_the_ruler_is_true_to_size() -> None:
    """The marks are a millimetre apart, the long ones a centimetre, and nothing else of the page changes place."""
    plain, ruled = (picture(sheet_svg(**{"sheet.ruler": ruler})) for ruler in ("false", "true"))
    added = np.argwhere((ruled < 128) & (plain > 200))
    line_y = int(np.bincount(added[:, 0]).argmax())
    for below_mm, step_mm in ((1.5, 1), (2.5, 5), (3.5, 10)):
        dark = ruled[line_y + int(10 * below_mm)] < 160
        dark[:190] = False  # the key's bar
        starts = np.flatnonzero(dark[1:] & ~dark[:-1])
        np.testing.assert_allclose(np.diff(starts), 10 * step_mm, atol=1.01)
        assert abs((starts[-1] - starts[0]) / 10 - 180) < 0.15


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sheet.page": "b7"}, "'b7' is no page; there are a5, a4"),
        ({"sheet.page": "300x200"}, 'sizes such as "300x200mm"'),
        ({"sheet.page": "9000x200mm"}, "9000x200mm is longer than 5000 mm"),
        ({"sheet.page": "40x60mm"}, "does not fit into"),
    ],
)
def test_a_page_that_cannot_be_printed_is_refused(values: dict[str, str], message: str) -> None:
    with pytest.raises(DesignError, match=message):
        sheet_svg(**values)


def test_the_code_stands_on_the_sheet() -> None:
    assert "code 3, digest" in sheet_svg(code="3")
    assert "code 3" not in sheet_svg()
