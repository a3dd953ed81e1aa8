"""``cmpdesign calibrate check``: whether a sensor still is as its file says, by its pad at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cmpdesign.api.calibration import calibrate_check
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_step, print_warning, say, say_columns

if TYPE_CHECKING:
    from cmpdesign.documents.calibration import CalibrateCheckDocument, ForceScalePart

EXAMPLES = (
    "cmpdesign calibrate check index.toml pad.png",
    "cmpdesign calibrate check index.toml pad.png --json",
)
EXIT_CHANGED = 1


@derived(calibrate_check, "reading pictures", layout=None)
def check(done: CalibrateCheckDocument) -> int:
    """Exit code 1: the calibration does not hold."""
    print_step("the pictures are read")
    _print_state(done)
    _print_figures(done)
    return 0 if done.holds else EXIT_CHANGED


def _print_state(found: CalibrateCheckDocument) -> None:
    for name, camera in found.cameras.items():
        told = {key: value for key, value in camera.settings.items() if value is not None}
        say(f"{name} answers: {', '.join(f'{key} {_shown(value)}' for key, value in told.items())}")
        for note in camera.notes:
            print_warning(f"{name}: {note}")
    for name, view in found.views.items():
        say(
            f"light: {name} evenness {_shown(view.evenness)}, overexposed {_shown(view.clipping, '.1%')}, contrast "
            f"{_shown(view.contrast, '.0f')}"
        )
        say(f"focus: {name} blur {_shown(view.blur_px, '.2f')} px")
        say(f"markers read: {name} {view.share_read:.1%}")
        for hint in view.hints:
            print_warning(f"{name}: {hint}")
    say(f"force: {_force_text(found.force)}")
    ages = [
        f"{name} without a date" if days is None else f"{name} {days} days ago"
        for name, days in found.ages_days.items()
    ]
    say(f"calibrations: {', '.join(ages) or 'none'}")


def _shown(value: Any, form: str = ".2f") -> str:
    if value is None:
        return "unknown"
    if isinstance(value, tuple):
        return "x".join(map(str, value))
    return f"{value:{form}}" if isinstance(value, float) else str(value)


def _force_text(force: ForceScalePart | None) -> str:
    if force is None or force.young_mpa is None:
        return "no Young's modulus in [elastomer], so that there are no forces: cmpdesign calibrate force"
    gel = "without a gel: cmpdesign calibrate gel" if force.gel is None else f"gel {force.gel}, of this pad"
    return f"Young's modulus {force.young_mpa:.3g} +- {force.young_sigma_mpa:.2g} MPa, {gel}"


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
