"""``cmpdesign calibrate rig``: poses, mirrors, window and gel of one sensor from its pad at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api.calibration import calibrate_rig
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_step, print_warning, printable_path, say, say_columns

if TYPE_CHECKING:
    from cmpdesign.documents.calibration import CalibrateRigDocument

EXAMPLES = (
    "cmpdesign calibrate rig layout.json measured.toml pad.png -o thumb.toml",
    "cmpdesign calibrate rig layout.json measured.toml pad.png -o thumb.toml --json",
)
LARGEST_SCALE = 3.0  # residuals over their stated deviations, as of a rest frame of reconstruct
LARGEST_MIRROR_SHIFT_MM = 0.2


@derived(calibrate_rig, "reading pictures")
def rig(done: CalibrateRigDocument) -> None:
    """The written file holds all of RIG, and is a RIG itself: its deviations reach all displacements of reconstruct."""
    print_step("the pictures are read, the rig is fitted")
    _print_figures(done)
    say(f"wrote {printable_path(done.written)}")


def _print_figures(found: CalibrateRigDocument) -> None:
    rows = []
    for name, value in found.parameters.items():
        shown = f"{value:.5g}" if abs(value) < 10 else f"{value:.3f}"
        rows.append((name, shown, f"{found.stated[name]:.2g}", f"{found.deviations[name]:.2g}"))
    say_columns(("", ">value", ">+- before", ">+- after"), rows)
    residuals = ", ".join(f"{name} {rms:.4f} px" for name, rms in found.rms_px.items())
    say(f"residuals at rest: {residuals} per axis, {found.scale:.2f} stated deviations")
    for pair in found.mirrors:
        say(
            f"mirrors of {pair.views[0]} and {pair.views[1]}: {pair.angle_deg:.3f} degrees between them, "
            f"{pair.distances_mm[0]:.2f} and {pair.distances_mm[1]:.2f} mm from the camera"
        )
        if abs(pair.shift_mm) > LARGEST_MIRROR_SHIFT_MM:
            print_warning(
                f"views {pair.views[0]} and {pair.views[1]} are shifted by {pair.shift_mm:.2f} mm along the line of "
                f"their mirrors, limit {LARGEST_MIRROR_SHIFT_MM:g} mm: plane mirrors do not do this; check the lens, "
                "and that the views share one camera"
            )
    say(
        f"depth of a press: +- {found.depth_share:.2%}, the same error in all frames, by what is not determined"
    )
    if found.held:
        say(f"not determined by the pictures, held as stated: {', '.join(found.held)}")
    if found.scale > LARGEST_SCALE:
        print_warning(
            f"the markers at rest lie {found.scale:.1f} deviations from their places, limit {LARGEST_SCALE:g}; "
            "deviations are enlarged by this factor; check the layout, the lens and [medium]"
        )
