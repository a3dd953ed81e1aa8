"""``cmpdesign extract``: reads the markers of many videos and folders, part by part."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.commands.data.made import print_made
from cmpdesign.cli.options.images import ChannelsOption, PresetOption, SideOption
from cmpdesign.cli.options.response import METAVAR, READING_HELP, parse_reading_response
from cmpdesign.cli.options.scheduling import SchedulerOption, WorkersOption
from cmpdesign.cli.progress import working

EXAMPLES = (
    "cmpdesign extract layout.json press.mp4 -o markers",
    "cmpdesign extract layout.json press.mp4 frames -o markers --frames-a-shard 100 --workers 1 --json",
)


def extract(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
    sources: Annotated[
        list[str],
        typer.Argument(metavar="SOURCE", help='Videos, folders of pictures, patterns such as "run*/*.mp4".'),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="Data set: a new folder, or one of the same sources."
        ),
    ],
    frames_a_shard: Annotated[
        int, typer.Option(min=1, help="Frames in a shard; a video is cut at the next key frame.")
    ] = 1000,
    scheduler: SchedulerOption = "local",
    workers: WorkersOption = None,
    preset: PresetOption = "balanced",
    response: Annotated[str | None, typer.Option(metavar=METAVAR, help=READING_HELP)] = None,
    side: SideOption = "designed",
    channels: ChannelsOption = "bgr",
) -> None:
    """Read the markers of every frame of many sources into Parquet files, each frame independently of the others.

    A finished shard is not made again: the same command continues an interrupted run.
    """
    from cmpdesign.data.run import extract_markers
    from cmpdesign.data.schedule.schedulers import parse_scheduler
    from cmpdesign.data.videos.extraction import FrameReading
    from cmpdesign.watch import watched
    from extractor import load_layout

    reading = FrameReading(preset, parse_reading_response(response), side, channels)
    where, reference = parse_scheduler(scheduler, workers), load_layout(layout)
    with working("extracting") as steps, watched(steps.tell):
        made = extract_markers(reference, sources, output, reading, where, frames_a_shard)
    print_made(output, made)
