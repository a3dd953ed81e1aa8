"""Track a press into a table, and plot the table: displacement over time, and the arrows of all markers at the end.

    python examples/plot_a_recording.py [layout.json video.mp4]

It needs matplotlib: pip install '.[evaluate]'. Without arguments a ball is pressed first. All files go into "plotted".
"""

from __future__ import annotations

import sys
from pathlib import Path

import cmpdesign
from extractor import ExtractorError

PRESS = """
size_px = [400, 360]
camera.pitch_px = 24
contact.elastomer = { thickness_mm = 3.0, young_mpa = 0.2 }
contact.indenter = { kind = "ball", radius_mm = 4.0 }
contact.motion = { press_mm = 0.0 }
sequence = { frames = 6, fps = 10, values.contact.motion.press_mm = [[0.0, 0.0], [0.5, 0.5]] }
"""


def main(layout: str = "", source: str = "") -> None:
    if (made := Path("plotted")).exists():
        sys.exit("the folder plotted exists: rename or remove it, so that no file is overwritten")
    made.mkdir()
    try:
        if not source:
            cmpdesign.load("honeycomb", layers=6).layout.write(layout := f"{made}/layout.json")
            (made / "press.toml").write_text(PRESS, encoding="utf-8")
            cmpdesign.render(layout, made / "press.toml", source := f"{made}/frames")
        cmpdesign.track(layout, source, made / "run.npz", rest=0, fps=10)
        run = cmpdesign.load_run(made / "run.npz")
        cmpdesign.plot_history(run).figure.savefig(made / "history.png")
        cmpdesign.plot_displacement(run, magnified=20).figure.savefig(made / "displacement.png")
    except (cmpdesign.CmpDesignError, ExtractorError) as error:
        sys.exit(f"error: {error}")
    print(f"{len(run)} frames: {made}/history.png, {made}/displacement.png")


if __name__ == "__main__":
    main(*sys.argv[1:3])
