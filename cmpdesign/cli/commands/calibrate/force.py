"""``cmpdesign calibrate force``: Young's modulus of one sensor from known weights."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api.force import calibrate_force
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_warning, say

if TYPE_CHECKING:
    from cmpdesign.documents.reading import CalibrateForceDocument

EXAMPLES = (
    "cmpdesign calibrate force run.npz weights.csv",
    "cmpdesign calibrate force run.npz weights.csv --json",
)
LARGEST_RESIDUAL_Z = 2.0


@derived(calibrate_force, "reading the run")
def force(found: CalibrateForceDocument) -> None:
    """Thickness and marker depth are not fitted: an error of them is part of the modulus."""
    say(f"young_mpa = {found.young_mpa:.4g}")
    say(f"young_sigma_mpa = {found.young_sigma_mpa:.2g}")
    say(f"force at rest {found.bias_n:+.3f} N, deviation {found.bias_sigma_n:.3f} N")
    say(f"{found.weights} weights, residuals {found.residual_z:.2f} stated deviations")
    if found.residual_z > LARGEST_RESIDUAL_Z:
        print_warning(
            f"the weights differ from a line by {found.residual_z:.1f} stated deviations, limit "
            f"{LARGEST_RESIDUAL_Z:g}; check masses, frames, thickness and marker depth"
        )
