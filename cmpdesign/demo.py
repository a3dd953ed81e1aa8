"""``make demo``: three commands from a design to a verified sample, and a comparison with the ground truth."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rich.table import Table

    from cmpdesign.scene import Truth
    from extractor.result import Markers

OUT = Path("out")
COMMANDS = (
    "build tac3d -o out",
    "render out/layout.json -o out/sample.png --truth out/truth.npz"
    " --pitch 22 --rotation 12 --tilt 15 --press 0.8 --noise 2",
    "verify out/layout.json out/sample.png -o out",
)
RUNS = 7


@dataclass(frozen=True)
class DemoScore:
    """Markers against the ground truth.

    Attributes:
        visible: number of markers that are visible in the image.
        measured, repaired, lost: numbers of visible markers by status.
        wrong: number of markers that are nearer to another marker's true place than to their own true place.
        rms_px: root mean square error of the measured markers, per axis.
        max_px: largest distance of a measured marker from its true place.
    """

    visible: int
    measured: int
    repaired: int
    lost: int
    wrong: int
    rms_px: float
    max_px: float


def score_markers(markers: Markers, truth: Truth) -> DemoScore:
    """Compare an extraction with the scene's truth."""
    from extractor.numeric.nearest_points import nearest_points

    status = markers.status
    found = np.flatnonzero(np.isfinite(markers.xy_px).all(axis=1))
    nearest = nearest_points(truth.marker_xy_px, markers.xy_px[found])[:, 0]
    measured = status == 1
    error = markers.xy_px[measured] - truth.marker_xy_px[measured]
    visible = status[truth.visible]
    return DemoScore(
        visible=len(visible),
        measured=int((visible == 1).sum()),
        repaired=int((visible >= 2).sum()),
        lost=int((visible == 0).sum()),
        wrong=int((nearest != found).sum()),
        rms_px=float(np.sqrt(np.mean(error**2))) if len(error) else float("nan"),
        max_px=float(np.hypot(*error.T).max()) if len(error) else float("nan"),
    )


def main() -> int:
    """Run the commands and print the table; the exit code of the first command that fails, or 0."""
    from cmpdesign.cli import app
    from cmpdesign.cli.terminal import console

    for command in COMMANDS:
        console().print(f"\n$ cmpdesign {command}", style="bold")
        code = app(command.split(), standalone_mode=False)
        if code:
            return int(code)
    console().print()
    console().print(_measure_table(), soft_wrap=False)
    return 0


def _measure_table() -> Table:
    """Extract the sample again, warm: the score against the truth, and the stages of the median run."""
    from cmpdesign.files.images import read_image
    from cmpdesign.scene import load_truth
    from extractor import Extractor, load_layout

    extractor, image = Extractor(load_layout(OUT / "layout.json")), read_image(OUT / "sample.png")
    runs = [extractor.extract(image) for _ in range(RUNS)]
    markers = sorted(runs, key=lambda run: sum(run.timings_ms.values()))[RUNS // 2]
    height, width = image.shape[:2]
    return _make_table(
        score_markers(markers, load_truth(OUT / "truth.npz")), markers, f"{width} x {height} px"
    )


def _make_table(score: DemoScore, markers: Markers, size: str) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, caption=f"{size}, one image; times: the median of {RUNS} warm runs")
    table.add_column("against the truth", min_width=20)
    table.add_column("", justify="right", min_width=10)
    table.add_column("stage", min_width=12)
    table.add_column("ms", justify="right", min_width=6)
    left = [
        ("visible", f"{score.visible}"),
        ("measured", f"{score.measured}"),
        ("repaired", f"{score.repaired}"),
        ("lost", f"{score.lost}"),
        ("wrong ids", f"{score.wrong}"),
        ("RMS error per axis", f"{score.rms_px:.4f} px"),
        ("largest error", f"{score.max_px:.4f} px"),
    ]
    times = markers.timings_ms
    right = [(name, f"{ms:.2f}") for name, ms in times.items()]
    right.append(("total", f"{sum(times.values()):.2f}"))
    rows = max(len(left), len(right))
    left += [("", "")] * (rows - len(left))
    right = right[:-1] + [("", "")] * (rows - len(right)) + right[-1:]
    for name_value, stage_ms in zip(left, right, strict=True):
        table.add_row(*name_value, *stage_ms)
    return table


if __name__ == "__main__":
    sys.exit(main())
