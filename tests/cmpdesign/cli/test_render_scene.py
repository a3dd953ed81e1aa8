"""The command that renders: pictures, videos and folders from scene files; refused input, and interruptions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from cmpdesign.cli import app
from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import load_truth, load_truths, render, standard_layout
from cmpdesign.scene.files.frame_writer import open_frame_writer
from tests.support.scene_texts import MOVING, SIZE, scene_writer


@pytest.fixture(scope="module")
def layout() -> Layout:
    return standard_layout(layers=2)


@pytest.fixture
def run(tmp_path: Path, layout: Layout) -> Callable[..., tuple[int, str]]:
    (tmp_path / "layout.json").write_text(layout_to_json(layout), encoding="utf-8")

    def invoke(text: str, *arguments: object) -> tuple[int, str]:
        (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
        words = ["render", tmp_path / "layout.json", "--scene", tmp_path / "scene.toml", *arguments]
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        return result.exit_code, " ".join(result.output.split())

    return invoke


def test_the_command_draws_pictures_videos_and_folders(
    run: Callable[..., tuple[int, str]], tmp_path: Path, layout: Layout
) -> None:
    folder, film, truth = tmp_path / "frames", tmp_path / "film.mkv", tmp_path / "truth.npz"
    code, said = run(MOVING, "-o", folder, "--truth", truth)
    assert code == 0 and "size 96 x 80 px" in said and "frames 5 fps 4" in said
    pictures = [cv2.imread(str(path)) for path in sorted(folder.iterdir())]
    expected = [render(scene, size=SIZE) for scene in scene_writer(tmp_path, layout)(MOVING).scenes()]
    assert len(load_truths(truth)[0]) == len(pictures) == 5
    for picture, frame in zip(pictures, expected, strict=True):
        np.testing.assert_array_equal(picture, frame.image)
    assert run(MOVING, "-o", film)[0] == 0
    video = cv2.VideoCapture(str(film))
    for frame in expected:  # FFV1 loses nothing
        np.testing.assert_array_equal(video.read()[1], frame.image)
    video.release()
    still = MOVING.partition("[sequence]")[0]
    code, said = run(still, "-o", tmp_path / "one.png", "--truth", truth, "--size", "60x50", "--seed", 3)
    assert code == 0 and "size 60 x 50 px" in said
    assert cv2.imread(str(tmp_path / "one.png")).shape == (50, 60, 3)
    assert load_truth(truth).marker_xy_px.shape == (19, 2)


def test_the_command_refuses_what_does_not_fit(run: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    still = MOVING.partition("[sequence]")[0]
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").write_text("")
    odd = MOVING.replace("[96, 80]", "[97, 80]")
    deep = MOVING.replace("noise = 3", "bits = 16")
    for text, words, message in (
        (still, ("-o", tmp_path / "a.mkv"), "unknown ending; expected one of .png"),
        (MOVING, ("-o", tmp_path / "a.png"), "expected .mp4, .avi, .mkv, or none"),
        (MOVING, ("-o", tmp_path / "full"), "is no empty folder"),
        (odd, ("-o", tmp_path / "a.mp4"), "an .mp4 has even sides"),
        (deep, ("-o", tmp_path / "a.avi"), "a video has 8 bits, the sensor 16"),
        (still, ("-o", tmp_path / "a.png", "--pitch", 30), "--pitch cannot be given with --scene"),
        (still, ("-o", tmp_path / "a.png", "--response", "linear"), "write [sensor] response into the file"),
        (still, ("-o", tmp_path / "a.png", "--front"), "--front or --mirrored cannot be given"),
    ):
        code, said = run(text, *words)
        assert code == 2 and message in said, said
    assert not (tmp_path / "a.png").exists() and not (tmp_path / "a.mkv").exists()


def test_an_interrupted_sequence_leaves_nothing(run: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    # The last frames' dent turns away from the camera: refused while drawing.
    steep = MOVING.replace("[camera]\npitch_px = 16", "[camera]\npitch_px = 16\ntilt_deg = -60").replace(
        "1.0]]", "9]]"
    )
    before = sorted(path.name for path in tmp_path.iterdir())
    for name in ("frames", "film.mkv"):
        code, said = run(steep, "-o", tmp_path / name, "--truth", tmp_path / "t.npz")
        assert code == 2 and "turn away" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted({*before, "scene.toml"})


def test_films_write_beside(tmp_path: Path) -> None:
    film = open_frame_writer(tmp_path / "f", 5, (8, 8), 16)
    film.add(np.full((8, 8, 3), 40_000, np.uint16))
    assert not (tmp_path / "f").exists()
    film.close()
    picture = cv2.imread(str(tmp_path / "f" / "frame_000000.png"), cv2.IMREAD_UNCHANGED)
    assert picture.dtype == np.uint16 and picture[0, 0, 0] == 40_000
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        open_frame_writer(tmp_path / "file" / "f", 5, (8, 8), 8).add(np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(CmpDesignError, match="unknown ending"):
        open_frame_writer(tmp_path / "x.gif", 5, (8, 8), 8)
