"""``cmpdesign calibrate gel``: Green's matrix of one pad, with which forces are read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, printable_path, say

EXAMPLES = (
    "cmpdesign calibrate gel layout.json sensor.toml -o gel.npz",
    "cmpdesign calibrate gel layout.json sensor.toml -o gel.npz --margin-mm 2",
)


def gel(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pad's layout.json.")],
    rig: Annotated[
        Path,
        typer.Argument(
            metavar="RIG", help="TOML file with [elastomer]: thickness_mm, poisson, marker_depth_mm."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File to write: .npz.")],
    margin_mm: Annotated[
        float, typer.Option(metavar="MM", help="Width of the gel beyond the layout's outline.")
    ] = 0.0,
) -> None:
    """Compute a pad's elastic response once, so that forces can be read from its displacement.

    The file depends on thickness, Poisson's ratio and marker depth, not on Young's modulus.
    """
    from cmpdesign.api.force import calibrate_gel
    from cmpdesign.documents.reading import CalibrateGelDocument

    require_suffix("--output", output, [".npz"])
    with working("solving the block"):
        made = calibrate_gel(layout, rig, output, margin_mm=margin_mm)
    say(f"{len(made.loads_mm)} loads, {len(made.matrix) // 3} markers, gel of {made.thickness_mm:g} mm")
    say(f"wrote {printable_path(output)}")
    finish(
        lambda: CalibrateGelDocument(
            written=printable_path(output),
            digest=made.digest,
            markers=len(made.matrix) // 3,
            loads=len(made.loads_mm),
            thickness_mm=made.thickness_mm,
            poisson=made.poisson,
            marker_depth_mm=made.marker_depth_mm,
            margin_mm=made.margin_mm,
        )
    )
