"""Print sheets: their content, true to size, and the reading of a scan."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from shapely import Polygon, STRtree, box, unary_union
from typer.testing import CliRunner

from cmpdesign import build_layout, load
from cmpdesign.cli import app
from cmpdesign.design.design import Design
from cmpdesign.errors import DesignError
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.files.resolution import resolution_dpi
from cmpdesign.patterns.colors import WHITE
from cmpdesign.products.sheet.key import SheetKey, parse_key
from cmpdesign.products.sheet.page import FilledPolygons, TextLine
from cmpdesign.products.sheet.print_sheet import made_pad, make_print_page, make_print_sheet
from cmpdesign.products.sheet.scan import SheetBars, SheetReading, find_sheet_bars, measure_sheet
from cmpdesign.products.sheet.verdict import PERSPECTIVE_TOLERANCE_MM
from extractor import Extractor, Status, parse_layout

DPI = 200.0
Pixels = np.ndarray[Any, np.dtype[np.uint8]]
Points = np.ndarray[Any, np.dtype[np.float64]]


def design(**values: str) -> Design:
    return load("honeycomb", {"layers": "6", **values})


@pytest.fixture(scope="module")
def scan() -> Pixels:
    """The SVG sheet rasterised by a renderer that is not ours."""
    import resvg_py

    parameters = design()
    svg = make_print_sheet(parameters, build_layout(parameters)).files["print/sheet.svg"]
    assert isinstance(svg, str)
    png = bytes(resvg_py.svg_to_bytes(svg_string=svg, dpi=int(DPI)))
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR))


@pytest.fixture(scope="module")
def pdf_scan() -> Pixels:
    """The PDF sheet rasterised by a browser's renderer."""
    import pypdfium2

    parameters = design()
    pdf = make_print_sheet(parameters, build_layout(parameters)).files["print/sheet.pdf"]
    assert isinstance(pdf, bytes)
    page = pypdfium2.PdfDocument(pdf)[0]
    return np.ascontiguousarray(page.render(scale=DPI / 72).to_numpy()[:, :, :3])


def warped(image: Pixels, matrix: np.ndarray[Any, Any]) -> Pixels:
    """The image through a 2x2 matrix, moved into a larger frame, a little blurred and noisy."""
    height, width = image.shape[:2]
    corners = np.array([(0, 0), (width, 0), (0, height), (width, height)]) @ matrix.T
    shift = 20 - corners.min(axis=0)
    size = np.ceil(corners.max(axis=0) + shift + 20).astype(int)
    result = cv2.warpAffine(
        image, np.column_stack([matrix, shift]), tuple(int(v) for v in size), borderValue=(255, 255, 255)
    )
    noise = np.random.default_rng(3).normal(0, 3, result.shape)
    return np.clip(cv2.GaussianBlur(result, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8)


def reading(image: Pixels, dpi: float | None = DPI) -> SheetReading:
    found = find_sheet_bars(image)
    assert isinstance(found, SheetBars), found
    return measure_sheet(found, None if dpi is None else (dpi, dpi))


@pytest.mark.parametrize("printed", ["scan", "pdf_scan"])
def test_a_true_print_reads_true(printed: str, request: pytest.FixtureRequest) -> None:
    found = reading(request.getfixturevalue(printed))
    assert found.key.digest == build_layout(design()).digest
    assert (found.key.layers, found.key.pitch_mm, found.key.name) == (6, 1.5, "honeycomb")
    assert (found.scale_x, found.scale_y) == pytest.approx((1, 1), abs=5e-4)
    assert found.skew_deg == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize(
    ("scale_x", "scale_y", "skew", "turn"),
    [(0.97, 1.0, 0, 0), (1.01, 0.985, 0.4, 3), (1, 1, -0.3, 92), (1, 1.02, 0, 181)],
)
def test_scale_skew_and_turn_are_measured(
    pdf_scan: Pixels, scale_x: float, scale_y: float, skew: float, turn: float
) -> None:
    lean = np.radians(skew)
    # The y bar runs up the page; leaning it to the left opens the angle to the x bar.
    stretch = np.array([(scale_x, scale_y * np.sin(lean)), (0, scale_y * np.cos(lean))])
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    found = reading(warped(pdf_scan, np.array([(c, -s), (s, c)]) @ stretch))
    assert (found.scale_x, found.scale_y) == pytest.approx((scale_x, scale_y), abs=1e-3)
    assert found.skew_deg == pytest.approx(skew, abs=0.03)
    assert found.perspective_mm < 0.05
    assert (found.rotation_deg - turn + 180) % 360 == pytest.approx(180, abs=0.05)


def test_without_resolution_the_ratio_is_known(scan: Pixels) -> None:
    found = reading(warped(scan, np.diag([1.02, 1.0])), None)
    assert found.scale_x is None and found.ratio == pytest.approx(1.02, abs=1e-3)


class RaisingDetector:
    """As OpenCV's detector on some ordinary pictures."""

    def detectAndDecode(self, _: Pixels) -> None:
        raise cv2.error("(-215:Assertion failed) in function 'getPerspectiveTransform'")


def test_a_detector_that_raises_finds_nothing(scan: Pixels, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other one is asked, and without it the picture has no code: no picture ends in an error of OpenCV."""
    monkeypatch.setattr(cv2, "QRCodeDetectorAruco", RaisingDetector)
    assert reading(scan).key.layers == 6
    monkeypatch.setattr(cv2, "QRCodeDetector", RaisingDetector)
    assert "no print sheet's code" in str(find_sheet_bars(scan))


def test_what_cannot_be_read_says_why(scan: Pixels) -> None:
    blank = np.full_like(scan, 255)
    assert "no print sheet's code" in str(find_sheet_bars(blank))
    covered = scan.copy()
    height = covered.shape[0]
    covered[: int(height - 34 / 25.4 * DPI)] = 255
    assert "a scale bar" in str(find_sheet_bars(covered))


@pytest.mark.parametrize("size", ["a3", "a4", "a5", "130x190mm"])
def test_no_text_lies_on_another_mark_or_beside_the_page(size: str) -> None:
    """Widths by the metrics of the PDF's face."""
    from reportlab.pdfbase.pdfmetrics import stringWidth

    parameters = design(
        **{"sheet.page": size, "mirrored": "true", "print_mirror": "true", "sheet.ruler": "true"}
    )
    page, _ = make_print_page(parameters, build_layout(parameters))
    texts = [
        box(
            one.x_mm,
            one.y_mm - 0.7 * one.size_mm,
            one.x_mm + stringWidth(one.text, "Helvetica", one.size_mm),
            one.y_mm,
        )
        for one in page.items
        if isinstance(one, TextLine) and not one.turned
    ]
    drawn = [one for one in page.items if isinstance(one, FilledPolygons) and one.name != "paper"]
    shapes = [Polygon(ring) for one in drawn for ring in one.polygons]
    said = unary_union(texts)
    assert len(texts) >= 8 and said.within(box(0, 0, page.width_mm, page.height_mm))
    assert not STRtree(shapes).query(texts, predicate="intersects").size
    assert sum(text.area for text in texts) == pytest.approx(said.area)


@pytest.mark.parametrize(
    ("mirrored", "film", "side"),
    [("true", "clear", "front"), ("true", "opaque", "back"), ("false", "clear", "back")],
)
def test_a_film_has_its_side_its_boxes_and_a_white_layer_if_clear(
    mirrored: str, film: str, side: str
) -> None:
    import pypdfium2

    parameters = design(**{"mirrored": mirrored, "sheet.film": film, "sheet.bleed_mm": "1.5"})
    layout = build_layout(parameters)
    content = make_print_sheet(parameters, layout).files["print/film.pdf"]
    pages = list(pypdfium2.PdfDocument(content))
    assert len(pages) == 1 + (film == "clear")
    for page in pages:
        left, low, right, high = np.array(page.get_trimbox()) * 25.4 / 72
        assert (right - left, high - low) == pytest.approx(layout.size_mm, abs=1e-4)
        grown = np.ptp(np.array(page.get_bleedbox()).reshape(2, 2), axis=0) * 25.4 / 72
        assert grown[1] == pytest.approx(layout.size_mm[1] + 3, abs=1e-4) and grown[0] > layout.size_mm[0] + 3
    inks, *white = (page.render(scale=DPI / 72).to_numpy()[:, :, :3] for page in pages)
    reader = Extractor(parse_layout(layout_to_json(layout)), side="either")
    markers = reader.extract(np.ascontiguousarray(inks))
    assert (markers.status == Status.MEASURED).all() and markers.mirrored == (side == "back")
    for layer in white:
        # White lies below all that is black on the page of inks, and below the cells within it; the last line is text.
        covered, black = ((page[:-40] < level).all(axis=2) for page, level in ((layer, 160), (inks, 100)))
        assert not (black & ~covered).any() and covered.mean() > 1.2 * black.mean()


@pytest.mark.parametrize("gain_mm", [0.0, 0.05])
def test_dot_gain_makes_the_cells_smaller(gain_mm: float) -> None:
    """The black moves the sides of equilateral triangles inward, but not those of the white cell."""
    parameters = design(**{"sheet.dot_gain_mm": str(gain_mm)})
    layout = build_layout(parameters)
    made = made_pad(parameters, layout)
    shares = np.array([Polygon(ring).area for ring in made.layout.colored_outlines_mm]) / (
        np.sqrt(3) / 4 * 1.5**2
    )
    (white,) = np.flatnonzero(layout.cell_color[layout.colored_cells] == WHITE)
    # a side that moves takes a third of this from the triangle's height
    less = 2 * np.sqrt(3) * gain_mm / 1.5
    assert shares[white] == pytest.approx(1, abs=1e-9)
    np.testing.assert_allclose(np.sort(np.delete(shares, white))[-3:], (1 - 2 * less / 3) ** 2)
    np.testing.assert_allclose(np.sort(np.delete(shares, white))[:-3], (1 - less) ** 2)
    closed = design(**{"sheet.dot_gain_mm": "0.45"})
    with pytest.raises(
        DesignError, match=r"0\.45: the ink closes cells, whose smallest inner radius is 0\.433"
    ):
        made_pad(closed, build_layout(closed))


def test_keys_survive_odd_names() -> None:
    key = SheetKey("ab" * 32, "a|b é", "round", 3, 0.1 + 0.2)
    assert parse_key(key.text()) == key
    assert parse_key("https://example.org") is None and parse_key("CMP1|a|b|c|d|e") is None


def leaning(image: Pixels, tilt_deg: float, away_mm: float = 400.0) -> Pixels:
    """The sheet in the picture of a camera that looks at the sheet's middle from the side."""
    height, width = image.shape[:2]
    away, tilt = away_mm / 25.4 * DPI, np.radians(tilt_deg)
    x, y = np.array([(0, 0), (width, 0), (width, height), (0, height)], dtype=float).T
    u, v = x - width / 2, y - height / 2
    depth = away - u * np.sin(tilt)
    seen = np.stack([width / 2 + u * np.cos(tilt) * away / depth, height / 2 + v * away / depth], axis=-1)
    ground = np.stack([x, y], axis=-1).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(ground, seen.astype(np.float32))
    return np.asarray(cv2.warpPerspective(image, matrix, (width, height), borderValue=(255, 255, 255)))


@pytest.mark.parametrize("tilt", [5.0, 10.0])
def test_a_camera_that_looks_from_aside_is_found_out(scan: Pixels, tilt: float) -> None:
    assert reading(leaning(scan, 0.0), None).perspective_mm < 0.03
    assert reading(leaning(scan, tilt), None).perspective_mm > PERSPECTIVE_TOLERANCE_MM


def saved(image: Pixels, path: Path, **options: Any) -> Path:
    from PIL import Image

    Image.fromarray(image[:, :, ::-1]).save(path, **options)
    return path


@pytest.mark.parametrize("kind", ["png", "jpg", "tif", "bmp"])
def test_files_state_their_resolution(kind: str, tmp_path: Path) -> None:
    blank = np.full((20, 30, 3), 255, np.uint8)
    assert resolution_dpi(saved(blank, tmp_path / f"a.{kind}", dpi=(300, 150))) == pytest.approx(
        (300, 150), abs=0.02
    )
    assert "dpi, the default of programs" in str(
        resolution_dpi(saved(blank, tmp_path / f"b.{kind}", dpi=(72, 72)))
    )
    assert isinstance(resolution_dpi(saved(blank, tmp_path / f"c.{kind}")), str)


def test_files_without_a_resolution_of_their_own_say_why(tmp_path: Path) -> None:
    from PIL import Image

    blank = np.full((20, 30, 3), 255, np.uint8)
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x829A] = 0.01
    photo = saved(blank, tmp_path / "photo.jpg", dpi=(300, 300), exif=exif)
    assert "the resolution tag of a photo" in str(resolution_dpi(photo))
    assert "states no resolution" in str(resolution_dpi(saved(blank, tmp_path / "plain.png")))
    (tmp_path / "broken.png").write_bytes(b"nothing")
    assert "cannot be read" in str(resolution_dpi(tmp_path / "broken.png"))


class Run:
    """``cmpdesign verify`` on pictures in a folder with two layouts."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "layout.json").write_text(layout_to_json(build_layout(design())))
        (folder / "other.json").write_text(layout_to_json(build_layout(design(layers="5"))))

    def __call__(self, picture: Path, *more: str, layout: str = "layout.json") -> tuple[int, str]:
        result = CliRunner().invoke(app, ["verify", str(self.folder / layout), str(picture), *more])
        return result.exit_code, result.stdout


def test_verify_reads_a_sheet_by_itself(scan: Pixels, tmp_path: Path) -> None:
    run = Run(tmp_path)
    true = saved(scan, tmp_path / "true.png", dpi=(DPI, DPI))
    code, text = run(true)
    assert code == 0 and re.search(r"scale x (1.000|0.999)\d, y (1.000|0.999)\d at 200 dpi", text), text
    small = saved(warped(scan, np.diag([0.97, 1.0])), tmp_path / "small.png", dpi=(DPI, DPI))
    code, text = run(small)
    assert code == 1 and "scale in x is 0.97" in text
    code, text = run(true, "--json", layout="other.json")
    (sheet,) = json.loads(text)["images"]
    assert code == 1 and "another layout" in sheet["reason"]
    assert sheet["sheet"]["scale_x"] == pytest.approx(1, abs=5e-4)
    assert sheet["sheet"]["dpi"] == pytest.approx([DPI, DPI], abs=0.01)
    code, text = run(saved(leaning(scan, 10.0), tmp_path / "aside.png"))
    assert code == 1 and "seen at an angle" in text


def test_verify_says_when_the_scales_are_not_known(scan: Pixels, tmp_path: Path) -> None:
    run = Run(tmp_path)
    for name, options, words in (
        ("none", {}, "the file states no resolution"),
        ("screen", {"dpi": (96, 96)}, "the file states 96 dpi"),
        ("wrong", {"dpi": (600, 600)}, "by which the bars are 16.7 x 16.7 mm"),
    ):
        code, text = run(saved(scan, tmp_path / f"{name}.png", **options))
        assert code == 0 and "scale x / y 1.000" in text and words in text, text
    # What is given counts, whatever the file says.
    code, text = run(tmp_path / "wrong.png", "--sheet-dpi", "200")
    assert code == 0 and "at 200 dpi" in text
    code, text = run(tmp_path / "wrong.png", "--sheet-dpi", "0")
    assert code == 0 and "no resolution is given" in text
    uneven = cv2.resize(scan, None, fx=1.0, fy=1.5)
    code, text = run(saved(uneven, tmp_path / "uneven.png", dpi=(DPI, 1.5 * DPI)))
    assert code == 0 and re.search(r"y (1.000|0.999)\d at 200 x 300 dpi", text), text


def test_verify_tells_sheets_from_views(scan: Pixels, tmp_path: Path) -> None:
    run = Run(tmp_path)
    pitch_px = 24
    view = tmp_path / "view.png"
    arguments = ["render", str(tmp_path / "layout.json"), "-o", str(view), "--pitch", str(pitch_px)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    sheet = saved(scan, tmp_path / "sheet.png", dpi=(DPI, DPI))
    code, text = run(view, str(sheet), "--json", "-o", str(tmp_path / "made"))
    seen, printed = json.loads(text)["images"]
    assert code == 0 and seen["measured"] == 127 and printed["sheet"]["name"] == "honeycomb"
    assert json.loads((tmp_path / "made" / "verify.json").read_text()) == json.loads(text)
    code, text = run(view, "--sheet-dpi", "200")
    assert code == 1 and "no print sheet's code" in text


def test_pdf_is_true_to_size_and_the_same_again() -> None:
    parameters = design()
    first, second = (
        make_print_sheet(parameters, build_layout(parameters)).files["print/sheet.pdf"] for _ in range(2)
    )
    assert isinstance(first, bytes) and first == second and first.startswith(b"%PDF")
    assert b"/MediaBox [ 0 0 595.2756 841.8898 ]" in first


MARK_DPI = 600
ROUND = {"clip": "circle", "clip_diameter_mm": "16"}


def pad_alone(renderer: str, **values: str) -> tuple[Points, Pixels]:
    """A page's only pad: its outline in mm, and the page's upper part, dark where it is printed."""
    import pypdfium2
    import resvg_py

    parameters = design(**{"sheet.pads": "1", **values})
    layout = build_layout(parameters)
    files = make_print_sheet(parameters, layout).files
    svg, pdf = files["print/sheet.svg"], files["print/sheet.pdf"]
    assert isinstance(svg, str) and isinstance(pdf, bytes)
    if renderer == "svg":
        png = bytes(resvg_py.svg_to_bytes(svg_string=svg, dpi=MARK_DPI))
        picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    else:
        picture = pypdfium2.PdfDocument(pdf)[0].render(scale=MARK_DPI / 72, grayscale=True).to_numpy()
    return layout.outline_mm, np.asarray(picture[: int(100 / 25.4 * MARK_DPI)] < 140, np.uint8)


def marks_in(printed: Pixels) -> tuple[Points, Points]:
    """(M, 2, 2) both ends of every hairline, mm around the pad's middle, y up; (M,) its distance from the bleed."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(printed)
    ground = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    away = cv2.distanceTransform(np.asarray(labels != ground, np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    left, top, width, height = (float(v) for v in stats[ground, :4])
    middle = np.array([left + (width - 1) / 2, top + (height - 1) / 2])
    ends, gaps = [], []
    for label in range(1, len(stats)):
        y, x = np.nonzero(labels == label)
        # The color of cells is dark, too, and the ground surrounds it.
        if label == ground or away[y, x].min() < 3:
            continue
        points = np.stack([x, y], -1) - middle
        mean = points.mean(axis=0)
        way = np.linalg.svd(points - mean, full_matrices=False)[2][0]
        along = (points - mean) @ way
        ends.append([mean + (along.min() - 0.5) * way, mean + (along.max() + 0.5) * way])
        gaps.append(away[y, x].min())
    mm = 25.4 / MARK_DPI
    return np.array(ends) * (mm, -mm), np.array(gaps) * mm


@pytest.mark.parametrize(
    ("renderer", "values"),
    [
        ("svg", {}),
        ("pdf", {"rotation_deg": "17", "sheet.bleed_mm": "0"}),
        ("pdf", {"pattern": "square", "sheet.bleed_mm": "3"}),
        ("pdf", ROUND),
    ],
    ids=["hexagon", "turned", "square", "round"],
)
def test_crop_marks_continue_the_sides(renderer: str, values: dict[str, str]) -> None:
    outline, printed = pad_alone(renderer, **values)
    ends, gaps = marks_in(printed)
    low, high = outline.min(axis=0), outline.max(axis=0)
    corners = outline - (low + high) / 2
    if values is ROUND:
        (left, bottom), (right, top) = low - (low + high) / 2, high - (low + high) / 2
        corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    else:
        assert gaps == pytest.approx(0.5, abs=0.06)
    assert len(ends) == 2 * len(corners)
    assert np.hypot(*(ends[:, 1] - ends[:, 0]).T) == pytest.approx(4.0, abs=0.09)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = (end - start) / np.hypot(*(end - start))
        off = (ends - start) @ (-way[1], way[0])
        on_line = ends[(np.abs(off) < 0.05).all(axis=1)]
        along = np.sort(((on_line - start) @ way).reshape(len(on_line), 2), axis=1)
        beyond = np.hypot(*(end - start))
        # One before the side's beginning, and one after its end.
        assert len(on_line) == 2 and along.min() < -4 and along.max() > beyond + 4
        assert not ((along > 0) & (along < beyond)).any()


def test_as_many_pads_as_fit() -> None:
    parameters = design(**{"sheet.pads": "3"})
    assert make_print_sheet(parameters, build_layout(parameters)).figures["pads"] == 3
    for values, message in (({"sheet.pads": "4000"}, "only"), ({"layers": "90"}, "does not fit into")):
        parameters = design(**values)
        with pytest.raises(DesignError, match=message):
            make_print_sheet(parameters, build_layout(parameters))


@pytest.mark.parametrize(
    ("mirrored", "film", "page_mirrored", "said"),
    [
        ("false", "none", False, "sees the front: print on the side that faces it"),
        ("true", "none", False, "sees the back: print on the far side of a clear film"),
        ("false", "clear", True, "sees the front: print on the far side of a clear film"),
        ("true", "opaque", True, "sees the back: print on the side that faces it"),
    ],
)
def test_a_sheet_says_where_it_is_printed_and_is_mirrored_there(
    mirrored: str, film: str, page_mirrored: bool, said: str
) -> None:
    def sheet(**values: str) -> str:
        design = load("honeycomb", {"layers": "2", "sheet.pads": "1", **values})
        content = make_print_sheet(design, build_layout(design)).files["print/sheet.svg"]
        assert isinstance(content, str)
        return content

    page = sheet(mirrored=mirrored, **{"sheet.film": film})
    assert said in page

    def cells(text: str) -> list[str]:
        return [line for line in re.findall(r"<path d=\"[^\"]+", text)][1:14]

    assert (cells(page) == cells(sheet(print_mirror="true"))) == page_mirrored
    assert (cells(page) == cells(sheet())) != page_mirrored
