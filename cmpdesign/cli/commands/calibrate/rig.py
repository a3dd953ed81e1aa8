"""``cmpdesign calibrate rig``: poses, mirrors, window and gel of one sensor from its pad at rest."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.options.images import MaxPixelsOption
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.inputs.options import Side

if TYPE_CHECKING:
    from cmpdesign.calibration.rig.calibration import RigCalibration

EXAMPLES = (
    "cmpdesign calibrate rig layout.json measured.toml pad.png -o thumb.toml",
    "cmpdesign calibrate rig layout.json measured.toml pad.png -o thumb.toml --json",
)
LARGEST_SCALE = 3.0  # residuals over their stated deviations, as of a rest frame of reconstruct
LARGEST_MIRROR_SHIFT_MM = 0.2


def rig(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pad's layout.json.")],
    rig: Annotated[
        Path,
        typer.Argument(
            metavar="RIG",
            help="Rig or sensor file with lenses and the measured [medium], [medium_deviation].",
        ),
    ],
    rest: Annotated[
        list[str],
        typer.Argument(
            metavar="REST", help="Pictures of the pad at rest; of several cameras one each, joined by commas."
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Sensor file to write, beside RIG: .toml.")
    ],
    step: Annotated[
        list[str] | None,
        typer.Option(
            "--step",
            metavar="MM=PICTURE",
            help="A flat plate has pressed the pattern by MM; give two or more.",
        ),
    ] = None,
    step_sigma_mm: Annotated[
        float, typer.Option(metavar="MM", min=1e-6, help="Standard deviation of the way of a step.")
    ] = 0.002,
    side: Annotated[
        Side,
        typer.Option(help="Side of the pattern that the camera sees; designed: as stated in the layout."),
    ] = "designed",
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Calibrate the views, the window and the gel of a sensor. What remains undetermined is stated and named.

    The written file holds all of RIG, and is a RIG itself: its deviations reach every displacement of reconstruct.
    """
    from cmpdesign.api.calibration import calibrate_rig
    from cmpdesign.watch import watched

    require_suffix("--output", output, [".toml"])
    steps = _parse_steps(step or [])
    with working("reading pictures") as ways, watched(ways.tell):
        found = calibrate_rig(
            layout,
            rig,
            rest,
            output,
            steps=steps,
            step_sigma_mm=step_sigma_mm,
            side=side,
            max_pixels=max_pixels,
        )
    print_step("the pictures are read, the rig is fitted")
    _print_figures(found)
    say(f"wrote {printable_path(output)}")
    finish(lambda: _document(found, printable_path(output), len(rest), tuple(steps)))


def _parse_steps(texts: list[str]) -> dict[float, str]:
    steps: dict[float, str] = {}
    for text in texts:
        way, _, picture = text.partition("=")
        try:
            way_mm = float(way.removesuffix("mm"))
        except ValueError:
            way_mm = float("nan")
        if not -100 <= way_mm <= 100 or not picture:
            raise CmpDesignError(f"--step {text}: expected MM=PICTURE, as in 0.5=plate.png")
        if way_mm in steps:
            raise CmpDesignError(f"--step {text}: a step of {way_mm:g} mm is given twice")
        steps[way_mm] = picture
    return steps


def _print_figures(found: RigCalibration) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for heading in ("", "value", "+- before", "+- after"):
        table.add_column(heading, justify="left" if not heading else "right")
    rows = zip(found.names, found.values, found.stated, found.deviations, strict=False)
    for name, value, stated, deviation in rows:
        table.add_row(
            name, f"{value:.5g}" if abs(value) < 10 else f"{value:.3f}", f"{stated:.2g}", f"{deviation:.2g}"
        )
    say(table)
    residuals = ", ".join(f"{name} {rms:.4f} px" for name, rms in found.rms_px.items())
    say(f"residuals at rest: {residuals} per axis, {found.scale:.2f} stated deviations")
    for pair in found.mirrors:
        say(
            f"mirrors of {pair.views[0]} and {pair.views[1]}: {pair.angle_deg:.3f} degrees between them, "
            f"{pair.planes[0].distance_mm:.2f} and {pair.planes[1].distance_mm:.2f} mm from the camera"
        )
        if abs(pair.shift_mm) > LARGEST_MIRROR_SHIFT_MM:
            print_warning(
                f"views {pair.views[0]} and {pair.views[1]} are shifted by {pair.shift_mm:.2f} mm along the line of "
                f"their mirrors, limit {LARGEST_MIRROR_SHIFT_MM:g} mm: plane mirrors do not do this; check the lens, "
                "and that the views share one camera"
            )
    say(
        f"depth of a press: +- {found.depth_share:.2%}, the same error in all frames, by what is not determined"
    )
    if found.held:
        say(f"not determined by the pictures, held as stated: {', '.join(found.held)}")
    if found.scale > LARGEST_SCALE:
        print_warning(
            f"the markers at rest lie {found.scale:.1f} deviations from their places, limit {LARGEST_SCALE:g}; "
            "deviations are enlarged by this factor; check the layout, the lens and [medium]"
        )


def _document(found: RigCalibration, written: str, pictures: int, steps_mm: tuple[float, ...]) -> Any:
    from cmpdesign.documents.calibration import CalibrateRigDocument, MirrorsPart

    names = found.names[: len(found.values)]
    mirrors = [
        MirrorsPart(
            views=pair.views,
            normals=tuple(tuple(plane.normal.tolist()) for plane in pair.planes),  # type: ignore[arg-type]
            distances_mm=tuple(plane.distance_mm for plane in pair.planes),  # type: ignore[arg-type]
            angle_deg=pair.angle_deg,
            shift_mm=pair.shift_mm,
        )
        for pair in found.mirrors
    ]
    return CalibrateRigDocument(
        written=written,
        pictures=pictures,
        steps_mm=steps_mm,
        plate_markers=found.plate_markers,
        parameters=dict(zip(names, found.values.tolist(), strict=True)),
        stated=dict(zip(names, found.stated.tolist(), strict=True)),
        deviations=dict(zip(found.names, found.deviations.tolist(), strict=True)),
        held=found.held,
        rms_px=found.rms_px,
        scale=found.scale,
        depth_share=found.depth_share,
        mirrors=tuple(mirrors),
    )
