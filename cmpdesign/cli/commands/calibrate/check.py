"""``cmpdesign calibrate check``: whether a sensor still is as its file says, by its pad at rest."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.options.images import MaxPixelsOption
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, say
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.calibration.rig.check import SensorCheck

EXAMPLES = (
    "cmpdesign calibrate check index.toml pad.png",
    "cmpdesign calibrate check index.toml pad.png --json",
)
EXIT_CHANGED = 1


def check(
    sensor: Annotated[
        Path,
        typer.Argument(metavar="SENSOR", help="Sensor file that `calibrate rig` wrote; names its layout."),
    ],
    pictures: Annotated[
        list[str],
        typer.Argument(
            metavar="REST", help="Pictures of the pad at rest; of several cameras one each, joined by commas."
        ),
    ],
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Check a sensor's calibration by its pad at rest. If it does not hold, the cause and the step to repeat are named.

    Exit code 1: the calibration does not hold.
    """
    from cmpdesign.api.calibration import calibrate_check
    from cmpdesign.watch import watched

    with working("reading pictures") as steps, watched(steps.tell):
        found = calibrate_check(sensor, pictures, max_pixels=max_pixels)
    print_step("the pictures are read")
    _print_figures(found, pictures)
    finish(lambda: _document(found, pictures), 0 if found.holds else EXIT_CHANGED)


def _print_figures(found: SensorCheck, names: list[str]) -> None:
    from rich.table import Table

    for view, rms_px in found.rms_px.items():
        stated_px = found.stated_px.get(view)
        then = "" if stated_px is None else f", {stated_px:.4f} px at the calibration"
        say(f"residuals at rest: {view} {rms_px:.4f} px per axis{then}")
    limit = _limit_text(found)
    say(f"residuals over those of the calibration: {found.misfit:.2f}{limit}")
    if len(names) > 1:
        worst = max(range(len(names)), key=lambda number: found.picture_misfits[number])
        say(f"largest of one picture: {found.picture_misfits[worst]:.2f}, {names[worst]}")
    if found.holds:
        say("the calibration holds")
        return
    table = Table(box=None, pad_edge=False)
    table.add_column("cause")
    table.add_column("leaves", justify="right")
    for one in found.causes:
        table.add_row(one.cause, f"{one.left:.2f}")
    say(table)
    print_warning(f"the calibration does not hold; likely cause: {'; or '.join(found.likely)}")
    for one in found.causes:
        if one.cause in found.likely:
            say(", ".join(f"{name} {value:+.4g}" for name, value in one.changes.items()))
    if isfinite(found.depth_error):
        say(f"by the likeliest cause, depths are read wrong by {found.depth_error:+.2%}")
    for step in found.steps:
        say(f"do: {step}")


def _limit_text(found: SensorCheck) -> str:
    from cmpdesign.calibration.rig.check import MAX_MISFIT

    if found.limit_px is not None:
        return f"; limit of [limits]: {found.limit_px:g} px"
    return f", limit {MAX_MISFIT:g}"


def _document(found: SensorCheck, names: list[str]) -> Any:
    from cmpdesign.documents.calibration import CalibrateCheckDocument, CausePart

    causes = [
        CausePart(
            cause=one.cause,
            left=one.left,
            changes=dict(one.changes),
            likely=one.cause in found.likely,
        )
        for one in found.causes
    ]
    return CalibrateCheckDocument(
        holds=found.holds,
        misfit=found.misfit,
        picture_misfits=dict(zip(names, found.picture_misfits, strict=True)),
        rms_px=dict(found.rms_px),
        stated_px=dict(found.stated_px),
        limit_px=found.limit_px,
        causes=tuple(causes),
        steps=found.steps,
        depth_error=found.depth_error if isfinite(found.depth_error) else None,
    )
