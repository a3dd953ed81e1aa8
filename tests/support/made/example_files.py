"""The files that the examples of help texts name: made once, and copied for every example."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.lenses.cameras import random_camera
from benchmarks.suites.lenses.pictures import Conditions, take_pictures
from cmpdesign import load, write_layout
from cmpdesign.files.images import read_image
from cmpdesign.products.laser.coupon.design import coupon_to_json, design_coupon
from cmpdesign.products.laser.grid.design import design_grid
from cmpdesign.products.laser.setup import complete_setup
from tests.support.command import run
from tests.support.laser_tools import coupon_photo
from tests.support.layouts import small_text
from tests.support.made.datasets import make_serially, write_plan
from tests.support.made.rest_pictures import nominal_layout, write_rest_images
from tests.support.tracking.press import write_press
from tests.support.tracking.scenes import LAYERS, moving

FRAMES = 3
ELASTOMER = "[elastomer]\nthickness_mm = 4\npoisson = 0.5\nmarker_depth_mm = 0.5\n"
MASSES_G = (20.0, 50.0, 100.0)
SHEET_PICTURES = 5


def prepare_files(folder: Path, command: str) -> Path:
    """Write what the examples of a command name; each command has its own pattern under "layout.json"."""
    folder.mkdir()
    if command == "init":
        (folder / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
        (folder / "camera.toml").write_text(_view_text((900.0, 900.0), (639.5, 479.5), ()), encoding="utf-8")
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
            _write_sheet(folder / "sheet")
            (folder / "sensor.toml").write_text(ELASTOMER, encoding="utf-8")
            _write_weighed(folder)
        case "kerf":
            _write_coupon(folder)
            _write_grid(folder)
        case "dataset":
            make_serially(write_plan(folder, frames=2), folder / "published")
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


def _write_weighed(folder: Path) -> None:
    """A run with the columns that ``reconstruct --contact`` adds, each of its frames under a known mass."""
    (folder / "moving").mkdir()
    _write_moving(folder / "moving")
    words = ("track", folder / "moving" / "layout.json", folder / "moving" / "frames")
    assert run(*words, "-o", folder / "moving" / "run.npz").exit_code == 0
    with np.load(folder / "moving" / "run.npz") as table:
        columns = dict(table)
    force_n = np.zeros((FRAMES, 3))
    force_n[:, 2] = -9.81e-3 * np.array(MASSES_G)
    variance_n2 = np.full((FRAMES, 6), 1e-4)
    reason = np.zeros(FRAMES, np.uint8)
    contact = {"force_n": force_n, "force_cov_n2": variance_n2, "contact_reason": reason, "young_mpa": 0.3}
    contact |= {"torque_nmm": 0 * force_n, "torque_cov_nmm2": variance_n2, "utilisation": np.zeros(FRAMES)}
    contact |= {"marker_traction_mpa": np.zeros((FRAMES, columns["xy_px"].shape[1], 3), np.float32)}
    np.savez(folder / "run.npz", **columns, **contact)
    rows = "".join(f"{frame},{mass:g}\n" for frame, mass in enumerate(MASSES_G))
    (folder / "weights.csv").write_text("frame,mass_g\n" + rows, encoding="utf-8")


def _write_video(path: Path, images: Sequence[NDArray[Any]]) -> None:
    codec = "mp4v" if path.suffix == ".mp4" else "FFV1"
    height, width = images[0].shape[:2]
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 25, (width, height))
    assert video.isOpened()
    for image in images:
        video.write(image)
    video.release()


def _write_sheet(folder: Path) -> None:
    """Pictures of a printed sheet, enough for a calibration, by one camera."""
    rng = np.random.default_rng(46)
    folder.mkdir()
    camera = random_camera(rng, 60, 61)
    pictures = take_pictures(camera, nominal_layout(), SHEET_PICTURES, Conditions(), rng)
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    # the same camera's rig, with the sheet as the pad
    cv2.imwrite(str(folder.parent / "pad.png"), pictures[0])
    true = camera.pinhole
    text = _view_text(true.focal_px, true.centre_px, true.distortion)
    (folder.parent / "measured.toml").write_text('layout = "layout.json"\n' + text, encoding="utf-8")
    files = [folder.parent / name for name in ("layout.json", "measured.toml", "pad.png")]
    assert run("calibrate", "rig", *files, "-o", folder.parent / "index.toml").exit_code == 0


def _view_text(focal_px: Sequence[float], centre_px: Sequence[float], distortion: Sequence[float]) -> str:
    return (
        f'size_px = [1280, 960]\n\n[[view]]\nname = "camera"\nfocal_px = {[*map(float, focal_px)]}\n'
        f"centre_px = {[*map(float, centre_px)]}\ndistortion = {[*map(float, distortion or [0.0] * 5)]}\n"
    )


def _write_coupon(folder: Path) -> None:
    piece = design_coupon(complete_setup(load("honeycomb").laser))
    photo = coupon_photo(piece, {patch.name: (0.1, 0.12) for patch in piece.patches}, scale_px_mm=11.8)
    (folder / "coupon.json").write_text(coupon_to_json(piece), encoding="utf-8")
    cv2.imwrite(str(folder / "scan.png"), photo)


def _write_grid(folder: Path) -> None:
    """A grid of settings, and its photo: the windows of the slower half of the fields fell out."""
    grid = design_grid(complete_setup(load("honeycomb").laser))
    middle = np.median([patch.speed_mm_s for patch in grid.patches])
    cut = [patch for patch in grid.patches if patch.speed_mm_s <= middle]
    photo = coupon_photo(replace(grid, patches=tuple(cut)), {patch.name: (0.15, 0.15) for patch in cut})
    (folder / "grid.json").write_text(coupon_to_json(grid), encoding="utf-8")
    cv2.imwrite(str(folder / "photo.jpg"), photo)
