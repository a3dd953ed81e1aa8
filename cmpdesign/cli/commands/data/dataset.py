"""``cmpdesign dataset``: makes the frames of a plan, shard by shard."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.commands.data.made import print_checked, print_made
from cmpdesign.cli.options.scheduling import SchedulerOption, WorkersOption
from cmpdesign.cli.progress import working
from cmpdesign.errors import CmpDesignError

EXAMPLES = (
    "cmpdesign dataset plan.toml -o pressed",
    "cmpdesign dataset plan.toml -o pressed --shards 1 --workers 1 --json",
    "cmpdesign dataset pressed --check",
)


def complete_plan(incomplete: str) -> list[str]:
    """The names of plan templates that begin with a text, for the completion of shells."""
    from cmpdesign.design.templates import plan_templates

    return [name for name in plan_templates() if name.startswith(incomplete)]


def dataset(
    plan: Annotated[
        str,
        typer.Argument(
            metavar="PLAN",
            help="A TOML file, or the name of a plan template; with --check the folder of a data set.",
            autocompletion=complete_plan,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="Data set: a new folder, or one of the same plan."
        ),
    ] = None,
    shards: Annotated[
        str | None,
        typer.Option(metavar="N|A:B", help="Only the first N shards, or those from A to below B."),
    ] = None,
    scheduler: SchedulerOption = "local",
    workers: WorkersOption = None,
    inputs_from: Annotated[
        list[Path] | None,
        typer.Option(metavar="FOLDER", help="Folder, beside the plan's, whose pictures the plan may take."),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Only compare all files of a data set with their digests.")
    ] = False,
) -> None:
    """Make a data set: pictures, truth, markers, forces and parameters of the frames that a plan names.

    A finished shard is not made again: the same command continues an interrupted run. The same plan gives the same
    bytes on any number of workers.
    """
    from cmpdesign.watch import watched

    if check:
        from cmpdesign.data import check as check_files

        _require_alone(output, shards, inputs_from)
        with working("checking") as steps, watched(steps.tell):
            checked = check_files(plan)
        print_checked(plan, checked)
        return
    from cmpdesign.data.run import make_dataset, parse_shards
    from cmpdesign.data.schedule.schedulers import parse_scheduler
    from cmpdesign.design.templates import find_plan

    if output is None:
        raise CmpDesignError("--output is missing; give the folder of the data set")
    wanted, where = parse_shards(shards), parse_scheduler(scheduler, workers)
    with working("making") as steps, watched(steps.tell):
        made = make_dataset(find_plan(plan), output, wanted, where, inputs_from or ())
    print_made(output, made)


def _require_alone(*others: object) -> None:
    if any(others):
        raise CmpDesignError("--check takes the folder of a data set alone; leave out the other options")
