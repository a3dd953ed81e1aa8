"""``cmpdesign track``: tracks a pattern through a video, a folder of images or the frames of a camera."""

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
from cmpdesign.cli.terminal import print_warning, printable_path, say_table

if TYPE_CHECKING:
    from cmpdesign.documents.runs import TrackDocument

EXAMPLES = (
    "cmpdesign track layout.json frames -o run.npz",
    "cmpdesign track layout.json press.mp4 -o run.csv --overlay found.mp4 --frames 100",
)


@derived(sequences.track, on_frame=None)
def track(
    layout: Path, source: list[str], output: Path, *, recover: RecoverOption = False, **options: Any
) -> None:
    """Exit code: 0 done, 1 ended early or nothing tracked, 2 bad input or full disk."""
    if recover:
        recover_and_report(layout, output, "track")
        return
    job = sequences.track_job(layout, source, output, **options)
    quiver = job.options["quiver"]

    def show(done: TrackDocument) -> None:
        _print_summary(done)
        if quiver is not None and printable_path(quiver) not in done.written:
            print_warning(f"{printable_path(quiver)} is not drawn: no frame has a displacement")

    run_and_report(job, "tracking", show)


def _print_summary(done: TrackDocument) -> None:
    from cmpdesign.reading.quality import quality_text, reasons_text

    times = ", ".join(f"{name} {value:.1f} ms" for name, value in done.time_ms.items())
    rate, jitter, largest = done.frames_per_s, done.jitter_px, done.largest_displacement
    rows = {
        "frames": frames_text(done.frames),
        "starts": ", ".join(f"{count} {start}" for start, count in done.starts.items()) or "none",
        "markers": ", ".join(f"{share:.2%} {name}" for name, share in done.marker_shares),
        "time a frame": times + (f"; on the whole {rate:.3g} frames per second" if rate else ""),
        "jitter at rest": "too few resting frames" if jitter is None else f"{jitter:.4f} px per axis",
    }
    if done.reasons:
        rows["not tracked, or in part"] = reasons_text(done.reasons)
    if done.quality is not None:
        rows["image quality"] = quality_text(done.quality.model_dump())
        if done.quality.hints:
            rows["remedy"] = "; ".join(done.quality.hints)
    if done.contact is not None:
        rows["contact"] = contact_text(done.contact)
    if largest is not None:
        mm = "" if largest.mm is None else f" = {largest.mm:.4g} mm"
        rows["largest displacement"] = (
            f"{largest.px:.3f} px{mm}, marker {largest.marker} in frame {largest.frame}"
        )
    say_table(rows)
