"""The grid of settings: burnt by a known beam, photographed, and read back."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign import kerf
from cmpdesign.design.design import load_design
from cmpdesign.errors import CmpDesignError
from cmpdesign.products.laser.coupon.design import Coupon, Patch, coupon_to_json
from cmpdesign.products.laser.coupon.fiducials import find_fiducials, fit_fiducials
from cmpdesign.products.laser.coupon.picture import eight_bit_gray
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.grid.design import design_grid, field_of
from cmpdesign.products.laser.grid.job import grid_job
from cmpdesign.products.laser.grid.reading import read_grid
from cmpdesign.products.laser.setup import complete_setup
from tests.support.command import refused, run
from tests.support.laser_tools import coupon_photo, groups_of, run_gcode

SETUP = complete_setup(load_design("honeycomb").laser)
GRID = design_grid(SETUP)
# Below this depth nothing is seen.
SEEN_MM = 0.05


def depth_mm(patch: Patch, beam: float) -> float:
    """Depth after all passes, by a beam that burns in proportion to its energy a length."""
    return beam * patch.passes * patch.power_percent / patch.speed_mm_s


def photo_of(beam: float, soot: float = 25.0, **view: Any) -> NDArray[Any]:
    """Windows that are deep enough are open; of the others, outlines are grooves of another shade than the sheet."""
    open_ones = [patch for patch in GRID.patches if depth_mm(patch, beam) >= GRID.thickness_mm]
    kerfs = {patch.name: (0.15, 0.15) for patch in open_ones}
    image = coupon_photo(replace(GRID, patches=tuple(open_ones)), kerfs, **view)
    light = np.ascontiguousarray(image[..., 0], dtype=np.float32)
    fit = fit_fiducials(find_fiducials(eight_bit_gray(image), GRID), GRID, light)
    for patch in GRID.patches:
        if SEEN_MM <= depth_mm(patch, beam) < GRID.thickness_mm:
            (window,) = patch.openings
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (
                window.width_mm / 2,
                window.height_mm / 2,
            )
            path = np.rint(fit.to_image(corners + (window.x_mm, window.y_mm))).astype(np.int32)
            shade = view.get("sheet", 40.0) + soot
            cv2.polylines(image, [path], True, (shade,) * 3, max(round(0.15 * fit.scale), 1), cv2.LINE_AA)
    return image


def true_state(patch: Patch, beam: float) -> str:
    depth = depth_mm(patch, beam)
    return "through" if depth >= GRID.thickness_mm else "marked" if depth >= SEEN_MM else "unmarked"


@pytest.mark.parametrize(
    "view",
    [
        {},
        {"turn_deg": 97.0, "noise": 4.0, "jpeg_quality": 85},
        {"scale_px_mm": 11.8, "turn_deg": 183.0, "vignette": 0.15},
        {"mirrored": True, "turn_deg": 20.0},
        {"sheet": 200.0, "ground": 25.0, "tilt": 0.1, "soot": -60.0},
    ],
    ids=["upright", "turned, JPEG", "300 dpi", "back", "bright sheet"],
)
@pytest.mark.parametrize("beam", [0.11, 0.45])
def test_every_window_is_read_back(beam: float, view: dict[str, Any]) -> None:
    reading = read_grid(GRID, photo_of(beam, **view))
    assert reading.from_back == view.get("mirrored", False)
    read = {(one.name, passes): state for one in reading.fields for passes, state in one.states.items()}
    assert read == {(field_of(patch), patch.passes): true_state(patch, beam) for patch in GRID.patches}
    assert len(set(read.values())) >= 2
    widths = []
    for one in reading.fields:
        for passes, (low, high) in one.depths_mm.items():
            true = passes * beam * one.power_percent / one.speed_mm_s
            assert low - 1e-9 <= min(true, GRID.thickness_mm) <= high + 1e-9
            widths.append((high - low) / GRID.thickness_mm)
    # a field without a through window gets bounds from the others
    assert np.median(widths) < 0.5, np.round(widths, 2)


def test_the_best_field_is_the_quickest_with_a_pass_in_reserve() -> None:
    beam = 0.25
    best = read_grid(GRID, photo_of(beam)).best
    assert best is not None and best.passes is not None
    times = {}
    for patch in GRID.patches:
        needed = math.ceil(GRID.thickness_mm / (beam * patch.power_percent / patch.speed_mm_s))
        if needed < 4:
            times[field_of(patch)] = needed / patch.speed_mm_s
    assert times[best.name] == min(times.values())


def test_the_program_burns_what_the_file_says() -> None:
    """The moves of the G-code, window by window: place, power, and how often."""
    drawing, text = grid_job(SETUP)
    assert text == coupon_to_json(GRID)
    origin = drawing.fiducials_mm[0]
    for one in drawing.passes:
        if not one.name.startswith("field-"):
            continue
        windows = [patch for patch in GRID.patches if f"field-{field_of(patch)}" == one.name]
        assert {(patch.power_percent, patch.speed_mm_s) for patch in windows} == {
            (one.power_percent, one.speed_mm_s)
        }
        centres = [
            tuple(np.round((group[:, :2].min(axis=0) + group[:, :2].max(axis=0)) / 2 - origin, 2))
            for group in groups_of(run_gcode(drawing_to_gcode(drawing.with_one_pass(one))))
        ]
        for patch in windows:
            (window,) = patch.openings
            assert centres.count((round(window.x_mm, 2), round(window.y_mm, 2))) == patch.passes


def test_labels_mark_and_touch_no_window() -> None:
    """A label's segments keep clear of every window by more than the margin that the reading uses."""
    for drawing, piece in ((grid_job(SETUP)[0], GRID),):
        (labels,) = [one for one in drawing.passes if one.name == "labels"]
        assert labels.power_percent > 0 and len(labels.walls) > 9 * 5
        xy = labels.walls.xy_mm - drawing.fiducials_mm[0]
        for patch in piece.patches:
            (window,) = patch.openings
            away = np.abs(xy - (window.x_mm, window.y_mm)) - (window.width_mm / 2, window.height_mm / 2)
            assert away.max(axis=1).min() > 0.9


def test_the_command_prints_lines_for_the_material_file(tmp_path: Path) -> None:
    (tmp_path / "grid.json").write_text(coupon_to_json(GRID), encoding="utf-8")
    cv2.imwrite(str(tmp_path / "grid.png"), photo_of(0.25))
    result = run("kerf", tmp_path / "grid.json", tmp_path / "grid.png")
    assert result.exit_code == 0, result.stderr
    lines = "\n".join(line for line in result.stdout.splitlines() if line.startswith("cut_"))
    best = kerf(tmp_path / "grid.json", tmp_path / "grid.png").found.best
    assert best is not None and best.passes is not None
    settings = tomllib.loads(lines)
    assert settings["cut_power_percent"]["value"] == best.power_percent
    assert settings["cut_passes"]["value"] > best.passes
    document = json.loads(run("kerf", tmp_path / "grid.json", tmp_path / "grid.png", "--json").stdout)
    assert document["best"] == best.name and len(document["fields"]) == 9


def test_files_and_pictures_that_are_not_a_grid(tmp_path: Path) -> None:
    with pytest.raises(CmpDesignError, match="ground and sheet differ"):
        _read(tmp_path, GRID, photo_of(0.25, sheet=185.0, ground=195.0, noise=0.3))
    cv2.imwrite(str(tmp_path / "grid.png"), np.full((300, 400, 3), 90, np.uint8))
    (tmp_path / "grid.json").write_text(coupon_to_json(GRID), encoding="utf-8")
    assert "five round marks" in refused("kerf", tmp_path / "grid.json", tmp_path / "grid.png")


def _read(folder: Path, grid: Coupon, image: NDArray[Any]) -> None:
    (folder / "grid.json").write_text(coupon_to_json(grid), encoding="utf-8")
    cv2.imwrite(str(folder / "grid.png"), image)
    kerf(folder / "grid.json", folder / "grid.png")
