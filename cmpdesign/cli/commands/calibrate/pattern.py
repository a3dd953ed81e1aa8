"""``cmpdesign calibrate pattern``: measures the places of one pad's markers from pictures of the pad at rest."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.options.images import MaxPixelsOption, PresetOption
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.options.response import METAVAR, READING_HELP, parse_reading_response
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from extractor import LearntLayout, Reference

EXAMPLES = (
    "cmpdesign calibrate pattern layout.json rest -o made.json",
    'cmpdesign calibrate pattern layout.json "rest/*.png" -o made.json --json',
)
# RMS per axis; well above the scatter of a made pad (0.01), below that of a round pattern read as honeycomb (0.2).
MAX_USUAL_SCATTER_PITCHES = 0.1
NOT_DETERMINED = "position, turn, size, shear, perspective of the whole pad"


def pattern(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's nominal layout.json.")],
    images: Annotated[
        list[str],
        typer.Argument(
            metavar="IMAGE",
            help='10 or more color pictures of one pad at rest, folders, or patterns such as "rest/*.png".',
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Layout file to write, with the measured places of the markers: .json.",
        ),
    ],
    preset: PresetOption = "accurate",
    response: Annotated[str | None, typer.Option(metavar=METAVAR, help=READING_HELP)] = None,
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Measure the places of one pad's markers. Read the pad's pictures with the written layout."""
    from cmpdesign.api.workshop import calibrate_pattern
    from cmpdesign.documents.reading import CalibratePatternDocument
    from cmpdesign.watch import watched

    require_suffix("--output", output, [".json"])
    known = parse_reading_response(response)
    with working("reading pictures") as steps, watched(steps.tell):
        learnt = calibrate_pattern(
            layout, images, output, preset=preset, response=known, max_pixels=max_pixels
        )
    print_step(f"{len(learnt.picture_z)} pictures are read, the markers' places are fitted")
    _print_figures(learnt)
    say(f"wrote {printable_path(output)}")
    finish(lambda: CalibratePatternDocument(written=printable_path(output), **_figures(learnt)))


def _figures(learnt: LearntLayout) -> dict[str, Any]:
    """The fields of ``CalibratePatternDocument`` that describe the pad."""
    import numpy as np

    made, worst = learnt.layout.as_made, int(learnt.picture_z.argmax())
    assert made is not None and made.covariance_mm2 is not None
    variance = made.covariance_mm2[learnt.measured].trace(axis1=1, axis2=2) / 2
    return {
        "pictures": len(learnt.picture_z),
        "side": made.side,
        "present": int(learnt.layout.present.sum()),
        "measured": int(learnt.measured.sum()),
        "residual_z": float(learnt.z),
        "worst_picture": worst,
        "worst_picture_z": float(learnt.picture_z[worst]),
        "worst_picture_rms_px": float(learnt.picture_rms_px[worst]),
        "scatter_mm": float(learnt.scatter_mm),
        "deviation_mm": float(np.sqrt(variance.mean())),
    }


def _print_figures(learnt: LearntLayout) -> None:
    from rich.table import Table

    figures = _figures(learnt)
    present, measured = figures["present"], figures["measured"]
    rows = {
        "pictures": f"{figures['pictures']} of the {figures['side']}, "
        f"at least {learnt.picture_share.min():.1%} of the markers measured in each",
        "residuals": f"{figures['residual_z']:.2f} stated deviations; worst picture "
        f"{figures['worst_picture_z']:.2f}, {figures['worst_picture_rms_px']:.4f} px per axis",
        "markers": f"{measured} of {present} measured",
        "scatter": f"{figures['scatter_mm']:.5f} mm per axis around the nominal places",
        "deviation": f"{figures['deviation_mm']:.5f} mm per axis, of a measured place",
        "not determined": NOT_DETERMINED,
    }
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    say(table)
    scatter = learnt.scatter_mm / _mean_edge_mm(learnt.layout)
    if scatter > MAX_USUAL_SCATTER_PITCHES:
        print_warning(
            f"the markers lie {scatter:.2f} pitches per axis from their nominal places, limit "
            f"{MAX_USUAL_SCATTER_PITCHES:g}; check that LAYOUT is this pad's, unless the lens distorts strongly"
        )
    if measured < present:
        print_warning(
            f"{present - measured} of {present} markers are measured in no picture and stay at their nominal places; "
            "show the whole pad in some pictures"
        )


def _mean_edge_mm(layout: Reference) -> float:
    import numpy as np

    ends = layout.xy_mm[layout.edges]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
