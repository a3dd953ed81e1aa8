"""Rows of the camera suite: all pictures of an effect, or of a run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.camera.cases import KINDS
from benchmarks.suites.camera.effects import COLOR_EFFECTS
from benchmarks.suites.camera.reading import LOST, UNSEEN, PictureResult
from benchmarks.suites.scoring.calibration import summarise

TOGETHER = "together"
MIN_CONTRAST, MIN_PITCH_PX = 20.0, 8.0  # from which on neighbouring cells are separable
COLORS_SEPARABLE, ALL_SEPARABLE = "colors, CIE76 20", "together, CIE76 20"
NO_REASON = "no reason given"
MAX_FAILURES = 40  # listed pictures
Row = tuple[Any, ...]  # of COLUMNS
COLUMNS = {
    "effect": TEXT, "pictures": "d", "unread": "d", "raised": "d", "visible": "d", "measured": ".1%", "ids": "d",
    "places": "d", "rms px": ".4f", "z": ".2f", "median z": ".2f", "beyond": ".2%", "95 %": ".1%", "p50 ms": ".1f",
    "p99 ms": ".1f", "reasons": TEXT,
}  # fmt: skip


def effects_table(results: Sequence[PictureResult]) -> Table:
    """One row per effect, of separable pictures, and of all pictures."""
    return Table("effects of cameras", COLUMNS, effect_rows(results))


def effect_row(effect: str, results: Sequence[PictureResult]) -> Row:
    """The row of some pictures; at least one. ``rms px``: per axis, of visible measured markers that are not wrong."""
    right, visible = (sum(getattr(result, name) for result in results) for name in ("right", "visible"))
    squared_px2 = sum(result.squared_px2 for result in results)
    times_ms = [result.ms for result in results if not result.raised] or [math.nan]
    unread = [result for result in results if not result.outcomes.strip(UNSEEN + LOST)]
    reasons = Counter(result.reason or NO_REASON for result in results if result.reason or result in unread)
    stated = summarise([result.d2 for result in results])
    return (
        effect,
        len(results),
        len(unread),
        sum(result.raised for result in results),
        visible,
        sum(result.measured for result in results) / visible if visible else None,
        sum(result.wrong_ids for result in results),
        sum(result.wrong_places for result in results),
        math.sqrt(squared_px2 / (2 * right)) if right else None,
        stated.z.value,
        stated.median_z,
        stated.beyond.value,
        (stated.beyond.low, stated.beyond.high),
        *np.percentile(times_ms, (50, 99)).tolist(),
        ", ".join(f"{name} {count}" for name, count in sorted(reasons.items())),
    )


def is_separable(result: PictureResult) -> bool:
    """Neighbouring cells differ by a CIE76 of 20 (5th percentile over the pattern), and the pitch is 8 px or more."""
    return result.contrast >= MIN_CONTRAST and result.pitch_px >= MIN_PITCH_PX


def separable_rows(results: Sequence[PictureResult]) -> list[Row]:
    """The separable pictures of the effects of light and inks, and those of all effects."""
    separable = [result for result in results if is_separable(result)]
    colored = [result for result in separable if result.case.kind in COLOR_EFFECTS]
    named = ((COLORS_SEPARABLE, colored), (ALL_SEPARABLE, separable))
    return [effect_row(name, chosen) for name, chosen in named if chosen]


def effect_rows(results: Sequence[PictureResult]) -> list[Row]:
    """One row per effect in the order of a camera, of separable pictures, and of all pictures."""
    rows = []
    for kind in KINDS:
        of_kind = [result for result in results if result.case.kind == kind]
        if of_kind:
            rows.append(effect_row(kind, of_kind))
    return [*rows, *separable_rows(results), effect_row(TOGETHER, results)]


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
