"""``cmpdesign export``: runs as data sets for the training of policies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api import workshop
from cmpdesign.cli.command import Command, examples, new_group
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_warning, printable_path, say

if TYPE_CHECKING:
    from cmpdesign.documents.runs import ExportDocument

LEROBOT = (
    "cmpdesign export lerobot run1.npz run2.npz -o dataset",
    'cmpdesign export lerobot run1.npz -o dataset --task "press" --images frames',
)
ZARR = (
    "cmpdesign export zarr run1.npz run2.npz -o buffer.zarr",
    "cmpdesign export zarr run1.npz -o buffer.zarr --images frames",
)
app = new_group("Export runs as data sets for the training of policies.", LEROBOT[0], ZARR[0])


@app.command(cls=Command, epilog=examples(*LEROBOT))
@derived(workshop.export_lerobot, "exporting")
def lerobot(made: ExportDocument) -> None:
    """observation.tactile.time_s holds the times of the runs."""
    assert made.fps is not None
    _report(made, f" at {made.fps:g} frames per second")


@app.command(cls=Command, epilog=examples(*ZARR))
@derived(workshop.export_zarr, "exporting")
def zarr(made: ExportDocument) -> None:
    """The columns of the frames are data/tactile_*."""
    _report(made, "")


def _report(made: ExportDocument, rate: str) -> None:
    for warning in made.found:
        print_warning(warning)
    say(f"wrote {printable_path(made.written)}: {made.episodes} episodes, {made.frames} frames{rate}")
