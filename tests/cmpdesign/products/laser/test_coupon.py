"""The coupon: what it holds, and that the kerf read from a picture of it is the kerf it was cut with."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from cmpdesign.cli import app
from cmpdesign.design.design import load_design
from cmpdesign.products.laser.coupon.design import Coupon, coupon_to_json, design_coupon, load_coupon
from cmpdesign.products.laser.coupon.job import coupon_job as coupon_drawing
from cmpdesign.products.laser.coupon.photo import read_coupon
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.setup import complete_setup
from tests.support.laser_tools import coupon_photo, groups_of, run_gcode

PIECE = design_coupon(complete_setup(load_design("honeycomb").laser))
CUT = {patch.name: (0.10 + 0.02 * i, 0.12 + 0.015 * i) for i, patch in enumerate(PIECE.patches)}


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize(
    "conditions",
    [
        {},
        {"turn_deg": 100.0, "noise": 4.0},
        {"scale_px_mm": 11.8, "turn_deg": 184.0},
        {"mirrored": True, "turn_deg": 20.0},
        {"sheet": 210.0, "ground": 25.0, "tilt": 0.1},
    ],
    ids=["upright", "turned", "300 dpi", "back", "dark ground"],
)
def test_the_kerf_is_read_back(conditions: dict[str, Any]) -> None:
    """Within 4 micrometres and within four standard uncertainties; these are honest: neither far off nor useless."""
    reading = read_coupon(PIECE, coupon_photo(PIECE, CUT, **conditions))
    assert reading.from_back == conditions.get("mirrored", False)
    assert reading.scale_px_mm == pytest.approx(conditions.get("scale_px_mm", 23.6), rel=0.1)
    errors, sigmas = [], []
    for one in reading.patches:
        for width, cut in zip((one.x, one.y), CUT[one.patch.name], strict=True):
            errors.append(width.value_mm - cut)
            sigmas.append(width.sigma_mm)
    errors_mm, sigmas_mm = np.array(errors), np.array(sigmas)
    assert np.abs(errors_mm).max() < 0.004
    assert np.abs(errors_mm / sigmas_mm).max() < 4
    assert np.sqrt((errors_mm**2).mean()) < 2 * sigmas_mm.mean() < 0.01


def test_the_drawing_cuts_what_the_file_says() -> None:
    setup = complete_setup(load_design("honeycomb").laser)
    drawing, text = coupon_drawing(setup)
    assert text == coupon_to_json(PIECE)
    names = [one.name for one in drawing.passes]
    assert names == ["fiducials", *(f"patch-{patch.name}" for patch in PIECE.patches), "kerf-row"]
    origin = drawing.fiducials_mm[0]
    for patch, one in zip(PIECE.patches, drawing.passes[1:], strict=False):
        assert (one.power_percent, one.repeats) == (patch.power_percent, patch.passes)
        strokes = groups_of(run_gcode(drawing_to_gcode(drawing.with_one_pass(one))))[: len(patch.openings)]
        for opening, stroke in zip(patch.openings, strokes, strict=True):
            low, high = stroke[:, :2].min(axis=0) - origin, stroke[:, :2].max(axis=0) - origin
            np.testing.assert_allclose((low + high) / 2, (opening.x_mm, opening.y_mm), atol=1e-3)
            np.testing.assert_allclose(high - low, (opening.width_mm, opening.height_mm), atol=1e-3)
    powers = {patch.power_percent for patch in PIECE.patches}
    assert len(powers) == 3 and len({patch.passes for patch in PIECE.patches}) == 2


def test_the_command_prints_lines_for_the_material_file(tmp_path: Path) -> None:
    (tmp_path / "coupon.json").write_text(coupon_to_json(PIECE))
    cv2.imwrite(str(tmp_path / "scan.png"), coupon_photo(PIECE, CUT))
    result = run("kerf", tmp_path / "coupon.json", tmp_path / "scan.png")
    assert result.exit_code == 0, result.output
    assert "seen from the front" in result.stdout
    lines = result.stdout.split("# A1:")[1].splitlines()[1:3]
    values = tomllib.loads("\n".join(lines))
    assert values["kerf_x_mm"]["value"] == pytest.approx(CUT["A1"][0], abs=0.003)
    assert values["kerf_y_mm"]["value"] == pytest.approx(CUT["A1"][1], abs=0.003)
    assert "scan.png" in values["kerf_x_mm"]["source"]
    document = json.loads(run("kerf", tmp_path / "coupon.json", tmp_path / "scan.png", "--json").stdout)
    assert document["patches"][0]["kerf_x_mm"] == pytest.approx(values["kerf_x_mm"]["value"], abs=1e-4)


def with_change(tmp_path: Path, field: str, value: object) -> Path:
    document = json.loads(coupon_to_json(PIECE))
    document[field] = value
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(document))
    return path


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    good = tmp_path / "coupon.json"
    good.write_text(coupon_to_json(PIECE))
    blank, small, cropped = tmp_path / "blank.png", tmp_path / "small.png", tmp_path / "cropped.png"
    cv2.imwrite(str(blank), np.full((400, 400, 3), 90, np.uint8))
    photo = coupon_photo(PIECE, CUT, scale_px_mm=5.0)
    cv2.imwrite(str(small), photo)
    cv2.imwrite(str(cropped), coupon_photo(PIECE, CUT)[: photo.shape[0] * 2])
    (tmp_path / "text.json").write_text("[]")
    cases = [
        (tmp_path / "none.json", blank, "none.json: cannot be read"),
        (tmp_path / "text.json", blank, "expected a coupon.json"),
        (with_change(tmp_path, "fiducials_mm", [[0, 0]]), blank, "fiducials_mm"),
        (blank, blank, "expected a coupon.json"),
        (good, tmp_path / "none.png", "cannot be read"),
        (good, blank, "five round marks were not found"),
        (good, small, "px in a mm, limit 6 px"),
        (good, cropped, "cropped.png: "),
    ]
    for coupon, photo_path, expected in cases:
        result = run("kerf", coupon, photo_path)
        assert result.exit_code == 2, result.output
        assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
        assert expected in result.stderr


def test_the_file_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "coupon.json"
    path.write_text(coupon_to_json(PIECE))
    again: Coupon = load_coupon(path)
    assert coupon_to_json(again) == path.read_text()
