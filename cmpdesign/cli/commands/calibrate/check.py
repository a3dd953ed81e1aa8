"""``cmpdesign calibrate check``: whether a sensor still is as its file says, by its pad at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api.calibration import calibrate_check
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_step, print_warning, say, say_columns

if TYPE_CHECKING:
    from cmpdesign.documents.calibration import CalibrateCheckDocument

EXAMPLES = (
    "cmpdesign calibrate check index.toml pad.png",
    "cmpdesign calibrate check index.toml pad.png --json",
)
EXIT_CHANGED = 1


@derived(calibrate_check, "reading pictures", layout=None)
def check(done: CalibrateCheckDocument) -> int:
    """Exit code 1: the calibration does not hold."""
    print_step("the pictures are read")
    _print_figures(done)
    return 0 if done.holds else EXIT_CHANGED


def _print_figures(found: CalibrateCheckDocument) -> None:
    for view, rms_px in found.rms_px.items():
        stated_px = found.stated_px.get(view)
        then = "" if stated_px is None else f", {stated_px:.4f} px at the calibration"
        say(f"residuals at rest: {view} {rms_px:.4f} px per axis{then}")
    limit = _limit_text(found)
    say(f"residuals over those of the calibration: {found.misfit:.2f}{limit}")
    if len(found.picture_misfits) > 1:
        worst, misfit = max(found.picture_misfits.items(), key=lambda each: each[1])
        say(f"largest of one picture: {misfit:.2f}, {worst}")
    if found.holds:
        say("the calibration holds")
        return
    say_columns(("cause", ">leaves"), [(one.cause, f"{one.left:.2f}") for one in found.causes])
    print_warning(f"the calibration does not hold; likely cause: {'; or '.join(found.found.likely)}")
    for one in found.causes:
        if one.likely:
            say(", ".join(f"{name} {value:+.4g}" for name, value in one.changes.items()))
    if found.depth_error is not None:
        say(f"by the likeliest cause, depths are read wrong by {found.depth_error:+.2%}")
    for step in found.steps:
        say(f"do: {step}")


def _limit_text(found: CalibrateCheckDocument) -> str:
    from cmpdesign.calibration.rig.check import MAX_MISFIT

    if found.limit_px is not None:
        return f"; limit of [limits]: {found.limit_px:g} px"
    return f", limit {MAX_MISFIT:g}"
