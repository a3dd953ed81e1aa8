"""``cmpdesign export zarr``: runs as a replay buffer in the form of Diffusion Policy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.commands.export.options import ImagesOption, RunsArgument
from cmpdesign.cli.image_options import MaxPixelsOption
from cmpdesign.cli.paths import require_suffix
from cmpdesign.cli.terminal import console, printable_path
from cmpdesign.inputs.files import MOST_PIXELS


def zarr(
    runs: RunsArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Buffer to write: a new .zarr folder.")
    ],
    images: ImagesOption = None,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Write a replay buffer: data/tactile_* with the frames of all runs, meta/episode_ends."""
    from cmpdesign.tracking.export.zarr_buffer import write_zarr

    require_suffix("--output", output, [".zarr"])
    frames = write_zarr(runs, output, tuple(images or ()), max_pixels)
    console().print(f"wrote {printable_path(output)}: {len(runs)} episodes, {frames} frames")
