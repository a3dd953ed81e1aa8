"""``cmpdesign export zarr``: runs as a replay buffer in the form of Diffusion Policy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.commands.export.options import ImagesOption, RunsArgument
from cmpdesign.cli.options.images import MaxPixelsOption
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, printable_path, say
from cmpdesign.inputs.files import MOST_PIXELS

EXAMPLES = (
    "cmpdesign export zarr run1.npz run2.npz -o buffer.zarr",
    "cmpdesign export zarr run1.npz -o buffer.zarr --images frames",
)


def zarr(
    runs: RunsArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Buffer to write: a new .zarr folder.")
    ],
    images: ImagesOption = None,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Write a replay buffer: data/tactile_* with the frames of all runs, and meta/episode_ends."""
    from cmpdesign.documents.runs import ExportDocument
    from cmpdesign.tracking.export.zarr_buffer import write_zarr
    from cmpdesign.watch import watched

    require_suffix("--output", output, [".zarr"])
    with working("exporting") as steps, watched(steps.tell):
        frames = write_zarr(runs, output, tuple(images or ()), max_pixels)
    say(f"wrote {printable_path(output)}: {len(runs)} episodes, {frames} frames")
    finish(
        lambda: ExportDocument(
            kind="zarr", written=printable_path(output), episodes=len(runs), frames=frames, fps=None
        )
    )
