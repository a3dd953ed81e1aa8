"""``cmpdesign export``: runs as data sets for the training of policies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.command import Command, Group, examples
from cmpdesign.cli.options.images import MaxPixelsOption
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.progress import working
from cmpdesign.cli.run_progress import require_positive
from cmpdesign.cli.terminal import finish, print_warning, printable_path, say
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.documents.runs import ExportDocument

LEROBOT = (
    "cmpdesign export lerobot run1.npz run2.npz -o dataset",
    'cmpdesign export lerobot run1.npz -o dataset --task "press" --images frames',
)
ZARR = (
    "cmpdesign export zarr run1.npz run2.npz -o buffer.zarr",
    "cmpdesign export zarr run1.npz -o buffer.zarr --images frames",
)
app = typer.Typer(
    cls=Group,
    epilog=examples(LEROBOT[0], ZARR[0]),
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Export runs as data sets for the training of policies.",
)
RunsArgument = Annotated[
    list[Path],
    typer.Argument(metavar="RUN", help="Files of track or reconstruct, .npz; each file is an episode."),
]
ImagesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--images",
        metavar="SOURCE",
        help="Video or folder of images of a RUN; once for each, in order. [default: no images]",
    ),
]


@app.command(cls=Command, epilog=examples(*LEROBOT))
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
    from cmpdesign.api.workshop import export_lerobot
    from cmpdesign.watch import watched

    require_positive("--fps", fps)
    about = {"task": task, "fps": fps, "robot": robot}
    with working("exporting") as steps, watched(steps.tell):
        made = export_lerobot(runs, output, images=images or (), max_pixels=max_pixels, **about)  # type: ignore[arg-type]
    assert made.fps is not None
    _warn_of_uneven_times(runs, made.fps)
    _report(made, f" at {made.fps:g} frames per second")


@app.command(cls=Command, epilog=examples(*ZARR))
def zarr(
    runs: RunsArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Buffer to write: a new .zarr folder.")
    ],
    images: ImagesOption = None,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Write a replay buffer: data/tactile_* with the frames of all runs, and meta/episode_ends."""
    from cmpdesign.api.workshop import export_zarr
    from cmpdesign.watch import watched

    require_suffix("--output", output, [".zarr"])
    with working("exporting") as steps, watched(steps.tell):
        made = export_zarr(runs, output, images=images or (), max_pixels=max_pixels)
    _report(made, "")


def _report(made: ExportDocument, rate: str) -> None:
    say(f"wrote {printable_path(made.written)}: {made.episodes} episodes, {made.frames} frames{rate}")
    finish(lambda: made)


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
