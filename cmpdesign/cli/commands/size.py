"""``cmpdesign size``: a design for a camera and its field of view."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from cmpdesign.cli.command import app
from cmpdesign.cli.derived import command
from cmpdesign.cli.terminal import say, say_table, say_text
from cmpdesign.proposal import sizing

if TYPE_CHECKING:
    from cmpdesign.proposal.camera_design import Proposal


@command(
    app,
    sizing.size,
    "comparing patterns",
    "cmpdesign size --camera 1280x960 --view 24x18mm",
    "cmpdesign size --camera 640x480 --view 20x15mm --make mold -o sized.toml",
)
def size(done: Proposal, given: Mapping[str, Any]) -> None:
    """The design is printed as TOML, or written into a file for build."""
    say_table(done.figures())
    output = given["output"]
    if output is None:
        say_text(f"\n{done.to_toml()}\n# next: the same with -o sized.toml\n")
        return
    say(f"wrote {output}")
    say_text(f"next: {done.next_command.replace('DESIGN.toml', shlex.quote(str(output)))}\n")
