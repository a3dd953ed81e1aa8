"""The coupon: its content, and the kerf read from its picture, which equals the kerf of the cut."""

from __future__ import annotations

import json
import math
import re
import struct
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from benchmarks.suites.coupons.measure import kerfs_table, read_case, standard_coupon
from cmpdesign.cli import app
from cmpdesign.design.design import load_design
from cmpdesign.products.laser.coupon.design import Coupon, coupon_to_json, design_coupon, load_coupon
from cmpdesign.products.laser.coupon.job import coupon_job as coupon_drawing
from cmpdesign.products.laser.coupon.photo import CouponReading, read_coupon
from cmpdesign.products.laser.coupon.picture import PhotoError
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.setup import complete_setup
from tests.support.laser_tools import Points, coupon_photo, groups_of, run_gcode

PIECE = design_coupon(complete_setup(load_design("honeycomb").laser))
CUT = {patch.name: (0.10 + 0.02 * i, 0.12 + 0.015 * i) for i, patch in enumerate(PIECE.patches)}


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize(
    "conditions",
    [
        {},
        {"turn_deg": 100.0, "noise": 4.0, "jpeg_quality": 90, "response": 2.4},
        {"scale_px_mm": 11.8, "turn_deg": 184.0},
        {"mirrored": True, "turn_deg": 20.0, "response": 1.9},
        {"sheet": 210.0, "ground": 25.0, "tilt": 0.1, "vignette": 0.1},
        {"sheet": 110.0, "ground": 225.0, "glow": 0.1, "bits": 16},
    ],
    ids=["upright", "turned, JPEG", "300 dpi", "back", "dark ground", "translucent, 16 bits"],
)
def test_the_kerf_is_read_back(conditions: dict[str, Any]) -> None:
    """Blur in linear light and an unknown response: the stated deviations are correct, and small enough for use."""
    reading = read_coupon(PIECE, coupon_photo(PIECE, CUT, **conditions))
    assert reading.from_back == conditions.get("mirrored", False)
    assert reading.scale_px_mm == pytest.approx(conditions.get("scale_px_mm", 23.6), rel=0.1)
    errors_mm, sigmas_mm = errors_of(reading)
    assert np.abs(errors_mm / sigmas_mm).max() < 4
    assert np.sqrt((errors_mm**2).mean()) < 2 * sigmas_mm.mean() < 0.03


def errors_of(reading: CouponReading) -> tuple[Points, Points]:
    """Errors and stated deviations of all kerfs at the face that was seen, mm."""
    widths = [width for one in reading.patches for width in (one.x, one.y)]
    true = np.array([CUT[one.patch.name] for one in reading.patches]).ravel()
    return np.array([w.value_mm for w in widths]) - true, np.array([w.sigma_mm for w in widths])


@pytest.mark.parametrize(("response", "blur_px"), [("srgb", 0.5), ("srgb", 2.0), ("linear", 2.0), (1.8, 2.0)])
def test_blur_does_not_change_widths_in_light(response: Any, blur_px: float) -> None:
    """The kerf is correct within a micrometre for any blur, if there is no noise and the response is stated."""
    photo = coupon_photo(PIECE, CUT, response=response, blur_px=blur_px, scale_px_mm=15.0, noise=0.0, bits=16)
    errors_mm, _ = errors_of(read_coupon(PIECE, photo, response=response))
    assert np.abs(errors_mm).max() < 0.001


def test_a_false_response_is_seen_in_the_edges() -> None:
    photo = coupon_photo(PIECE, CUT, noise=1.0, response=2.2)
    with pytest.raises(
        PhotoError, match="by response linear the light of the edges is off by an exponent of"
    ):
        read_coupon(PIECE, photo, response="linear")


@pytest.mark.parametrize(
    ("conditions", "expected"),
    [
        ({"ground": 270.0}, r"the opening at (.*) mm is clipped to white in \d+ % of its pixels, limit 2 %"),
        ({"sheet": 0.0, "noise": 0.0}, "the sheet at (.*) mm is clipped to black in 100 % of its pixels"),
        ({"sheet": 258.0, "ground": 30.0}, "the sheet at (.*) mm is clipped to white"),
    ],
)
def test_clipped_pictures_are_refused(conditions: dict[str, float], expected: str) -> None:
    with pytest.raises(PhotoError, match=expected):
        read_coupon(PIECE, coupon_photo(PIECE, CUT, response="linear", **conditions))


@pytest.mark.slow
def test_pooled_errors_over_random_coupons() -> None:
    """The benchmark's suite, with another seed: the stated deviations agree with the errors."""
    errors = [read_case(standard_coupon(), number, 20) for number in range(200)]
    rows = {row[""]: row for row in kerfs_table(errors).records()}
    assert 0.8 <= rows["all"]["z"] <= 1.3
    assert abs(rows["600 dpi and more"]["mean um"]) <= 4


def test_some_random_coupons() -> None:
    errors = [read_case(standard_coupon(), number, 3) for number in range(3)]
    pooled = kerfs_table(errors).records()[0]
    assert 0.2 < pooled["z"] < 2 and pooled["> 3"] < 0.05 and pooled["stated um"] < 12


def test_the_drawing_cuts_what_the_file_says() -> None:
    setup = complete_setup(load_design("honeycomb").laser)
    drawing, text = coupon_drawing(setup)
    assert text == coupon_to_json(PIECE)
    names = [one.name for one in drawing.passes]
    assert names == ["labels", "fiducials", *(f"patch-{patch.name}" for patch in PIECE.patches), "kerf-row"]
    origin = drawing.fiducials_mm[0]
    for patch, one in zip(PIECE.patches, drawing.passes[2:], strict=False):
        assert (one.power_percent, one.repeats) == (patch.power_percent, patch.passes)
        strokes = groups_of(run_gcode(drawing_to_gcode(drawing.with_one_pass(one))))[: len(patch.openings)]
        for opening, stroke in zip(patch.openings, strokes, strict=True):
            low, high = stroke[:, :2].min(axis=0) - origin, stroke[:, :2].max(axis=0) - origin
            np.testing.assert_allclose((low + high) / 2, (opening.x_mm, opening.y_mm), atol=1e-3)
            np.testing.assert_allclose(high - low, (opening.width_mm, opening.height_mm), atol=1e-3)
    powers = {patch.power_percent for patch in PIECE.patches}
    assert len(powers) == 3 and len({patch.passes for patch in PIECE.patches}) == 2


def test_the_command_prints_lines_for_the_material_file(tmp_path: Path) -> None:
    """The ground shows through the narrower face: a taper of 2 degrees through 1 mm is 0.0698 mm wider at the front."""
    (tmp_path / "coupon.json").write_text(coupon_to_json(PIECE))
    cv2.imwrite(str(tmp_path / "scan.png"), coupon_photo(PIECE, CUT))
    result = run("kerf", tmp_path / "coupon.json", tmp_path / "scan.png")
    assert result.exit_code == 0, result.output
    assert re.search(r"from back +no .*\nface +back ", result.stdout)
    lines = result.stdout.split("# A1:")[1].splitlines()[1:3]
    values = tomllib.loads("\n".join(lines))
    for name, cut in zip(("kerf_x_mm", "kerf_y_mm"), CUT["A1"], strict=True):
        front = values[name]
        assert front["value"] == pytest.approx(cut + 2 * math.tan(math.radians(2)), abs=0.003)
        faces = re.search(r"scan.png: front (\S+) mm, back (\S+) mm, back seen", front["source"])
        assert faces and float(faces[1]) == front["value"]
        assert float(faces[2]) == pytest.approx(cut, abs=0.003)
    document = json.loads(run("kerf", tmp_path / "coupon.json", tmp_path / "scan.png", "--json").stdout)
    first = document["patches"][0]
    assert first["kerf_x_mm"] == pytest.approx(values["kerf_x_mm"]["value"], abs=1e-4)
    assert first["kerf_x_mm"] - first["kerf_x_back_mm"] == pytest.approx(0.06984, abs=2e-5)
    stated = run("kerf", tmp_path / "coupon.json", tmp_path / "scan.png", "--json", "--face", "front")
    seen = json.loads(stated.stdout)
    assert seen["face"] == "front"
    assert seen["patches"][0]["kerf_x_mm"] == pytest.approx(first["kerf_x_back_mm"], abs=1e-9)


def test_a_face_that_the_taper_would_close_is_refused() -> None:
    narrow = {name: (0.05, 0.05) for name in CUT}
    with pytest.raises(PhotoError, match=r"A1: 0.05\d mm at the front would be -0.0\d+ mm at the back"):
        read_coupon(PIECE, coupon_photo(PIECE, narrow), face="front")


def test_gray_scans_and_stated_curves(tmp_path: Path) -> None:
    """A gray TIFF of 16 bits with a profile of exponent 1.8, as scanners write it."""
    (tmp_path / "coupon.json").write_text(coupon_to_json(PIECE))
    photo = coupon_photo(PIECE, CUT, response=1.8, bits=8, noise=1.0)[..., 0]
    Image.fromarray(photo).save(tmp_path / "scan.tif", icc_profile=gray_profile(1.8))
    result = run("kerf", tmp_path / "coupon.json", tmp_path / "scan.tif", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert "the file's curve" in document["response"]
    assert document["patches"][0]["kerf_x_back_mm"] == pytest.approx(CUT["A1"][0], abs=0.003)


def gray_profile(exponent: float) -> bytes:
    """A minimal gray ICC profile: one tag, a "curv" of one number."""
    curve = b"curv" + bytes(4) + struct.pack(">IH", 1, round(256 * exponent)) + bytes(2)
    tags = struct.pack(">I", 1) + b"kTRC" + struct.pack(">II", 144, len(curve))
    size = 144 + len(curve)
    head = (
        struct.pack(">I4sI4s4s4s", size, bytes(4), 0x02400000, b"scnr", b"GRAY", b"XYZ ")
        + bytes(12)
        + b"acsp"
    )
    return head.ljust(128, b"\0") + tags + curve


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
