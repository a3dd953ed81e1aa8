"""The summary of a data set that was made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.cli.terminal import finish, print_warning, printable_path, say

if TYPE_CHECKING:
    from cmpdesign.data.folder import Progress
    from cmpdesign.data.integrity import CheckedDataSet


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


def print_checked(folder: str, checked: CheckedDataSet) -> None:
    """Print the result of a check, and end the command: with exit code 1 if a file is damaged."""
    from cmpdesign.documents.data import DatasetCheckDocument

    for problem in checked.problems:
        print_warning(problem)
    say(
        f"{printable_path(folder)}: {checked.shards} of {checked.of_shards} shards are whole, "
        f"{checked.frames} frames, {checked.bytes / 1e6:.3g} MB; {len(checked.problems) or 'no'} problems"
    )
    document = DatasetCheckDocument(
        folder=printable_path(folder),
        shards=checked.shards,
        of_shards=checked.of_shards,
        frames=checked.frames,
        bytes=checked.bytes,
        problems=list(checked.problems),
    )
    finish(lambda: document, 1 if checked.problems else 0)
