"""The experiments from the command to the reports, on a small sensor with few trials."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

from cmpdesign.cli import app
from cmpdesign.evaluation.measures.pressed_cube import CUBE_POSITIONS_MM, CUBE_SIDE_MM
from cmpdesign.evaluation.reliability import METHODS, is_successful, judge_places
from cmpdesign.evaluation.simulated.conditions import mean_conditions, sample_conditions
from cmpdesign.evaluation.simulated.contacts import ContactLoad, PlacedSurface, place_surface
from cmpdesign.evaluation.simulated.instrument import instrument_for_method
from cmpdesign.evaluation.simulated.sensor import SensorError, load_sensor, parse_sensor
from tests.support.sensors import small_sensor_text


@pytest.fixture(scope="module")
def sensor_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sensor") / "small.toml"
    path.write_text(small_sensor_text(), encoding="utf-8")
    return path


def evaluate(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["evaluate", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return result.output


def report(folder: Path) -> dict[str, Any]:
    """report.json, with report.html checked to be one whole page that needs nothing else."""
    html = (folder / "report.html").read_text(encoding="utf-8")
    ElementTree.fromstring(html.replace("<!doctype html>", "").replace('<meta charset="utf-8">', ""))
    assert not re.search(r'(src|href)="(?!#)', html) and "<svg" in html and "<table" in html
    document: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert document["format"] == "cmp-evaluation" and document["version"] == 1
    return document


def test_reliability(sensor_file: Path, tmp_path: Path) -> None:
    arguments = (
        "reliability",
        "-o",
        tmp_path,
        "--trials",
        2,
        "--workers",
        1,
        "--sensor",
        sensor_file,
        "--seed",
        5,
    )
    printed = evaluate(*arguments)
    modes = report(tmp_path)["modes"]
    assert list(modes) == ["twist", "shear_x", "shear_y"] and re.search(
        r"^twist, of 2 +\d", printed, re.MULTILINE
    )
    for mode in modes.values():
        assert set(mode) == set(METHODS)
        for one in mode.values():
            assert one["trials"] == 2 and 0 <= one["successful"] <= 2
            assert one["interval_95"][0] <= one["share"] <= one["interval_95"][1]
        assert mode["multicolor"]["successful"] <= mode["multicolor_repair"]["successful"] or (
            mode["multicolor_repair"]["wrong_markers"] > mode["multicolor"]["wrong_markers"]
        )
    assert modes["shear_x"]["square"]["article"]["successful"] == 6

    files = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    lines = files["journal.jsonl"].splitlines(keepends=True)
    (tmp_path / "journal.jsonl").write_bytes(b"".join(lines[:4]) + lines[4][:20])
    evaluate(*arguments)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == files
    assert "other conditions" in evaluate(*arguments[:-1], 6, code=2)


def test_a_turned_contact_is_the_contact_turned() -> None:
    """In the picture turned by 90 degrees, displacements along x become displacements along y."""
    slope = PlacedSurface(lambda xy: np.column_stack([xy + [[0.1, 0.0]], 0.01 * xy[:, 0]]), (1.0, 2.0))
    turned = PlacedSurface(slope.surface_at_origin, (1.0, 2.0), 90.0)
    np.testing.assert_allclose(slope.displacement_mm(np.array([[4.0, 2.0]])), [[0.1, 0, 0.03]], atol=1e-12)
    np.testing.assert_allclose(turned.displacement_mm(np.array([[1.0, 5.0]])), [[0, 0.1, 0.03]], atol=1e-12)


def test_precision(sensor_file: Path, tmp_path: Path) -> None:
    evaluate("precision", "-o", tmp_path, "--trials", 1, "--workers", 1, "--sensor", sensor_file)
    document = report(tmp_path)
    for mode, change in (("press", -61.2), ("press_shear", -58.1)):
        one = document["edge_fit_error_mm"][mode]
        assert one["article_change_percent"] == change
        assert all(isinstance(one[method], float) for method in ("square", "multicolor"))
        assert one["change_percent"] == pytest.approx(100 * (one["multicolor"] / one["square"] - 1), abs=0.01)
    edges = document["edge_fit_error_mm"]
    assert list(edges) == ["press", "press_diagonal", "press_turned", "press_shear"]
    for mode in ("press_diagonal", "press_turned"):
        assert edges[mode]["article_change_percent"] is None
        assert set(edges[mode]["variants"]) >= {"with_virtual", "perfect", "perfect_with_virtual"}
    assert list(document["shape_error_mm"]) == ["rest", "ball", "ring", "cylinder", "rib", "wedge"]
    for methods in document["shape_error_mm"].values():
        assert methods["multicolor"]["measured"]["mean"] > 0.5
        for one in methods.values():
            if (
                one["marker_median_mm"]["mean"] is not None
            ):  # the small sensor's views may lose a crushed cell
                assert 0 < one["marker_median_mm"]["mean"] < 0.05
                assert 0 < one["depth_rms_mm"]["mean"] <= one["surface_rms_mm"]["mean"] < 0.5

    rest = document["shape_error_mm"]["rest"]["multicolor"]
    assert rest["measured"]["mean"] == 1 and rest["marker_rms_mm"]["mean"] < 0.02
    assert 0.5 < rest["over_sigma"]["mean"] < 1.5 and 0.5 < rest["over_sigma_median"]["mean"] < 1.5


def test_response(sensor_file: Path, tmp_path: Path) -> None:
    evaluate("response", "-o", tmp_path, "--trials", 1, "--workers", 1, "--sensor", sensor_file)
    response = report(tmp_path)["response"]
    assert list(response) == ["shear_x", "shear_y"]
    for one in response.values():
        assert 0.5 < one["square"] < 1.5 and 0.5 < one["multicolor"] < 1.5
    other = tmp_path / "two"
    evaluate("response", "-o", other, "--trials", 1, "--workers", 2, "--sensor", sensor_file)
    for name in ("report.json", "report.html"):
        assert (other / name).read_bytes() == (tmp_path / name).read_bytes()


def test_designs(sensor_file: Path, tmp_path: Path) -> None:
    (tmp_path / "fine.toml").write_text(
        'pattern = "honeycomb"\nlayers = 5\npitch_mm = 1.2\n', encoding="utf-8"
    )
    (tmp_path / "old.toml").write_text('pattern = "square"\nlayers = 4\npitch_mm = 1.5\n', encoding="utf-8")
    names = (tmp_path / "fine.toml", tmp_path / "old.toml")
    out = tmp_path / "out"
    evaluate("designs", *names, "-o", out, "--trials", 1, "--workers", 1, "--sensor", sensor_file)
    found = report(out)["designs"]
    assert list(found) == ["fine", "old"]
    assert found["fine"]["markers_per_cm2"] > found["old"]["markers_per_cm2"]
    assert found["fine"]["smallest_feature_mm"] == pytest.approx(1.2 / np.sqrt(3), abs=1e-6)
    assert found["old"]["smallest_feature_mm"] == pytest.approx(1.5)
    for one in found.values():
        assert one["laser_time_s"] > 10 and 0 < one["surface_rms_mm"]["mean"] < 0.5
    (tmp_path / "dust.toml").write_text(
        'pattern = "honeycomb"\nlayers = 9\npitch_mm = 0.2\n', encoding="utf-8"
    )
    printed = evaluate(
        "designs",
        tmp_path / "dust.toml",
        "-o",
        tmp_path / "dust",
        "--trials",
        1,
        "--workers",
        1,
        "--sensor",
        sensor_file,
    )
    assert re.search(r"^dust  +0  ", printed, re.MULTILINE)
    assert "two designs are called 'fine'" in evaluate("designs", names[0], names[0], "-o", out, code=2)


def test_angles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmpdesign.evaluation.angles.EDGE_LENGTHS_PX", (30,))
    evaluate("angles", "-o", tmp_path, "--workers", 1)
    cells = report(tmp_path)["cells"]
    assert [cells[f"n{n}"]["shape_change_deg"]["formula"] for n in (3, 4, 6)] == [120, 90, 60]
    for cell in cells.values():
        assert cell["rotation_deg"]["measured"]["30px"] == pytest.approx(
            cell["rotation_deg"]["formula"], abs=4
        )


def test_the_ten_places_are_4_mm_apart_and_the_cube_lies_on_both_patterns() -> None:
    assert len(set(CUBE_POSITIONS_MM)) == 10
    for place in CUBE_POSITIONS_MM:
        assert any(sorted(np.abs(np.subtract(place, other))) == [0, 4] for other in CUBE_POSITIONS_MM)
    reach = np.abs(CUBE_POSITIONS_MM).max(axis=0) + CUBE_SIDE_MM / 2
    for method in ("square", "multicolor"):
        layout = instrument_for_method(load_sensor().text, method).layout
        assert (reach < np.abs(layout.marker_xy_mm[layout.present]).max(axis=0)).all()


def test_a_contact_moves_with_its_place() -> None:
    text = small_sensor_text().replace("marker_depth_mm = 1.0", "marker_depth_mm = 0.0")
    assert "marker_depth_mm = 0.0" in text
    here, there = (
        place_surface(text, ContactLoad("ball", 1.0), centre) for centre in ((0.0, 0.0), (2.0, -1.5))
    )
    points = np.random.default_rng(0).uniform(-5, 5, (50, 2))
    assert there(points + [2.0, -1.5]) == pytest.approx(here(points) + [2.0, -1.5, 0.0])
    assert here.displacement_mm(np.zeros((1, 2)))[0, 2] == pytest.approx(-1.0, abs=0.02)


def test_conditions_stay_in_their_ranges() -> None:
    ranges = load_sensor().table.conditions
    for seed in range(50):
        drawn = sample_conditions(ranges, np.random.default_rng(seed), 15.0)
        assert ranges.blur_px[0] <= drawn.blur_px <= ranges.blur_px[1]
        assert ranges.noise[0] <= drawn.noise <= ranges.noise[1]
        assert len(drawn.light.leds) <= ranges.lamps[1]
        assert drawn.damage is None or len(drawn.damage.blobs) <= ranges.specks[1]
    assert mean_conditions(ranges).damage is None and mean_conditions(ranges).blur_px == pytest.approx(1.2)


def test_pictures_and_the_square_readers_have_the_sensors_response() -> None:
    """A linear camera's picture, read with the linear response, gives the result of an sRGB camera's picture."""
    rms, brightness = {}, {}
    for response in ("srgb", "linear"):
        text = small_sensor_text().replace('response = "srgb"', f'response = "{response}"')
        one = instrument_for_method(text, "square")
        seen = one.picture(mean_conditions(one.sensor.table.conditions), 0)
        errors = [m.xy_px - xy for m, xy in zip(one.read(seen.image), seen.truth.marker_xy_px, strict=True)]
        rms[response] = float(np.sqrt(np.nanmean(np.square(errors))))
        brightness[response] = np.mean(seen.image)
    assert brightness["srgb"] > brightness["linear"] + 2
    assert rms["srgb"] == pytest.approx(rms["linear"], rel=0.1)


def test_what_counts_as_successful() -> None:
    """All markers right; one lost; one wrong far away from the contact."""
    one = instrument_for_method(small_sensor_text(), "square")
    pressed = place_surface(small_sensor_text(), ContactLoad("large_ball", 2.0), (0.0, 0.0))
    truth = one.picture(mean_conditions(one.sensor.table.conditions), 0, pressed).truth
    places = np.array(truth.marker_xy_px)
    area = np.linalg.norm(pressed.displacement_mm(one.layout.marker_xy_mm), axis=1).argsort()
    right = judge_places(one, pressed, truth, places)
    assert right["right"] == right["needed"] and all(
        is_successful(name, right) for name in ("strict", "area_95")
    )
    lost = places.copy()
    lost[0, area[-1]] = np.nan
    found = judge_places(one, pressed, truth, lost)
    assert not is_successful("strict", found) and is_successful("area_95", found) and found["wrong"] == 0
    wrong = places.copy()
    wrong[1, area[0]] += 10
    found = judge_places(one, pressed, truth, wrong)
    assert found["wrong"] == 1 and not any(
        is_successful(name, found) for name in ("strict", "area_95", "no_wrong")
    )


def test_rest_poses_are_those_of_the_sensor() -> None:
    for method in ("square", "multicolor"):
        one = instrument_for_method(small_sensor_text(), method)
        for view, known in zip(one.reconstructor.poses.views, one.sensor.rig.views, strict=True):
            assert np.abs(view.position_mm - known.position_mm).max() < 0.2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("thickness_mm = 5.0", "thickness_mm = -5.0"), "elastomer.thickness_mm"),
        (("[elastomer]", "[elastomer"), "is no valid TOML"),
        (("noise = [1.0, 3.0]", "noise = [3.0, 1.0]"), "smaller limit first"),
        (('object = "wedge"', 'object = "spoon"'), "spoon"),
        (("size_px = [640, 360]", ""), "size_px"),
        (("focal_px = [900.0, 900.0]", "focal_px = [900.0, 0.0]"), "focal_px"),
        (("friction = 0.8", "friction = 0.8\nstickiness = 1"), "stickiness"),
        (('response = "srgb"', 'response = "rec709"'), "response is 'rec709'; give 'srgb', 'linear'"),
        (('response = "srgb"', "response = 9"), "response is the exponent 9; it must lie between 0.2 and 5"),
    ],
)
def test_a_bad_sensor_is_one_clear_line(change: tuple[str, str], message: str) -> None:
    assert change[0] in small_sensor_text()
    with pytest.raises(SensorError, match=re.escape(message)):
        parse_sensor(small_sensor_text().replace(*change), "small.toml")


def test_bad_choices_are_one_line(tmp_path: Path) -> None:
    for arguments, message in (
        (("response", "-o", tmp_path, "--sensor", "tac4d"), "did you mean tac3d?"),
        (
            ("response", "-o", tmp_path, "--preset", "best"),
            "--preset': 'best' is not one of 'balanced', 'accurate'",
        ),
    ):
        assert message in evaluate(*arguments, code=2)
