"""The progress of shards, and what is said at the end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.cli.progress import progress_bar
from cmpdesign.cli.terminal import finish, print_step, printable_path, say

if TYPE_CHECKING:
    from cmpdesign.data.folder import Progress


def shards_bar(stack: ExitStack) -> Callable[[int, int], None]:
    """A function to be called with (done, wanted) shards; the bar begins with those of an earlier run."""
    advance: list[Callable[[str], None]] = []

    def watch(done: int, wanted: int) -> None:
        if advance:
            advance[0]("")
            return
        advance.append(stack.enter_context(progress_bar("making", wanted, done=done, unit="shards")))
        print_step(f"{done} of {wanted} shards are there from an earlier run")

    return watch


def print_made(folder: Path, made: Progress) -> None:
    """Say what the data set holds, and end the command."""
    from cmpdesign.cli.documents.data import DatasetDocument

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
