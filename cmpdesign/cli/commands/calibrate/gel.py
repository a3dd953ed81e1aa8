"""``cmpdesign calibrate gel``: Green's matrix of one pad, with which forces are read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api.force import calibrate_gel
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import printable_path, say

if TYPE_CHECKING:
    from cmpdesign.documents.reading import CalibrateGelDocument

EXAMPLES = (
    "cmpdesign calibrate gel layout.json sensor.toml -o gel.npz",
    "cmpdesign calibrate gel layout.json sensor.toml -o gel.npz --margin-mm 2",
)


@derived(calibrate_gel, "solving the block")
def gel(made: CalibrateGelDocument) -> None:
    """The file depends on thickness, Poisson's ratio and marker depth, not on Young's modulus."""
    say(f"{made.loads} loads, {made.markers} markers, gel of {made.thickness_mm:g} mm")
    say(f"wrote {printable_path(made.written)}")
