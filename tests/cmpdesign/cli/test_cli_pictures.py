"""The command line on pictures: render and verify, with good, bad and damaged files."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from cmpdesign.cli import app
from cmpdesign.files.images import IMAGE_BITS
from cmpdesign.scene import load_truth
from tests.support.command import refused, run


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a layout and a good picture of it."""
    folder = tmp_path_factory.mktemp("made")
    assert run("build", "round", "-o", folder, "--set", "layers=5", "--only", "layout").exit_code == 0
    options = (
        "--size",
        "400x300",
        "--pitch",
        "24",
        "--rotation",
        "50",
        "--tilt",
        "20",
        "--press",
        "0.4",
        "--noise",
        "2",
    )
    result = run(
        "render", folder / "layout.json", "-o", folder / "good.png", "--truth", folder / "truth.npz", *options
    )
    assert result.exit_code == 0, result.output
    return folder


def test_render_writes_picture_and_truth(made: Path) -> None:
    image, truth = cv2.imread(str(made / "good.png")), load_truth(made / "truth.npz")
    assert image is not None and image.shape == (300, 400, 3)
    assert truth.marker_xy_px.shape == (91, 2) and truth.visible.all() and not truth.mirrored


def test_render_is_seeded(made: Path, tmp_path: Path) -> None:
    def rendered(seed: int) -> bytes:
        options = ("--noise", "3", "--seed", seed)
        assert run("render", made / "layout.json", "-o", tmp_path / "a.png", *options).exit_code == 0
        return (tmp_path / "a.png").read_bytes()

    assert rendered(1) == rendered(1) != rendered(2)


def test_render_takes_a_response(made: Path, tmp_path: Path) -> None:
    def rendered(*options: object) -> np.ndarray:
        assert run("render", made / "layout.json", "-o", tmp_path / "a.png", *options).exit_code == 0
        return np.asarray(cv2.imread(str(tmp_path / "a.png")), dtype=float)

    usual, linear, power = (rendered("--response", text) for text in ("srgb", "linear", "2.2"))
    np.testing.assert_array_equal(rendered(), usual)
    # blurred edges are brighter once encoded; most pixels lie inside cells and do not differ
    assert usual.mean() > linear.mean() + 0.3 and np.median(np.abs(usual - linear)) == 0
    assert 0 < np.abs(usual - power).max() < np.abs(usual - linear).max()


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--pitch", "0", "--pitch is 0; it must be above 0 px"),
        ("--pitch", "nan", "--pitch is nan; expected a finite number"),
        ("--rotation", "inf", "--rotation is inf"),
        ("--tilt", "89", "--tilt is 89"),
        ("--blur", "-1", "--blur is -1"),
        ("--noise", "-1", "--noise is -1"),
        ("--press", "50", "fold"),
        ("--response", "rec709", "--response rec709: expected srgb, linear or an exponent from 0.2 to 5"),
        ("--response", "9", "--response 9: expected srgb, linear or an exponent from 0.2 to 5"),
        ("--response", "nan", "--response nan: expected srgb"),
        ("--size", "640", "expected WIDTHxHEIGHT"),
        ("--truth", "missing/truth.npz", "missing/truth.npz"),
    ],
)
def test_render_refuses(
    option: str, value: str, expected: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert expected in refused("render", made / "layout.json", "-o", "image.png", f"{option}={value}")
    assert list(tmp_path.iterdir()) == []


def test_verify_takes_a_response(made: Path, tmp_path: Path) -> None:
    """The overlay differs where markers lie elsewhere; a picture is read by its own response without being told."""
    for response in ("srgb", "linear", "2.2"):
        options = ("-o", tmp_path / response, "--response", response)
        assert run("verify", made / "layout.json", made / "good.png", *options).exit_code == 0
    assert run("verify", made / "layout.json", made / "good.png", "-o", tmp_path / "usual").exit_code == 0
    usual, srgb, linear, power = (
        np.asarray(cv2.imread(str(tmp_path / name / "good.overlay.png")), dtype=int)
        for name in ("usual", "srgb", "linear", "2.2")
    )
    np.testing.assert_array_equal(usual, srgb)
    assert 0 < np.abs(srgb - power).mean() < np.abs(srgb - linear).mean()
    for value in ("rec709", "9"):
        expected = f"--response {value}: "
        assert expected in refused("verify", made / "layout.json", made / "good.png", "--response", value)


def test_verify_a_good_picture(made: Path, tmp_path: Path) -> None:
    result = run(
        "verify", made / "layout.json", made / "good.png", "-o", tmp_path, "--debug", tmp_path / "stages"
    )
    assert result.exit_code == 0, result.output
    assert "good.png: verified (91 of 91 measured, 0 repaired, 0 lost" in result.stdout
    report = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert report["verified"] is True
    overlay = cv2.imread(str(tmp_path / "good.overlay.png"))
    assert overlay is not None and overlay.shape[0] * 400 == overlay.shape[1] * 300
    assert (overlay == (80, 255, 255)).all(axis=2).sum() > 91  # measured markers are yellow
    stages = sorted((tmp_path / "stages").iterdir())
    assert len(stages) >= 5
    assert all(cv2.imread(str(path)) is not None for path in stages)


def test_json_is_all_there_is_on_stdout(made: Path) -> None:
    result = run("verify", made / "layout.json", made / "good.png", "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 0 and result.stderr == ""
    assert report["images"][0]["measured"] == 91


@pytest.mark.parametrize("deep", [False, True])
def test_alpha_and_16_bits_are_read(deep: bool, made: Path, tmp_path: Path) -> None:
    image = cv2.imread(str(made / "good.png"))
    assert image is not None
    pixels: Any = (
        image.astype(np.uint16) * 257 if deep else np.dstack([image, np.full((300, 400), 9, np.uint8)])
    )
    assert cv2.imwrite(str(tmp_path / "a.png"), pixels)
    assert run("verify", made / "layout.json", tmp_path / "a.png").exit_code == 0


def test_not_verified_says_why(made: Path, tmp_path: Path) -> None:
    black = tmp_path / "black.png"
    cv2.imwrite(str(black), np.zeros((100, 100, 3), np.uint8))
    result = run("verify", made / "layout.json", black)
    assert result.exit_code == 1 and "not verified: " in result.stdout
    back = tmp_path / "back.png"
    arguments = ("--size", "400x300", "--pitch", "24", "--mirrored")
    assert run("render", made / "layout.json", "-o", back, *arguments).exit_code == 0
    result = run("verify", made / "layout.json", back)
    assert result.exit_code == 1 and "seen from the back" in result.stdout


def test_a_bar_over_many_images_stays_on_stderr(made: Path, tmp_path: Path) -> None:
    images = [made / "good.png", made / "none.png", made / "good.png"]
    arguments = [str(value) for value in ("verify", made / "layout.json", *images)]
    result = CliRunner().invoke(app, arguments, env={"FORCE_COLOR": "1"})
    assert "verifying" in result.stderr and "error: " in result.stderr
    lines = result.stdout.splitlines()
    assert len(lines) == 2 and all("verified (91 of 91" in line for line in lines)


def test_one_bad_file_among_many(made: Path, tmp_path: Path) -> None:
    bad, gray = tmp_path / "bad.png", tmp_path / "gray.png"
    bad.write_text("no picture")
    cv2.imwrite(str(gray), np.zeros((50, 50), np.uint8))
    images = [bad, made / "good.png", gray, made / "none.png", made / "good.png"]
    result = run("verify", made / "layout.json", *images, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stdout.count("verified (91 of 91") == 2
    errors = result.stderr.splitlines()
    assert len(errors) == 3 and all(line.startswith("error: ") for line in errors)
    assert "a multicolor pattern needs color" in errors[1]
    report = json.loads((tmp_path / "out" / "verify.json").read_text(encoding="utf-8"))
    assert [image["verified"] for image in report["images"]] == [False, True, False, False, True]
    assert report["verified"] is False and "is not an image" in report["images"][0]["error"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "verify.json",
        "good.overlay.png",
        "good-2.overlay.png",
    }


def test_the_worst_exit_code_counts(made: Path, tmp_path: Path) -> None:
    black = tmp_path / "black.png"
    cv2.imwrite(str(black), np.zeros((100, 100, 3), np.uint8))
    assert run("verify", made / "layout.json", black, made / "good.png").exit_code == 1
    assert run("verify", made / "layout.json", black, made / "none.png", made / "good.png").exit_code == 2


def test_bad_layouts(made: Path, tmp_path: Path) -> None:
    text = (made / "layout.json").read_text(encoding="utf-8")
    layout = tmp_path / "layout.json"
    for damaged, expected in (
        (text.replace('"version": 1', '"version": 7'), "version is 7; expected 1"),
        (text[: len(text) // 2], "not JSON, or truncated"),
    ):
        layout.write_text(damaged, encoding="utf-8")
        assert expected in refused("verify", layout, made / "good.png")
        assert expected in refused("render", layout, "-o", tmp_path / "image.png")


def test_square_patterns_are_refused_in_one_line(tmp_path: Path) -> None:
    # check, build and verify agree: nothing of it is numbered.
    assert run("check", "square").exit_code == 1
    built = run("build", "square", "-o", tmp_path, "--only", "layout")
    assert built.exit_code == 1 and "the extractor reads cells with three corners only" in built.stderr
    assert run("render", tmp_path / "layout.json", "-o", tmp_path / "image.png").exit_code == 0
    assert "square" in refused("verify", tmp_path / "layout.json", tmp_path / "image.png")


def test_output_that_cannot_be_written(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("here before")
    assert "cannot be written" in refused(
        "verify", made / "layout.json", made / "good.png", "-o", tmp_path / "file"
    )
    assert "cannot be written" in refused("render", made / "layout.json", "-o", tmp_path / "file" / "a.png")

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    assert "No space left" in refused("render", made / "layout.json", "-o", tmp_path / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


MAGIC = {
    ".png": b"\x89PNG", ".jpg": b"\xff\xd8\xff", ".JPEG": b"\xff\xd8\xff", ".tif": b"II*\0", ".tiff": b"II*\0",
    ".bmp": b"BM", ".webp": b"RIFF",
}  # fmt: skip


@pytest.mark.parametrize("suffix", IMAGE_BITS)
def test_an_image_is_encoded_by_its_ending(suffix: str, made: Path, tmp_path: Path) -> None:
    options = ("--size", "200X160", "--noise", "2")
    for name in (f"a{suffix}", "b.png"):
        assert run("render", made / "layout.json", "-o", tmp_path / name, *options).exit_code == 0
    data = (tmp_path / f"a{suffix}").read_bytes()
    assert data.startswith(MAGIC.get(suffix) or MAGIC[suffix.upper()])
    image, exact = cv2.imread(str(tmp_path / f"a{suffix}")), cv2.imread(str(tmp_path / "b.png"))
    assert image is not None and exact is not None and image.shape == (160, 200, 3)
    error = np.abs(image.astype(int) - exact)
    assert error.max() == 0 or (suffix in (".jpg", ".jpeg") and error.mean() < 5)


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.txt", "a", "layout.json"])
def test_an_image_of_another_ending_is_refused(name: str, made: Path, tmp_path: Path) -> None:
    line = refused("render", made / "layout.json", "-o", tmp_path / name)
    assert "unknown ending; expected one of .png, .tif" in line and list(tmp_path.iterdir()) == []
    line = refused("render", made / "layout.json", "-o", tmp_path / "a.png", "--truth", tmp_path / name)
    assert "unknown ending; expected .npz" in line and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["--pitch", "--tilt", "--blur", "--noise", "--press-radius"])
def test_the_option_is_blamed_that_was_given(option: str, made: Path, tmp_path: Path) -> None:
    line = refused("render", made / "layout.json", "-o", tmp_path / "a.png", "--press", "0.1", option, "-500")
    assert line.startswith(f"error: {option} is -500; ")


def test_verify_takes_a_folder(made: Path, tmp_path: Path) -> None:
    for name in ("frame10.png", "frame2.png"):
        (tmp_path / name).write_bytes((made / "good.png").read_bytes())
    (tmp_path / "notes.txt").write_text("no picture")
    result = run("verify", made / "layout.json", tmp_path, made / "good.png")
    names = [line.partition(": ")[0] for line in result.stdout.splitlines()]
    assert result.exit_code == 0 and [Path(name).name for name in names] == [
        "frame2.png",
        "frame10.png",
        "good.png",
    ]
    (tmp_path / "empty").mkdir()
    assert "holds no image" in refused("verify", made / "layout.json", tmp_path / "empty")


def test_swapped_channels_are_named_and_read_when_told(made: Path, tmp_path: Path) -> None:
    """An RGB array saved by OpenCV: its red and blue have changed places."""
    image = cv2.imread(str(made / "good.png"))
    assert image is not None
    cv2.imwrite(str(tmp_path / "rgb.png"), image[:, :, ::-1])
    result = run("verify", made / "layout.json", tmp_path / "rgb.png")
    assert result.exit_code == 1 and "red and blue are swapped" in result.stdout
    assert "--channels rgb" in result.stdout
    assert run("verify", made / "layout.json", tmp_path / "rgb.png", "--channels", "rgb").exit_code == 0


def test_verify_shows_the_quality_of_a_picture(made: Path, tmp_path: Path) -> None:
    image = cv2.imread(str(made / "good.png"))
    assert image is not None
    bright = np.minimum(image.astype(float) * 2.2, 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "bright.png"), bright)
    result = run("verify", made / "layout.json", made / "good.png", tmp_path / "bright.png")
    good, *rest = result.stdout.splitlines()
    assert "verified (91 of 91" in good and "bright.png" in rest[0]
    assert any("shorten the exposure" in line for line in rest)
    report = json.loads(run("verify", made / "layout.json", made / "good.png", "--json").stdout)
    quality = report["images"][0]["quality"]
    assert quality["hints"] == [] and quality["clipping"] == 0 and 20 < quality["edge_px"] < 30
    assert 0.5 < quality["blur_px"] < 2 and 1 < quality["noise"] < 3 and len(quality["weakest_inks"]) == 2


def test_verify_takes_the_layouts_of_a_family(tmp_path: Path) -> None:
    for code in (1, 2, 3):
        layout = tmp_path / str(code)
        design = ("honeycomb", "--set", "layers=7", "--set", f"code={code}")
        assert run("build", *design, "-o", layout, "--only", "layout").exit_code == 0
    layouts = [tmp_path / str(code) / "layout.json" for code in (1, 2)]
    pictures = [tmp_path / f"{code}.png" for code in (2, 3)]
    for code, picture in zip((2, 3), pictures, strict=True):
        layout = tmp_path / str(code) / "layout.json"
        assert run("render", layout, "-o", picture, "--pitch", "20", "--size", "400x340").exit_code == 0
    result = run("verify", *layouts, pictures[0])
    assert result.exit_code == 0 and "verified (pad 2, " in result.stdout
    document = json.loads(run("verify", *layouts, *pictures, "--json").stdout)
    assert document["codes"] == [1, 2]
    own, other = document["images"]
    assert own["verified"] and own["code"] == 2
    assert not other["verified"] and "code" not in other and "white cells" in other["reason"]
    error = refused("verify", *layouts, pictures[0], "--report", tmp_path / "report.zip")
    assert "--report bundles one layout, and 2 are given" in error
