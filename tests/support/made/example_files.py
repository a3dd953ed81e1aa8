"""The files that the examples of help texts name: made once, and copied for every example."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
from numpy.typing import NDArray

from cmpdesign import load, write_layout
from cmpdesign.files.images import read_image
from cmpdesign.products.laser.coupon.design import coupon_to_json, design_coupon
from cmpdesign.products.laser.setup import complete_setup
from tests.support.command import run
from tests.support.laser_tools import coupon_photo
from tests.support.layouts import small_text
from tests.support.made.datasets import write_plan
from tests.support.made.rest_pictures import nominal_layout, write_rest_images
from tests.support.tracking.press import write_press
from tests.support.tracking.scenes import LAYERS, moving

FRAMES = 3


def prepare_files(folder: Path, command: str) -> Path:
    """Write what the examples of a command name; each command has its own pattern under "layout.json"."""
    folder.mkdir()
    if command == "init":
        return folder
    (folder / "mine.toml").write_text('pattern = "honeycomb"\nlayers = 3\npitch_mm = 2.5\n', encoding="utf-8")
    match command:
        case "reconstruct":
            write_press(folder)
            shutil.copy(folder / "frames" / "0.png", folder / "rest.png")
            _write_video(folder / "press.avi", [read_image(folder / "frames" / f"{k}.png") for k in (0, 1)])
        case "calibrate":
            write_layout(nominal_layout(), folder / "layout.json")
            write_rest_images(folder / "rest")
        case "kerf":
            _write_coupon(folder)
        case "dataset":
            write_plan(folder, frames=2)
        case "render":
            (folder / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
        case "verify" | "track" | "extract" | "export":
            _write_moving(folder)
    if command == "export":
        for name in ("run1.npz", "run2.npz"):
            assert run("track", folder / "layout.json", folder / "frames", "-o", folder / name).exit_code == 0
    return folder


def _write_moving(folder: Path) -> None:
    (folder / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    images = [rendered.image for rendered in moving(FRAMES)]
    for place in ("frames", "more"):
        (folder / place).mkdir()
        for number, image in enumerate(images):
            cv2.imwrite(str(folder / place / f"{number}.png"), image)
    cv2.imwrite(str(folder / "sample.png"), images[0])
    _write_video(folder / "press.mp4", images)


def _write_video(path: Path, images: Sequence[NDArray[Any]]) -> None:
    codec = "mp4v" if path.suffix == ".mp4" else "FFV1"
    height, width = images[0].shape[:2]
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 25, (width, height))
    assert video.isOpened()
    for image in images:
        video.write(image)
    video.release()


def _write_coupon(folder: Path) -> None:
    piece = design_coupon(complete_setup(load("honeycomb").laser))
    photo = coupon_photo(piece, {patch.name: (0.1, 0.12) for patch in piece.patches}, scale_px_mm=11.8)
    (folder / "coupon.json").write_text(coupon_to_json(piece), encoding="utf-8")
    for name in ("scan.png", "photo.jpg"):
        cv2.imwrite(str(folder / name), photo)
