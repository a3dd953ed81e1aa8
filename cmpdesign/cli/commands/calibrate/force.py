"""``cmpdesign calibrate force``: Young's modulus of one sensor from known weights."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_warning, say

EXAMPLES = (
    "cmpdesign calibrate force run.npz weights.csv",
    "cmpdesign calibrate force run.npz weights.csv --json",
)
LARGEST_RESIDUAL_Z = 2.0


def force(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="The .npz file of `reconstruct --contact`.")],
    weights: Annotated[
        Path,
        typer.Argument(
            metavar="WEIGHTS", help="CSV file, columns frame and mass_g: 3 or more different weights."
        ),
    ],
) -> None:
    """Fit Young's modulus and the force at rest to known weights, best on a ball.

    Thickness and marker depth are not fitted: an error of them is part of the modulus.
    """
    from cmpdesign.api.force import calibrate_force
    from cmpdesign.documents.reading import CalibrateForceDocument

    with working("reading the run"):
        found = calibrate_force(run, weights)
    say(f"young_mpa = {found.young_mpa:.4g}")
    say(f"young_sigma_mpa = {found.young_sigma_mpa:.2g}")
    say(f"force at rest {found.bias_n:+.3f} N, deviation {found.bias_sigma_n:.3f} N")
    say(f"{found.weights} weights, residuals {found.residual_z:.2f} stated deviations")
    if found.residual_z > LARGEST_RESIDUAL_Z:
        print_warning(
            f"the weights differ from a line by {found.residual_z:.1f} stated deviations, limit "
            f"{LARGEST_RESIDUAL_Z:g}; check masses, frames, thickness and marker depth"
        )
    finish(lambda: CalibrateForceDocument(**asdict(found)))
