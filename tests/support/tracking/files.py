"""Files that ``cmpdesign track`` reads and writes: a moving pattern as a video and as images, and its tables."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np

from tests.support.command import run
from tests.support.layouts import small_text
from tests.support.tracking.scenes import LAYERS, SIZE, moving

FRAMES = 24
MARKERS = 91


def write_moving_pattern(folder: Path) -> Path:
    """Write a layout, a lossless video of a moving pattern, the same frames as PNG files, and the truth."""
    (folder / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    (folder / "frames").mkdir()
    video = cv2.VideoWriter(str(folder / "video.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 25, SIZE)
    assert video.isOpened()
    truth = []
    for index, rendered in enumerate(moving(FRAMES)):
        video.write(rendered.image)
        cv2.imwrite(str(folder / "frames" / f"frame{index}.png"), rendered.image)
        truth.append(rendered.truth.marker_xy_px)
    video.release()
    np.save(folder / "truth.npy", truth)
    return folder


def tracked(made: Path, source: str, output: Path, *options: object, code: int = 0) -> dict[str, np.ndarray]:
    result = run("track", made / "layout.json", made / source, "-o", output, *options)
    assert result.exit_code == code, result.output
    return loaded(output)


def loaded(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
