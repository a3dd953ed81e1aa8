"""``cmpdesign export lerobot``: runs as a LeRobotDataset v3.0."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.commands.export.options import ImagesOption, RunsArgument
from cmpdesign.cli.options.images import MaxPixelsOption
from cmpdesign.cli.progress import working
from cmpdesign.cli.run_progress import require_positive
from cmpdesign.cli.terminal import finish, print_warning, printable_path, say
from cmpdesign.inputs.files import MOST_PIXELS

EXAMPLES = (
    "cmpdesign export lerobot run1.npz run2.npz -o dataset",
    'cmpdesign export lerobot run1.npz -o dataset --task "press" --images frames',
)


def lerobot(
    runs: RunsArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Data set to write; a new folder.")
    ],
    task: Annotated[str, typer.Option(help="Task that the runs show, in words.")] = "contact",
    fps: Annotated[
        float | None, typer.Option(help="Frames per second. [default: from the runs' times]")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Type of the robot. [default: none]")] = None,
    images: ImagesOption = None,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Write a data set that LeRobot loads: displacement, position and status of every marker, and images if given."""
    from cmpdesign.documents.runs import ExportDocument
    from cmpdesign.tracking.export.lerobot import DataSet, write_lerobot
    from cmpdesign.tracking.export.runs import frames_per_second, require_one_kind, tidy_fps
    from cmpdesign.watch import watched

    require_positive("--fps", fps)
    require_one_kind(runs)
    rate = frames_per_second(runs) if fps is None else tidy_fps(fps)
    about = DataSet(rate, task, robot, tuple(images or ()), max_pixels)
    with working("exporting") as steps, watched(steps.tell):
        frames = write_lerobot(runs, output, about)
    _warn_of_uneven_times(runs, rate)
    say(
        f"wrote {printable_path(output)}: {len(runs)} episodes, {frames} frames at {rate:g} frames per second"
    )
    finish(
        lambda: ExportDocument(
            kind="lerobot", written=printable_path(output), episodes=len(runs), frames=frames, fps=rate
        )
    )


def _warn_of_uneven_times(runs: Sequence[Path], fps: float) -> None:
    """Warn of uneven times: LeRobot's frames have an even rate."""
    from cmpdesign.tracking.export.runs import largest_shift_s, read_run

    for path in runs:
        shift_s = largest_shift_s(read_run(path), fps)
        if shift_s > 0.5 / fps:
            print_warning(
                f"{printable_path(path)}: the times differ by up to {shift_s:.3g} s from {fps:g} frames per second; "
                "observation.tactile.time_s holds the times of the run"
            )
