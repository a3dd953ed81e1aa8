"""Print sheets: what is on them, true to size, and how a scan of one is read."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from cmpdesign import build_layout, load_design
from cmpdesign.cli import app
from cmpdesign.design import Design
from cmpdesign.errors import DesignError
from cmpdesign.sheet_key import SheetKey, parse_key
from cmpdesign.sheet_reading import SheetReading, read_sheet
from cmpdesign.writers.layout_file import layout_to_json
from cmpdesign.writers.print_sheet import make_print_sheet

DPI = 200.0


def design(**values: str) -> Design:
    return load_design("honeycomb", {"layers": "6", **values})


@pytest.fixture(scope="module")
def scan() -> np.ndarray:  # type: ignore[type-arg]
    """The sheet rasterised by a renderer that is not ours."""
    import resvg_py

    parameters = design()
    svg = make_print_sheet(parameters, build_layout(parameters)).files["print/sheet.svg"]
    assert isinstance(svg, str)
    png = bytes(resvg_py.svg_to_bytes(svg_string=svg, dpi=int(DPI)))
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR))


def warped(image: np.ndarray, matrix: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
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


def reading(image: np.ndarray, dpi: float | None = DPI) -> SheetReading:  # type: ignore[type-arg]
    found = read_sheet(image, dpi)
    assert isinstance(found, SheetReading), found
    return found


def test_a_true_print_reads_true(scan: np.ndarray) -> None:  # type: ignore[type-arg]
    found = reading(scan)
    assert found.key.digest == build_layout(design()).digest
    assert (found.key.layers, found.key.pitch_mm, found.key.name) == (6, 1.5, "honeycomb")
    assert (found.scale_x, found.scale_y) == pytest.approx((1, 1), abs=5e-4)
    assert found.skew_deg == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize(
    ("scale_x", "scale_y", "skew", "turn"),
    [(0.97, 1.0, 0, 0), (1.01, 0.985, 0.4, 3), (1, 1, -0.3, 92), (1, 1.02, 0, 181)],
)
def test_scale_skew_and_turn_are_measured(
    scan: np.ndarray,
    scale_x: float,
    scale_y: float,
    skew: float,
    turn: float,  # type: ignore[type-arg]
) -> None:
    lean = np.radians(skew)
    # The y bar runs up the page; leaning it to the left opens the angle to the x bar.
    stretch = np.array([(scale_x, scale_y * np.sin(lean)), (0, scale_y * np.cos(lean))])
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    found = reading(warped(scan, np.array([(c, -s), (s, c)]) @ stretch))
    assert (found.scale_x, found.scale_y) == pytest.approx((scale_x, scale_y), abs=1e-3)
    assert found.skew_deg == pytest.approx(skew, abs=0.03)
    assert (found.rotation_deg - turn + 180) % 360 == pytest.approx(180, abs=0.05)


def test_without_resolution_the_ratio_is_known(scan: np.ndarray) -> None:  # type: ignore[type-arg]
    found = reading(warped(scan, np.diag([1.02, 1.0])), None)
    assert found.scale_x is None and found.ratio == pytest.approx(1.02, abs=1e-3)


def test_what_cannot_be_read_says_why(scan: np.ndarray) -> None:  # type: ignore[type-arg]
    blank = np.full_like(scan, 255)
    assert "no print sheet's code" in str(read_sheet(blank))
    covered = scan.copy()
    height = covered.shape[0]
    covered[: int(height - 34 / 25.4 * DPI)] = 255
    assert "a scale bar" in str(read_sheet(covered, DPI))


def test_keys_survive_odd_names() -> None:
    key = SheetKey("ab" * 32, "a|b é", "round", 3, 0.1 + 0.2)
    assert parse_key(key.text()) == key
    assert parse_key("https://example.org") is None and parse_key("CMP1|a|b|c|d|e") is None


def test_verify_reports_the_print(scan: np.ndarray, tmp_path: Path) -> None:  # type: ignore[type-arg]
    cv2.imwrite(str(tmp_path / "true.png"), scan)
    cv2.imwrite(str(tmp_path / "small.png"), warped(scan, np.diag([0.97, 0.97])))
    (tmp_path / "layout.json").write_text(layout_to_json(build_layout(design())))
    (tmp_path / "other.json").write_text(layout_to_json(build_layout(design(layers="5"))))

    def run(layout: str, picture: str, *more: str) -> tuple[int, str]:
        arguments = ["verify", str(tmp_path / layout), str(tmp_path / picture), "--sheet-dpi", "200", *more]
        result = CliRunner().invoke(app, arguments)
        return result.exit_code, result.stdout

    assert run("layout.json", "true.png")[0] == 0
    code, text = run("layout.json", "small.png")
    assert code == 1 and "scale in x is 0.97" in text
    code, text = run("other.json", "true.png", "--json")
    assert code == 1 and "another layout" in json.loads(text)["sheets"][0]["reason"]


def test_pdf_is_true_to_size_and_the_same_again() -> None:
    parameters = design()
    first, second = (
        make_print_sheet(parameters, build_layout(parameters)).files["print/sheet.pdf"] for _ in range(2)
    )
    assert isinstance(first, bytes) and first == second and first.startswith(b"%PDF")
    assert b"/MediaBox [ 0 0 595.2756 841.8898 ]" in first


def test_as_many_pads_as_fit() -> None:
    parameters = design(**{"sheet.pads": "3"})
    assert make_print_sheet(parameters, build_layout(parameters)).figures["pads"] == 3
    for values, message in (({"sheet.pads": "4000"}, "only"), ({"layers": "90"}, "does not fit into")):
        parameters = design(**values)
        with pytest.raises(DesignError, match=message):
            make_print_sheet(parameters, build_layout(parameters))


def test_the_page_about_molds_says_what_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command in docs/molds.md, in its order; a scan is made where one is read."""
    import resvg_py

    page = (Path(__file__).parent.parent / "docs" / "molds.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^(?:\$ |    )cmpdesign (.*)$", page, flags=re.MULTILINE)
    assert [command.split()[0] for command in commands] == ["build", "verify"]
    for command in commands:
        if command.startswith("verify"):
            svg = Path("out/print/sheet.svg").read_text(encoding="utf-8")
            Path("scan.png").write_bytes(bytes(resvg_py.svg_to_bytes(svg_string=svg, dpi=300)))
        result = CliRunner().invoke(app, command.split())
        assert result.exit_code == 0, (command, result.output)
    assert {path.name for path in Path("out").iterdir()} >= {"mold", "mesh", "print", "layout.json"}
