"""Rows of the camera suite: all pictures of an effect, or of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.frame.pooled import Columns, grouped, percentile, pooled_table, reasons, share, total
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.camera.cases import KINDS
from benchmarks.suites.camera.effects import COLOR_EFFECTS
from benchmarks.suites.camera.reading import PictureResult, rms_px
from benchmarks.suites.scoring.calibration import stated_columns

TOGETHER = "together"
MIN_CONTRAST, MIN_PITCH_PX = 20.0, 8.0  # from which on neighbouring cells are separable
COLORS_SEPARABLE, ALL_SEPARABLE = "colors, CIE76 20", "together, CIE76 20"
MAX_FAILURES = 40  # listed pictures
Results = Sequence[PictureResult]


COLUMNS: Columns = {
    "pictures": ("d", len),
    "unread": ("d", total("is_unread")),
    "raised": ("d", total("raised")),
    "visible": ("d", total("visible")),
    "measured": (".1%", share("measured", "visible")),
    "ids": ("d", total("wrong_ids")),
    "places": ("d", total("wrong_places")),
    "rms px": (".4f", rms_px),
    **stated_columns(lambda result: result.d2),
    "p50 ms": (".1f", percentile("ms", 50)),
    "p99 ms": (".1f", percentile("ms", 99)),
    "reasons": (TEXT, reasons),
}


def is_separable(result: PictureResult) -> bool:
    """Neighbouring cells differ by a CIE76 of 20 (5th percentile over the pattern), and the pitch is 8 px or more."""
    return result.contrast >= MIN_CONTRAST and result.pitch_px >= MIN_PITCH_PX


def effects_table(results: Results) -> Table:
    """One row per effect in the order of a camera, of separable pictures, and of all pictures."""
    of_kind, separable = grouped(results, "case.kind"), [one for one in results if is_separable(one)]
    groups = {kind: of_kind.get(kind, []) for kind in KINDS}
    groups[COLORS_SEPARABLE] = [one for one in separable if one.case.kind in COLOR_EFFECTS]
    groups[ALL_SEPARABLE] = separable
    return pooled_table("effects of cameras", "effect", COLUMNS, {**groups, TOGETHER: results})


def failure_lines(results: Iterable[PictureResult]) -> list[str]:
    """One line per picture that raised or has wrong markers, wrong ids first."""
    failed = [result for result in results if result.raised or result.wrong_ids or result.wrong_places]
    failed.sort(key=lambda result: (-result.raised, -result.wrong_ids, -result.wrong_places))
    lines = [
        f"RAISED   {result.case.name}  {result.reason}"
        if result.raised
        else f"WRONG    {result.wrong_ids:>4} ids {result.wrong_places:>4} positions  {result.case.name}"
        for result in failed[:MAX_FAILURES]
    ]
    return [*lines, f"and {len(failed) - MAX_FAILURES} more"] if len(failed) > MAX_FAILURES else lines
