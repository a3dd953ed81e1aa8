"""``cmpdesign calibrate pattern``: measures the places of one pad's markers from pictures of the pad at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api.calibration import calibrate_pattern
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_step, print_warning, printable_path, say, say_table

if TYPE_CHECKING:
    from cmpdesign.documents.reading import CalibratePatternDocument
    from extractor import Reference

EXAMPLES = (
    "cmpdesign calibrate pattern layout.json rest -o made.json",
    'cmpdesign calibrate pattern layout.json "rest/*.png" -o made.json --json',
)
# RMS per axis; well above the scatter of a made pad (0.01), below that of a round pattern read as honeycomb (0.2).
MAX_USUAL_SCATTER_PITCHES = 0.1
NOT_DETERMINED = "position, turn, size, shear, perspective of the whole pad"


@derived(calibrate_pattern, "reading pictures")
def pattern(done: CalibratePatternDocument) -> None:
    """Position, turn, size, shear and perspective of the whole pad are not determined."""
    print_step(f"{done.pictures} pictures are read, the markers' places are fitted")
    _print_figures(done)
    say(f"wrote {printable_path(done.written)}")


def _print_figures(done: CalibratePatternDocument) -> None:
    learnt = done.found
    say_table(
        {
            "pictures": f"{done.pictures} of the {done.side}, "
            f"at least {learnt.picture_share.min():.1%} of the markers measured in each",
            "residuals": f"{done.residual_z:.2f} stated deviations; worst picture "
            f"{done.worst_picture_z:.2f}, {done.worst_picture_rms_px:.4f} px per axis",
            "markers": f"{done.measured} of {done.present} measured",
            "scatter": f"{done.scatter_mm:.5f} mm per axis around the nominal places",
            "deviation": f"{done.deviation_mm:.5f} mm per axis, of a measured place",
            "not determined": NOT_DETERMINED,
        }
    )
    scatter = done.scatter_mm / _mean_edge_mm(learnt.layout)
    if scatter > MAX_USUAL_SCATTER_PITCHES:
        print_warning(
            f"the markers lie {scatter:.2f} pitches per axis from their nominal places, limit "
            f"{MAX_USUAL_SCATTER_PITCHES:g}; check that LAYOUT is this pad's, unless the lens distorts strongly"
        )
    if done.measured < done.present:
        print_warning(
            f"{done.present - done.measured} of {done.present} markers are measured in no picture and stay at their "
            "nominal places; show the whole pad in some pictures"
        )


def _mean_edge_mm(layout: Reference) -> float:
    import numpy as np

    ends = layout.xy_mm[layout.edges]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
