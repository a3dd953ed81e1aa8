"""``cmpdesign dataset``: makes the frames of a plan, shard by shard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api import datasets
from cmpdesign.cli.commands.data.extract import print_made
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_warning, printable_path, say

if TYPE_CHECKING:
    from cmpdesign.documents.data import DatasetCheckDocument, DatasetDocument

EXAMPLES = (
    "cmpdesign dataset plan.toml -o pressed --shards 1 --workers 1 --json",
    "cmpdesign dataset published --check",
)


@derived(
    datasets.dataset,
    "making",
    plan="a TOML file, or the name of a plan template; with --check the folder of a data set",
)
def dataset(done: DatasetDocument | DatasetCheckDocument) -> int:
    """A finished shard is not made again: the same command continues an interrupted run. The same plan gives the same
    bytes on any number of workers.
    """
    from cmpdesign.documents.data import DatasetDocument

    if isinstance(done, DatasetDocument):
        print_made(done)
        return 0
    _print_checked(done)
    return 1 if done.problems else 0


def _print_checked(checked: DatasetCheckDocument) -> None:
    for problem in checked.problems:
        print_warning(problem)
    say(
        f"{printable_path(checked.folder)}: {checked.shards} of {checked.of_shards} shards are whole, "
        f"{checked.frames} frames, {checked.bytes / 1e6:.3g} MB; {len(checked.problems) or 'no'} problems"
    )
