"""``calibrate camera`` through the whole reader: pictures in, files out that other programs read."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import cmpdesign
from benchmarks.suites.lenses.cameras import random_camera
from benchmarks.suites.lenses.pictures import Conditions, take_pictures
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import standard_layout
from extractor import load_rig
from tests.support.command import run


@pytest.fixture(scope="module")
def layout() -> Layout:
    return standard_layout(layers=6)


@pytest.fixture(scope="module")
def folder(layout: Layout, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A layout file and six pictures of its sheet, one of them of a sheet that is bent otherwise."""
    place = tmp_path_factory.mktemp("sheet")
    cmpdesign.write_layout(layout, place / "layout.json")
    rng = np.random.default_rng(46)
    camera = random_camera(rng, 60, 61)
    (place / "focal.json").write_text(json.dumps(camera.pinhole.focal_px))
    conditions = Conditions(bad=((4, "bent"),), jpeg_quality=None, response=2.2)
    (place / "pictures").mkdir()
    for number, picture in enumerate(take_pictures(camera, layout, 6, conditions, rng)):
        cv2.imwrite(str(place / "pictures" / f"{number}.png"), picture)
    return place


def test_pictures_become_files_that_others_read(folder: Path) -> None:
    true = json.loads((folder / "focal.json").read_text())
    output = folder / "camera.toml"
    result = run("calibrate", "camera", folder / "layout.json", folder / "pictures", "-o", output, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["format"] == "cmp-calibration-camera"
    assert document["response"] == pytest.approx(2.2)
    for name, value in zip(("fx_px", "fy_px"), true, strict=True):
        assert document["parameters"][name] == pytest.approx(value, abs=5 * document["deviations"][name])
        assert document["deviations"][name] < 0.2
    causes = [one["cause"] for one in document["pictures"]]
    assert "bent" in causes[4] and not any(causes[:4]) and not causes[5]
    (view,) = load_rig(folder / "camera.toml").views
    stored = cv2.FileStorage(str(folder / "camera.opencv.yaml"), cv2.FILE_STORAGE_READ)
    matrix, lens = stored.getNode("camera_matrix").mat(), stored.getNode("distortion_coefficients").mat()
    np.testing.assert_allclose([matrix[0, 0], matrix[1, 1]], view.focal_px)
    np.testing.assert_allclose(lens.ravel(), view.distortion)
    ros = (folder / "camera.ros.yaml").read_text()
    model = {5: "plumb_bob", 8: "rational_polynomial", 12: "rational_polynomial", 4: "equidistant"}
    assert f"distortion_model: {model[len(view.distortion)]}" in ros and "image_width: 1280" in ros
    assert cv2.imread(str(folder / "camera.png")).shape == (780, 960, 3)


def test_bad_input_is_one_line(folder: Path, tmp_path: Path) -> None:
    picture = cv2.imread(str(folder / "pictures" / "0.png"))
    with pytest.raises(cmpdesign.CmpDesignError, match=r"2 sizes \(640 x 480, 1280 x 960 px\)"):
        cmpdesign.calibrate_camera(folder / "layout.json", [picture, cv2.resize(picture, (640, 480))])
    with pytest.raises(cmpdesign.CmpDesignError, match="no picture shows the sheet: picture 1: "):
        cmpdesign.calibrate_camera(folder / "layout.json", [np.zeros_like(picture)])
    with pytest.raises(cmpdesign.CmpDesignError, match=r"camera\.json': unknown ending; expected \.toml"):
        cmpdesign.calibrate_camera(folder / "layout.json", [picture], tmp_path / "camera.json")
    with pytest.raises(cmpdesign.CmpDesignError, match="1 pictures show the sheet; a calibration needs 3"):
        cmpdesign.calibrate_camera(folder / "layout.json", [picture])
    assert not list(tmp_path.iterdir())
