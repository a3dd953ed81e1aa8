"""Sensor files: made from camera files, read back with checks, edited without loss."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cmpdesign
from cmpdesign.sensor.sensor_file import load_sensor_file, parse_sensor_file
from cmpdesign.sensor.tables import SensorError
from cmpdesign.sensor.toml_text import replaced_tables, toml_table
from extractor import Deviation, load_rig
from tests.support.command import refused, run
from tests.support.hostile.input_files import RIG
from tests.support.layouts import small_layout

CAMERA = """\
size_px = [640, 360]
response = 2.2

[[view]]
name = "camera"
focal_px = [900.0, 901.0]
centre_px = [319.5, 179.5]

[calibration.camera]
date = 2026-03-01
parameters = ["fx_px", "fy_px"]
covariance = [
  [0.01, 0.009],
  [0.009, 0.01],
]
"""
BROKEN = {
    "version = 2\n": "version = 2 must be 1",
    "layuot = 'a'\n": "'layuot' is unknown (did you mean layout?)",
    "size_px = [300, 360]\n": "view 'left': area_px [0, 0, 320, 480] reaches beyond size_px [300, 360]",
    "calibration.camera.parameters = ['a']\ncalibration.camera.covariance = [[-1.0]]\n": "covariance is not symmetric",
    "calibration.camera.parameters = ['a']\ncalibration.camera.covariance = [[1.0, 2.0]]\n": "expected 1 rows of 1",
    "camera.format = 'JPG'\n": "'JPG' is no pixel format",
    "camera.size_px = [1, 2]\n": "camera.size_px is unknown",
    "limits.min_share_read = 90\n": "limits.min_share_read = 90 must be less than or equal to 1",
    "elastomer.thickness_mm = 2.0\nelastomer.marker_depth_mm = 3.0\n": "must be below thickness_mm",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    cmpdesign.write_layout(small_layout(), tmp_path / "layout.json")
    (tmp_path / "camera.toml").write_text(CAMERA)
    return tmp_path


def test_a_new_sensor_file_holds_the_camera_twice_behind_mirrors(folder: Path) -> None:
    (folder / "sensors").mkdir()
    camera = ("--camera", folder / "camera.toml")
    path = folder / "sensors" / "thumb"
    result = run("init", path, "--sensor", folder / "layout.json", *camera, *camera)
    assert result.exit_code == 0, result.output
    sensor = load_sensor_file(path.with_suffix(".toml"))
    assert sensor.layout.samefile(folder / "layout.json") and sensor.table.layout == "../layout.json"
    assert [view.area_px for view in sensor.rig.views] == [(0, 0, 320, 360), (320, 0, 320, 360)]
    assert all(view.mirrored and view.focal_px == (900, 901) for view in sensor.rig.views)
    assert sensor.table.response == 2.2 and sensor.table.calibration.camera is not None
    np.testing.assert_allclose(sensor.table.calibration.camera.covariance, [[0.01, 0.009], [0.009, 0.01]])
    assert str(sensor.table.calibration.camera.date) == "2026-03-01"
    # what the comments propose is right when it is uncommented
    proposed = sensor.text.replace("# [medium]\n", "[medium]\n").replace("# gel_mm = 4.0\n", "gel_mm = 4.0\n")
    tables = ("# [medium_deviation]", "# [camera]", "# [limits]", "# [elastomer]")
    lines = [
        line[2:] if line in tables or (line.startswith("# ") and " = " in line) else line
        for line in proposed.splitlines()
    ]
    uncommented = "\n".join(lines)
    whole = parse_sensor_file(uncommented)
    assert whole.rig.medium_deviation and whole.table.elastomer is not None
    assert whole.table.limits.max_rest_error_px == 0.1 and whole.table.camera.source == "0"
    asked = {"camera_size": (640, 360), "camera_fps": 30, "camera_format": "MJPG", "exposure_ms": 8}
    assert asked.items() <= whole.table.camera_settings.asked.items()
    assert "exists already" in refused("init", path, "--sensor", folder / "layout.json", *camera)
    assert "needs --sensor LAYOUT and --camera FILE" in refused("init", folder / "new", *camera)


@pytest.mark.parametrize("line", BROKEN)
def test_a_broken_file_is_one_line(line: str) -> None:
    rig = RIG if "area_px" in RIG else RIG.replace("[[view]]", "[[view]]\narea_px = [0, 0, 320, 480]")
    with pytest.raises(SensorError) as caught:
        parse_sensor_file(line + rig, "thumb.toml")
    message = str(caught.value)
    assert message.startswith("thumb.toml: ") and BROKEN[line] in message and "\n" not in message


def test_a_missing_file_is_named_with_the_folder_of_names(folder: Path) -> None:
    path = folder / "thumb.toml"
    path.write_text('layout = "pad.json"\n' + CAMERA)
    with pytest.raises(SensorError, match=r"layout is 'pad.json'; there is no .*relative to this file"):
        _ = load_sensor_file(path).layout
    path.write_text(CAMERA)
    with pytest.raises(SensorError, match="layout is missing"):
        _ = load_sensor_file(path).layout


NUMBERS = st.floats(-1e3, 1e3).map(lambda value: round(value, 6))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.lists(NUMBERS, min_size=4, max_size=4), max_size=3), st.text(max_size=9))
def test_replacing_tables_keeps_all_others(rows: list[list[float]], name: str) -> None:
    table = toml_table("[[deviation]]", {"name": name, "medium": [0.0, 0.1, 0.0, 0.0], "rows": rows or None})
    text = replaced_tables(CAMERA, [table], ("view", "deviation"))
    before, after = tomllib.loads(CAMERA), tomllib.loads(text)
    assert after.pop("deviation")[0].get("rows", []) == rows
    before.pop("view")
    assert after == before
    again = replaced_tables(text, [table], ("deviation",))
    assert tomllib.loads(again) == tomllib.loads(text)


def test_deviations_of_a_rig_are_read_back(tmp_path: Path) -> None:
    deviation = '\n[[deviation]]\nname = "gel"\nlens = [[1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]\n'
    path = tmp_path / "rig.toml"
    path.write_text(CAMERA + deviation)
    (found,) = load_rig(path).independent_deviations
    assert found == Deviation("gel", lens=((1.0, 1.0, *[0.0] * 7),))
    assert found.applied(load_rig(path).views)[0].focal_px == (901.0, 902.0)
    path.write_text(CAMERA + deviation.replace("[[1.0, ", "[[1.0, 1.0, "))
    assert "deviation[0].lens is [10] numbers" in refused(
        "calibrate", "rig", path, path, path, "-o", tmp_path / "o.toml"
    )
