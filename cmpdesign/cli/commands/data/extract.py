"""``cmpdesign extract``: reads the markers of many videos and folders, part by part."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api import datasets
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import printable_path, say

if TYPE_CHECKING:
    from cmpdesign.documents.data import DatasetDocument

EXAMPLES = (
    "cmpdesign extract layout.json press.mp4 -o markers",
    "cmpdesign extract layout.json press.mp4 frames -o markers --frames-a-shard 100 --workers 1 --json",
)


@derived(datasets.extract, "extracting")
def extract(made: DatasetDocument) -> None:
    """A finished shard is not made again: the same command continues an interrupted run."""
    print_made(made)


def print_made(made: DatasetDocument) -> None:
    """Print the contents of a data set."""
    share = "" if made.shards == made.of_shards else f" of {made.of_shards}"
    redrawn = f", {made.redrawn} draws could not be rendered and were drawn anew" if made.redrawn else ""
    say(
        f"wrote {printable_path(made.written)}: {made.frames} frames in {made.shards}{share} shards, "
        f"{made.bytes / 1e6:.3g} MB{redrawn}"
    )
