"""Pads rebuilt from written files are read: molds are sliced, and programs of lasers are replayed.

No test uses the products' predictions, except for the tests of the predictions.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from cmpdesign import build_layout, load
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.side import seen_side, turned_over
from cmpdesign.products.as_made.made_pad import cut_by_later, make_pad
from cmpdesign.products.as_made.reading import read_pad, reading_findings
from cmpdesign.products.materials.silicones import load_silicone
from cmpdesign.reading.read_layout import read_layout
from tests.support.command import run
from tests.support.made.seen_pads import SeenCell, SeenPad, carved_pad, cast_pad, read_seen

MIN_SHARE, RMS_PITCHES, WORST_PITCHES = 0.99, 0.005, 0.02
TRIANGULAR = ("digit", "elliptical", "gelsight-mini", "honeycomb", "round", "tac3d")


def built(folder: Path, name: str, only: str, **values: str) -> Layout:
    """The layout of a design whose files are in the folder."""
    flags = [
        part for field, value in values.items() for part in ("--set", f"{field.replace('__', '.')}={value}")
    ]
    result = run("build", name, "-o", folder, "--only", f"layout,{only}", *flags)
    assert result.exit_code == 0, result.output
    return read_layout(folder / "layout.json")


def cast(folder: Path, name: str, **values: str) -> tuple[Layout, SeenPad]:
    layout = built(folder, name, "mesh", **values)
    scale = load_silicone("dragon-skin-10").scale
    return layout, read_seen(layout, cast_pad(folder, scale))


def carved(folder: Path, name: str, **values: str) -> tuple[Layout, SeenPad]:
    layout = built(folder, name, "laser", **values)
    return layout, read_seen(layout, carved_cells(folder, layout))


def carved_cells(folder: Path, layout: Layout) -> list[SeenCell]:
    figures = json.loads((folder / "report.json").read_text())["laser"]
    front, back = np.array(figures["kerf_front_mm"]), np.array(figures["kerf_back_mm"])
    return carved_pad(folder, np.array(figures["layout_origin_mm"]), front, back, layout.mirrored)


def require_as_designed(layout: Layout, pad: SeenPad) -> None:
    assert pad.mirrored == layout.mirrored
    assert pad.share >= MIN_SHARE
    assert pad.rms <= RMS_PITCHES and pad.worst <= WORST_PITCHES


@pytest.fixture(scope="module", params=["true", "false"])
def small(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Layout]:
    """The folder and the layout of a small pad's meshes and laser job, mirrored or not."""
    folder = tmp_path_factory.mktemp("small")
    return folder, built(folder, "honeycomb", "mesh,laser", layers="3", mirrored=request.param)


def test_a_small_cast_pad_is_read_as_designed(small: tuple[Path, Layout]) -> None:
    folder, layout = small
    cells = cast_pad(folder, load_silicone("dragon-skin-10").scale)
    require_as_designed(layout, read_seen(layout, cells))


@pytest.mark.parametrize(("name", "mirrored"), [("gelsight-mini", "true"), ("round", "false")])
def test_a_carved_pad_is_read_as_designed(name: str, mirrored: str, tmp_path: Path) -> None:
    require_as_designed(*carved(tmp_path, name, mirrored=mirrored))


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIANGULAR)
def test_every_template_is_cast_as_designed(name: str, tmp_path: Path) -> None:
    require_as_designed(*cast(tmp_path, name))


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIANGULAR)
def test_every_template_is_carved_as_designed(name: str, tmp_path: Path) -> None:
    require_as_designed(*carved(tmp_path, name))


def test_cells_of_the_wrong_size_or_side_would_be_seen(tmp_path: Path) -> None:
    layout = built(tmp_path, "honeycomb", "layout", layers="3")
    corners = layout.marker_xy_mm[layout.cell_corners[layout.colored_cells]]
    colors = [("red", "green", "blue", "black", "white")[c] for c in layout.cell_color[layout.colored_cells]]
    cells = [SeenCell(color, cell) for color, cell in zip(colors, corners, strict=True)]
    nominal = read_seen(layout, cells)
    require_as_designed(layout, nominal)
    assert nominal.rms < 0.001
    narrow = [
        SeenCell(
            c.color,
            shapely.get_coordinates(shapely.Polygon(c.outline_mm).buffer(-0.07, join_style="mitre"))[:-1],
        )
        for c in cells
    ]
    assert read_seen(layout, narrow).worst > WORST_PITCHES
    turned = [SeenCell(cell.color, cell.outline_mm * (-1, 1)) for cell in cells]
    assert read_seen(layout, turned).mirrored


def test_predicted_cells_are_those_of_the_written_files(small: tuple[Path, Layout]) -> None:
    """Area of the difference of both, against the area of the cells."""
    folder, layout = small
    side = np.array([-1.0 if layout.mirrored else 1.0, 1.0])
    found = {
        "mold": cast_pad(folder, load_silicone("dragon-skin-10").scale),
        "laser": carved_cells(folder, layout),
    }
    for product, cells in found.items():
        predicted = read_layout(folder / "as-made" / f"{product}.json")
        assert predicted.as_made is not None
        assert (predicted.as_made.of, predicted.as_made.product) == (layout.digest, product)
        assert predicted.as_made.side == seen_side(layout.mirrored)
        one = shapely.union_all([shapely.Polygon(c.outline_mm * side).buffer(0) for c in cells])
        other = shapely.union_all([shapely.Polygon(ring).buffer(0) for ring in predicted.as_made.outlines_mm])
        assert one.symmetric_difference(other).area < 0.004 * one.area, product


def test_sides() -> None:
    assert (seen_side(True), seen_side(False)) == ("back", "front")
    layout = build_layout(load("gelsight-mini"))
    assert turned_over(turned_over(layout)).digest == layout.digest
    np.testing.assert_array_equal(turned_over(layout).marker_xy_mm, layout.marker_xy_mm * (-1, 1))


def test_later_cells_replace_earlier_ones() -> None:
    square = np.array([(0.0, 0), (2, 0), (2, 2), (0, 2)])
    first, second, apart = cut_by_later([square, square + (1, 0), square + (5, 0)])
    assert shapely.Polygon(first).area == pytest.approx(2)
    np.testing.assert_array_equal(second, square + (1, 0))
    np.testing.assert_array_equal(apart, square + (5, 0))


def test_a_deviation_names_its_parameter_and_what_cannot_be_read_is_an_error(tmp_path: Path) -> None:
    result = run(
        "check", "gelsight-mini", "--read", "--set", "laser.face=front", "--set", "sheet.dot_gain_mm=0.06"
    )
    assert result.exit_code == 0
    text = " ".join(result.stdout.split())
    assert "change laser.face" in text and "sheet.dot_gain_mm" in text
    layout = build_layout(load("honeycomb", {"layers": "3"}))
    outlines = list(layout.colored_outlines_mm)
    small = make_pad(
        layout, "mold", [ring.mean(axis=0) + 0.2 * (ring - ring.mean(axis=0)) for ring in outlines]
    )
    (finding,) = reading_findings(small, read_pad(small))
    assert finding.severity == "error" and "share of markers" in finding.subject
    wrong = make_pad(layout, "mold", [ring * (-1, 1) for ring in outlines])
    (finding,) = reading_findings(wrong, read_pad(replace(wrong, layout=replace(wrong.layout))))
    assert finding.severity == "error" and "show the back" in finding.subject


def test_reports_and_files_say_what_was_read(tmp_path: Path) -> None:
    built(tmp_path, "gelsight-mini", "print,laser")
    figures = json.loads((tmp_path / "report.json").read_text())["as_made"]
    assert set(figures) == {"laser", "print"}
    for product, made in figures.items():
        assert made["side"] == made["side_seen"] == "back" and made["measured_share"] == 1
        assert made["rms_pitch"] <= RMS_PITCHES and made["camera_px"] == [640, 480]
        layout = read_layout(tmp_path / "as-made" / f"{product}.json")
        nominal = read_layout(tmp_path / "layout.json")
        away = np.hypot(*(layout.marker_xy_mm - nominal.marker_xy_mm).T)
        assert 0 < away.max() == pytest.approx(made["worst_mm"], abs=2e-5)
