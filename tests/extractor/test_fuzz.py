"""Pictures and layouts of every kind end in markers or in a reason, never in a fault of the process.

Each round runs in a process of its own, because a fault of the native loops would end the tests. On modules that check
every index (``make test-sanitized``), an index beyond its array is such a fault.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROUNDS = 14
CODE = """
import sys
import cv2
import numpy as np
from extractor import Extractor, parse_layout
from tests.support.layouts import small_text
from tests.support.pictures import picture

seed = int(sys.argv[1])
rng = np.random.default_rng(seed)


def shuffled(image, side):
    rows, columns = image.shape[0] // side, image.shape[1] // side
    cut = image[: rows * side, : columns * side].reshape(rows, side, columns, side, 3).swapaxes(1, 2)
    blocks = cut.reshape(-1, side, side, 3)[rng.permutation(rows * columns)]
    return blocks.reshape(rows, columns, side, side, 3).swapaxes(1, 2).reshape(rows * side, columns * side, 3)


def painted(image):
    out = image.copy()
    for _ in range(rng.integers(1, 40)):
        points = rng.uniform(-20, 380, (rng.integers(3, 6), 2)).astype(np.int32)
        cv2.fillPoly(out, [points], [int(v) for v in rng.integers(0, 256, 3)])
    return out


def bent(image):
    y, x = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float32)
    waves = [rng.uniform(0, 18) * np.sin(x / rng.uniform(8, 90) + y / rng.uniform(8, 90)) for _ in range(2)]
    return cv2.remap(image, x + waves[0].astype(np.float32), y + waves[1].astype(np.float32), cv2.INTER_LINEAR)


def tiled(image):
    small = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.tile(small, (2, 2, 1))


def cropped(image):
    height, width = rng.integers(16, 90, 2)
    top, left = rng.integers(0, image.shape[0] - height), rng.integers(0, image.shape[1] - width)
    return image[top : top + height, left : left + width]


def noisy(image):
    return np.clip(image + rng.normal(0, rng.uniform(5, 90), image.shape), 0, 255).astype(np.uint8)


def bright(image):
    return np.clip(image * rng.uniform(0.02, 9.0, 3) + rng.uniform(0, 120), 0, 255).astype(np.uint8)


def few(image):
    return (image // 64 * 64).astype(np.uint8)


for _ in range(int(sys.argv[2])):
    pattern, layers = str(rng.choice(["honeycomb", "round", "elliptical"])), int(rng.integers(1, 6))
    shown = str(rng.choice(["honeycomb", "round"]))
    image = picture(shown, int(rng.integers(2, 5)), rotation_deg=float(rng.uniform(0, 360))).image
    for change in rng.choice([painted, bent, tiled, noisy, bright, few, cropped], rng.integers(1, 4), replace=False):
        image = change(image)
    if rng.random() < 0.3 and min(image.shape[:2]) > 40:
        image = shuffled(image, int(rng.integers(5, 40)))
    if rng.random() < 0.2:
        image = image.astype(np.uint16) * 257
    if rng.random() < 0.2:
        image = cv2.resize(image, (int(rng.integers(16, 400)), int(rng.integers(16, 24))))
    preset = str(rng.choice(["balanced", "accurate"]))
    markers = Extractor(parse_layout(small_text(pattern, layers)), preset, side="either").extract(image)
    assert np.isfinite(markers.xy_px).all(axis=1).sum() == (markers.status > 0).sum()
    assert (markers.status > 0).any() or markers.reason is not None
print("done")
"""


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_no_picture_ends_the_process(seed: int) -> None:
    command = [sys.executable, "-c", CODE, str(seed), str(ROUNDS)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=500, check=False)
    assert result.returncode == 0 and result.stdout == "done\n", (result.returncode, result.stderr[-2000:])
