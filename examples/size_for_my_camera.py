"""Pitch and layers for a camera and its field of view, with error and resolution.

    python examples/size_for_my_camera.py [1280x960 24x18mm]

The example needs SciPy: pip install '.[evaluate]'.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cmpdesign


def main(camera: str = "1280x960", view: str = "24x18mm") -> None:
    if Path("sized").exists():
        sys.exit("the folder sized exists: rename or remove it, so that no file is overwritten")
    finest = cmpdesign.size(camera, view)
    for name, text in finest.figures().items():
        print(f"{name:18s}{text}")
    print("\nallowed error    layers  pitch mm  told apart mm")
    for factor in (0.8, 0.6):
        coarser = cmpdesign.size(camera, view, factor * finest.error_um / 1000)
        design = coarser.design
        print(
            f"{factor * finest.error_um:10.4f} um  {design.layers:8d}  {design.pitch_mm:8.3f}"
            f"  {coarser.told_apart_mm:13.3f}"
        )
    finest.design.write("sized")
    print("\nwrote the finest design to sized/")


if __name__ == "__main__":
    main(*sys.argv[1:3])
