"""Read one picture: places of the markers, their deviations, and the remedy for a failure.

    python examples/read_one_picture.py [layout.json picture.png]

Without arguments a picture is drawn first, into the new folder "example".
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

import cmpdesign
from extractor import Extractor


def main(layout: str = "", picture: str = "") -> None:
    if not picture:
        design = cmpdesign.load("tac3d")
        if Path("example").exists():
            sys.exit("the folder example exists: rename or remove it, so that no file is overwritten")
        design.layout.write(layout := "example/layout.json")
        picture = "example/seen.png"
        cmpdesign.render(design.layout, pitch_px=22, rotation_deg=12, noise=2).save(picture)
    image = cv2.imread(picture)
    if image is None:
        sys.exit(f"{picture} is no picture that OpenCV reads")
    markers = Extractor(layout).extract(image)
    if markers.reason is not None:
        sys.exit(f"{picture}: not read: {markers.reason}")
    found = markers.status > 0
    print(f"{found.sum()} of {len(found)} markers, {(markers.status == 1).sum()} of them measured")
    for marker in range(0, len(found), 60):
        (x, y), error_px = markers.xy_px[marker], markers.cov_px2[marker].trace() ** 0.5
        print(f"marker {marker:3d} at ({x:7.2f}, {y:7.2f}) px, error {error_px:.3f} px")


if __name__ == "__main__":
    main(*sys.argv[1:3])
