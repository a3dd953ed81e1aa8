"""Follow the markers through a video, frame by frame, as in a program on a robot.

    python examples/follow_a_video.py [layout.json video.mp4]

The source may also be a folder of pictures, or a camera's number. Without arguments five pictures are drawn
first, into the new folder "example".
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import cmpdesign
from extractor import Tracker


def draw_press(folder: str) -> str:
    """Draw a pattern that is pressed deeper in every picture; return its layout file."""
    if Path(folder).parent.exists():
        sys.exit("the folder example exists: rename or remove it, so that no file is overwritten")
    layout = cmpdesign.load("honeycomb", layers=5).layout
    for number in range(5):
        seen = cmpdesign.render(layout, pitch_px=30, press_mm=0.1 * number, noise=2, seed=number)
        seen.save(f"{folder}/{number}.png")
    layout.write("example/layout.json")
    return "example/layout.json"


def main(layout: str = "", source: str = "example/frames") -> None:
    tracker = Tracker(layout or draw_press(source))  # the first picture that is read is at rest
    for frame in cmpdesign.open_source(source, fps=30).frames():
        tracked = tracker.track(frame.image, time_s=frame.time_s, reason=frame.problem)
        moved_mm = np.linalg.norm(tracked.displacement_mm, axis=1)  # NaN where a marker is lost
        if np.isfinite(moved_mm).any():
            farthest = int(np.nanargmax(moved_mm))
            print(f"{frame.time_s:6.3f} s: marker {farthest} moved farthest, {moved_mm[farthest]:.3f} mm")
        else:
            print(f"{frame.time_s:6.3f} s: not read: {tracked.markers.reason}")


if __name__ == "__main__":
    main(*sys.argv[1:3])
