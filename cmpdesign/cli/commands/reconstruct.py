"""``cmpdesign reconstruct``: reconstructs the surface in space from two or more views, through a sequence."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.api import sequences
from cmpdesign.cli.derived import derived
from cmpdesign.cli.run_progress import (
    RecoverOption,
    contact_text,
    frames_text,
    recover_and_report,
    run_and_report,
)
from cmpdesign.cli.terminal import say_table

if TYPE_CHECKING:
    from cmpdesign.documents.runs import PositionsPart, ReconstructDocument

EXAMPLES = (
    "cmpdesign reconstruct layout.json rig.toml rest.png frames -o run.npz",
    "cmpdesign reconstruct layout.json rig.toml 0 press.avi -o run.csv --frames 100",
)


@derived(sequences.reconstruct, on_frame=None)
def reconstruct(
    layout: Path,
    rig: Path,
    rest: str,
    source: str,
    output: Path,
    *,
    recover: RecoverOption = False,
    **options: Any,
) -> None:
    """Positions, displacements and normals in mm. Exit code: 0 done, 1 ended early or nothing found, 2 bad input."""
    if recover:
        recover_and_report(layout, output, "reconstruct")
        return
    job = sequences.reconstruct_job(layout, rig, rest, source, output, **options)
    run_and_report(job, "reconstructing", _print_summary)


def _describe_positions(positions: PositionsPart) -> str:
    """The surface of the positions: the cameras see the pattern, at any depth."""
    depth_mm = positions.depth_mm
    if positions.continued_to_surface:
        return (
            f"of the pattern, {depth_mm:g} mm below the touched surface; surface_* are of the touched surface"
        )
    if depth_mm is None:
        return "of the pattern; RIG does not state the pattern's depth below the touched surface"
    if depth_mm == 0:
        return "of the pattern, which RIG puts on the touched surface"
    return f"of the pattern, {depth_mm:g} mm below the touched surface; not of the touched surface"


def _print_summary(done: ReconstructDocument) -> None:
    rows = {
        "frames": frames_text(done.frames),
        "views": "; ".join(f"{view.name} {view.rms_px:.3f} px at rest" for view in done.views),
        "markers": ", ".join(f"{share:.2%} {name}" for name, share in done.marker_shares),
        "positions": _describe_positions(done.positions),
    }
    if done.lost_markers:
        lost = done.lost_markers.items()
        rows["not reported"] = ", ".join(f"{count} x {reason.replace('_', ' ')}" for reason, count in lost)
    if done.reasons:
        rows["notes"] = ", ".join(f"{count} x {reason}" for reason, count in done.reasons.items())
    if done.sigma_um is not None:
        axes = zip("xyz", done.sigma_um, strict=True)
        rows["standard deviation"] = ", ".join(f"{axis} {value:.2f} um" for axis, value in axes)
    largest = done.largest_displacement
    if done.systematic_um is not None:
        rows["systematic deviation"] = (
            "of the largest displacement, by the deviations of the rig: "
            + ", ".join(
                f"{axis} {value:.1f} um" for axis, value in zip("xyz", done.systematic_um, strict=True)
            )
        )
    if largest is not None:
        rows["largest displacement"] = (
            f"{largest.mm:.4f} mm, marker {largest.marker} in frame {largest.frame}"
        )
    if done.contact is not None:
        rows["contact"] = contact_text(done.contact)
    rows["time a frame"] = ", ".join(f"{name} {value:.1f} ms" for name, value in done.time_ms.items())
    say_table(rows)
