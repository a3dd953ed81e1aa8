"""The files of a sensor with two views under a ball that is pressed and sheared, made by the project's own commands."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

SIZE, FRAMES, FPS, LAYERS = (640, 480), 30, 30, 10
FIELD_OF_VIEW_DEG = 28.0
_MEDIUM = "[medium]\ngel_mm = 4.0\ngel_index = 1.41\nwindow_mm = 2.0\nwindow_index = 1.49\n"
_ELASTOMER = "thickness_mm = 5.0\nyoung_mpa = 0.2\nmarker_depth_mm = 1.0\n"
_CONTACT = f"""
[optics]
blur_px = 0.8
[sensor]
noise = 1.5
[contact]
size_mm = [34, 30]
grid = 64
[contact.elastomer]
{_ELASTOMER}
[contact.indenter]
kind = "ball"
radius_mm = 8.0
[contact.motion]
press_mm = 0.0
shear_mm = [0.0, 0.0]
[sequence.values]
contact.motion.press_mm = [[0.0, 0.0], [0.7, 0.4]]
contact.motion.shear_mm = [[0.5, [0, 0]], [1.0, [0.3, 0]]]
"""


def write_touched_sensor(folder: Path, frames: int = FRAMES, layers: int = LAYERS) -> list[str]:
    """Write layout, rig, gel and the frames of a press; returns the words of ``view`` but for its source.

    The frames are ``frames/*.png`` of 640 x 480 px, a view in each half, over a second.
    """
    width, height = SIZE[0] // 2, SIZE[1]
    focal_px = 0.5 * width / math.tan(math.radians(0.5 * FIELD_OF_VIEW_DEG))
    sequence = f"[sequence]\nframes = {frames}\nfps = {frames}\n"
    scene, rig = f"size_px = [{SIZE[0]}, {SIZE[1]}]\nseed = 1\n", ""
    for name, left, azimuth_deg in (("left", 0, 180), ("right", width, 0)):
        view = f'[[view]]\nname = "{name}"\narea_px = [{left}, 0, {width}, {height}]\n'
        scene += f"{view}distance_mm = 56\nfield_of_view_deg = {FIELD_OF_VIEW_DEG}\ntilt_deg = 18\n"
        scene += f"azimuth_deg = {azimuth_deg}\nback = true\n"
        centre_px = [left + 0.5 * width - 0.5, 0.5 * height - 0.5]
        rig += f"{view}focal_px = [{focal_px}, {focal_px}]\ncentre_px = {centre_px}\n"
    (folder / "press.toml").write_text(f"{scene}{_MEDIUM}{sequence}{_CONTACT}", encoding="utf-8")
    (folder / "sensor.toml").write_text(f"{rig}{_MEDIUM}[elastomer]\n{_ELASTOMER}", encoding="utf-8")
    for words in (
        f"build tac3d --set layers={layers} -o pad --only layout",
        "render pad/layout.json --scene press.toml -o frames",
        "calibrate gel pad/layout.json sensor.toml -o gel.npz",
    ):
        command = [sys.executable, "-m", "cmpdesign", *words.split()]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    rest = min((folder / "frames").glob("*.png"))
    files = {"--rig": folder / "sensor.toml", "--contact": folder / "gel.npz", "--rest": rest}
    return [str(folder / "pad/layout.json"), *(str(word) for pair in files.items() for word in pair)]
