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

import numpy as np

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.medium.errors import ROWS, TRUE, DepthErrors, measure_rig, pool
from benchmarks.suites.medium.rigs import PRESSES_MM, random_rig

RIGS, QUICK_RIGS = 24, 2
TRUE_COLUMNS = {
    "press": TEXT, "frames": "d", "mean error um": ".2f", "limit um": ".2f", "bias um": ".2f", "z position": ".2f",
    "z displacement": ".2f",
}  # fmt: skip
WRONG_COLUMNS = {
    "assumption": TEXT, "mean error um": ".2f", "bias um": ".2f", "short %": ".2f", "least, most": ".2f",
    "z position": ".2f", "z displacement": ".2f", "misfit at rest": ".2f", "warned %": ".0f",
}  # fmt: skip


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
    by_press = [
        pool(f"{low:g} to {high:g} mm", [each for each in true if low <= each.press_mm <= high])
        for low, high in PRESSES_MM
    ]
    yield Table(
        "with the true constants",
        TRUE_COLUMNS,
        [
            (p.label, p.frames, p.mean_um, p.limit_um, p.bias_um, p.z_position, p.z_displacement)
            for p in (*by_press, pool("all", true))
        ],
    )
    by_row = [pool(row, [each for each in errors if each.row == row]) for row in ROWS]
    yield Table(
        "what the reader assumes",
        WRONG_COLUMNS,
        [
            (p.label, p.mean_um, p.bias_um, p.short_percent, p.short_range_percent, p.z_position,
             p.z_displacement, p.misfit, p.warned_percent)
            for p in by_row
        ],
    )  # fmt: skip


main = Experiment("medium", measure)

if __name__ == "__main__":
    raise SystemExit(main())
