"""``cmpdesign dataset``: makes the frames of a plan, shard by shard."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.api import datasets
from cmpdesign.cli.commands.data.extract import print_made
from cmpdesign.cli.derived import derived
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError
from cmpdesign.watch import watched

if TYPE_CHECKING:
    from cmpdesign.documents.data import DatasetCheckDocument

EXAMPLES = (
    "cmpdesign dataset plan.toml -o pressed --shards 1 --workers 1 --json",
    "cmpdesign dataset published --check",
)
CheckOption = Annotated[
    bool, typer.Option("--check", help="Only compare all files of a data set with their digests.")
]


@derived(
    datasets.dataset,
    plan="a TOML file, or the name of a plan template; with --check the folder of a data set",
)
def dataset(plan: str, output: Any, *, check: CheckOption = False, **options: Any) -> None:
    """A finished shard is not made again: the same command continues an interrupted run. The same plan gives the same
    bytes on any number of workers.
    """
    if check:
        if output or options["shards"] or options["inputs_from"]:
            raise CmpDesignError("--check takes the folder of a data set alone; leave out the other options")
        with working("checking") as steps, watched(steps.tell):
            checked = datasets.check_dataset(plan)
        _print_checked(checked)
        finish(lambda: checked, 1 if checked.problems else 0)
        return
    if output is None:
        raise CmpDesignError("--output is missing; give the folder of the data set")
    with working("making") as steps, watched(steps.tell):
        made = datasets.dataset(plan, output, **options)
    print_made(made)
    finish(lambda: made)


def _print_checked(checked: DatasetCheckDocument) -> None:
    for problem in checked.problems:
        print_warning(problem)
    say(
        f"{printable_path(checked.folder)}: {checked.shards} of {checked.of_shards} shards are whole, "
        f"{checked.frames} frames, {checked.bytes / 1e6:.3g} MB; {len(checked.problems) or 'no'} problems"
    )
