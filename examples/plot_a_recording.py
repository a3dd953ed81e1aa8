"""Track a press into a table, and plot the table: displacement over time, and the arrows of all markers at the end.

    python examples/plot_a_recording.py [layout.json video.mp4]

The example needs matplotlib: pip install '.[evaluate]'. Without arguments a ball is pressed into a simulated pad first.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cmpdesign

PRESS = """
size_px = [400, 360]
camera.pitch_px = 24.0
sensor.noise = 2.0
contact.elastomer = { thickness_mm = 3.0, young_mpa = 0.2 }
contact.indenter = { kind = "ball", radius_mm = 4.0 }
contact.motion = { press_mm = 0.0 }
sequence = { frames = 6, fps = 10, values.contact.motion.press_mm = [[0.0, 0.0], [0.5, 0.5]] }
"""


def main(layout: str = "layout.json", source: str = "") -> None:
    if not source:
        cmpdesign.load("honeycomb", layers=6).layout.write(layout)
        Path("press.toml").write_text(PRESS, encoding="utf-8")
        cmpdesign.render_sequence(layout, "press.toml", source := "frames")
    cmpdesign.track(layout, source, "run.npz", rest=0, fps=10)
    run = cmpdesign.load_run("run.npz")
    cmpdesign.plot_history(run).figure.savefig("history.png")
    cmpdesign.plot_displacement(run, magnified=20).figure.savefig("displacement.png")
    print(f"{len(run)} frames: history.png, displacement.png")


if __name__ == "__main__":
    main(*sys.argv[1:3])
