"""Data sets: ``dataset`` and ``extract`` make them shard by shard; ``export`` makes them of runs."""

from __future__ import annotations

from cmpdesign import documents
from cmpdesign.api import datasets, workshop
from cmpdesign.cli.command import app, new_group
from cmpdesign.cli.derived import command
from cmpdesign.cli.records import print_rows
from cmpdesign.cli.terminal import EXIT_NEGATIVE, print_warning

LEROBOT = "cmpdesign export lerobot run1.npz run2.npz -o dataset"
ZARR = "cmpdesign export zarr run1.npz run2.npz -o buffer.zarr"
export = new_group("Export runs as data sets for the training of policies.", LEROBOT, ZARR)


@command(
    app,
    datasets.dataset,
    "making",
    "cmpdesign dataset plan.toml -o pressed --shards 1 --workers 1 --json",
    "cmpdesign dataset published --check",
    plan="a TOML file, or the name of a plan template; with --check the folder of a data set",
)
def dataset(done: documents.data.DatasetDocument | documents.data.DatasetCheckDocument) -> int:
    """A finished shard is not made again: the same command continues an interrupted run. The same plan gives the same
    bytes on any number of workers.
    """
    if done.format == "cmp-dataset-run":
        extract(done)
        return 0
    for problem in done.problems:
        print_warning(problem)
    print_rows(done, "folder frames shards of_shards bytes")
    return EXIT_NEGATIVE if done.problems else 0


@command(
    app,
    datasets.extract,
    "extracting",
    "cmpdesign extract layout.json press.mp4 -o markers",
    "cmpdesign extract layout.json press.mp4 frames -o markers --frames-a-shard 100 --workers 1 --json",
)
def extract(done: documents.data.DatasetDocument) -> None:
    """A finished shard is not made again: the same command continues an interrupted run."""
    print_rows(done, "frames shards of_shards redrawn bytes")


@command(
    export,
    workshop.export_lerobot,
    "exporting",
    LEROBOT,
    'cmpdesign export lerobot run1.npz -o dataset --task "press" --images frames',
)
def lerobot(done: documents.runs.ExportDocument) -> None:
    """observation.tactile.time_s holds the times of the runs."""
    zarr(done)


@command(
    export,
    workshop.export_zarr,
    "exporting",
    ZARR,
    "cmpdesign export zarr run1.npz -o buffer.zarr --images frames",
)
def zarr(done: documents.runs.ExportDocument) -> None:
    """The columns of the frames are data/tactile_*."""
    for warning in done.found:
        print_warning(warning)
    print_rows(done, "episodes frames fps")
