"""Files that ``cmpdesign reconstruct`` reads: the two views of a press, in one image and in one image each."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from cmpdesign import layout_to_json
from cmpdesign.design.design import load_design
from cmpdesign.layout.build import build_layout
from tests.support.view_scenes import HALF, SMALL, binocular, binocular_shot, contact, rig_of, rig_text

FRAMES = 4


def seen_from_the_back() -> str:
    """The layout file of the views' pattern, whose back is in view."""
    options = {"layers": str(SMALL), "pitch_mm": "1.5", "mirrored": "true"}
    return layout_to_json(build_layout(load_design("honeycomb", options)))


def write_press(folder: Path) -> Path:
    """Write a layout, a rig, the frames of a press as PNG files (frame 2 has lost its right half), and the truth."""
    (folder / "layout.json").write_text(seen_from_the_back(), encoding="utf-8")
    (folder / "rig.toml").write_text(rig_text(rig_of(binocular())), encoding="utf-8")
    truth = []
    for name in ("frames", "left", "right"):
        (folder / name).mkdir()
    for k in range(FRAMES):
        shot = binocular_shot(None if k == 0 else contact, 40 + k)
        image = shot.image.copy()
        if k == 2:
            image[:, HALF[0] :] = 0
        cv2.imwrite(str(folder / "frames" / f"{k}.png"), image)
        for name, part in (("left", image[:, : HALF[0]]), ("right", image[:, HALF[0] :])):
            cv2.imwrite(str(folder / name / f"{k}.png"), part)
        truth.append(np.concatenate([shot.truth.marker_xyz_mm, shot.truth.virtual_xyz_mm.reshape(-1, 3)]))
    np.save(folder / "truth.npy", truth)
    return folder
