"""Depth through a window and a gel: with true constants, with wrong constants, and with air assumed.

Every rig is drawn at random: two views behind the pattern, 25 to 60 mm away and 15 to 22 degrees to either side, 2 to 5
mm of gel, a window of 2 to 3 mm of acrylic or glass. The pattern fills the same share of the image in all of them. A
ball is pressed in by 0.3 to 1 mm and sheared by up to 0.2 mm. Images are rendered through the medium and read; poses
come from a separate rest frame, so that a wrong constant acts on both. Depth errors are those of the displacement
along z, over the markers that move by more than half of the press. "mean error" is the mean of their absolute values,
"bias" their absolute mean, both per frame; "short" is the share by which the measured displacement is too small, by
least squares; z is the RMS of the errors of positions and of displacements over their covariances. A wrong constant is
taken with both signs. The window that is tilted by 1 degree is tilted in the images, and parallel to the pattern for
the reader.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.pooled import Columns, Figure, grouped, joined, mean, percentile, pooled_table
from benchmarks.suites.medium.errors import ROWS, TRUE, DepthErrors, measure_rig
from benchmarks.suites.medium.rigs import PRESSES_MM, random_rig

RIGS, QUICK_RIGS = 24, 2


def z_of(name: str) -> Figure:
    """The RMS of errors over covariances, all markers together."""
    return lambda frames: float(np.sqrt(joined(frames, name).mean()))


def short_range(frames: Sequence[DepthErrors]) -> tuple[float, float]:
    """The smallest and the largest share by which displacements are too small."""
    short = [each.short_percent for each in frames]
    return min(short), max(short)


DEPTHS: Columns = {"mean error um": (".2f", mean("mean_um")), "bias um": (".2f", mean("bias_um"))}
Z: Columns = {"z position": (".2f", z_of("position")), "z displacement": (".2f", z_of("displacement"))}
TRUE_COLUMNS: Columns = {"frames": ("d", len), **DEPTHS, "limit um": (".2f", mean("limit_um")), **Z}
WRONG_COLUMNS: Columns = {
    **DEPTHS,
    "short %": (".2f", mean("short_percent")),
    "least, most": (".2f", short_range),
    **Z,
    "misfit at rest": (".2f", percentile("misfit", 50)),
    "warned %": (".0f", mean("warned_percent")),
}


def measure(quick: bool = False, seed: int = 0) -> Shown:
    """Errors with the true constants by press, then by assumption.

    Args:
        quick: few rigs.
        seed: of the first rig.
    """
    errors: list[DepthErrors] = []
    for number in range(QUICK_RIGS if quick else RIGS):
        rng = np.random.default_rng([seed, number])
        errors += measure_rig(random_rig(rng), rng)
    true = [each for each in errors if each.row == TRUE]
    by_press = {
        f"{low:g} to {high:g} mm": [each for each in true if low <= each.press_mm <= high]
        for low, high in PRESSES_MM
    }
    yield pooled_table("with the true constants", "press", TRUE_COLUMNS, {**by_press, "all": true})
    by_row = grouped(errors, "row")
    yield pooled_table(
        "what the reader assumes", "assumption", WRONG_COLUMNS, {row: by_row[row] for row in ROWS}
    )


main = Experiment("medium", measure)
main.run_as(__name__)
