"""The summary of a data set that was made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.cli.terminal import finish, printable_path, say

if TYPE_CHECKING:
    from cmpdesign.data.folder import Progress


def print_made(folder: Path, made: Progress) -> None:
    """Print the contents of the data set, and end the command."""
    from cmpdesign.documents.data import DatasetDocument

    share = "" if made.shards == made.of_shards else f" of {made.of_shards}"
    redrawn = f", {made.redrawn} draws could not be rendered and were drawn anew" if made.redrawn else ""
    say(
        f"wrote {printable_path(folder)}: {made.frames} frames in {made.shards}{share} shards, "
        f"{made.bytes / 1e6:.3g} MB{redrawn}"
    )
    finish(
        lambda: DatasetDocument(
            written=printable_path(folder),
            frames=made.frames,
            shards=made.shards,
            of_shards=made.of_shards,
            redrawn=made.redrawn,
            bytes=made.bytes,
        )
    )
