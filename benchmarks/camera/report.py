"""Rows of the camera suite: all pictures of an effect, of an effect at one strength, or of a run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.suites.camera.cases import KINDS
from benchmarks.suites.camera.effects import COLOR_EFFECTS
from benchmarks.suites.camera.reading import LOST, UNSEEN, PictureResult
from benchmarks.suites.scoring.calibration import Calibration, summarise

TOGETHER = "together"
LEAST_CONTRAST, LEAST_PITCH_PX = 20.0, 8.0  # from which on neighbouring cells are separable
COLORS_SEPARABLE, ALL_SEPARABLE = "colors, CIE76 20", "together, CIE76 20"
NO_REASON = "no reason given"
MOST_FAILURES = 40  # listed pictures


@dataclass(frozen=True)
class EffectRow:
    """Pooled pictures. Counts are of markers, see ``PictureResult``.

    Attributes:
        effect: the effect's name, with ``=strength`` if the row is of one strength.
        unread: pictures without any marker.
        rms_px: per axis, of visible measured markers that are not wrong.
        calibration: of all measured markers, wrong ones included.
        reasons: number of pictures by the extractor's reason, and of unread ones without any.
        p50_ms, p99_ms: processor time of one picture.
    """

    effect: str
    pictures: int
    unread: int
    raised: int
    visible: int
    measured: int
    wrong_ids: int
    wrong_places: int
    rms_px: float
    calibration: Calibration
    reasons: dict[str, int]
    p50_ms: float
    p99_ms: float

    @property
    def measured_share(self) -> float:
        return self.measured / self.visible if self.visible else math.nan

    def record(self) -> dict[str, Any]:
        """The row as JSON knows it: NaN and infinity become None."""
        return {name: _plain(value) for name, value in asdict(self).items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(entry) for name, entry in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def effect_row(effect: str, results: Sequence[PictureResult]) -> EffectRow:
    """The row of some pictures; at least one."""
    right = sum(result.right for result in results)
    squared_px2 = sum(result.squared_px2 for result in results)
    times_ms = [result.ms for result in results if not result.raised] or [math.nan]
    p50_ms, p99_ms = np.percentile(times_ms, (50, 99)).tolist()
    unread = [result for result in results if not result.outcomes.strip(UNSEEN + LOST)]
    reasons = Counter(result.reason or NO_REASON for result in results if result.reason or result in unread)
    return EffectRow(
        effect=effect,
        pictures=len(results),
        unread=len(unread),
        raised=sum(result.raised for result in results),
        visible=sum(result.visible for result in results),
        measured=sum(result.measured for result in results),
        wrong_ids=sum(result.wrong_ids for result in results),
        wrong_places=sum(result.wrong_places for result in results),
        rms_px=math.sqrt(squared_px2 / (2 * right)) if right else math.nan,
        calibration=summarise([result.d2 for result in results]),
        reasons=dict(sorted(reasons.items())),
        p50_ms=p50_ms,
        p99_ms=p99_ms,
    )


def is_separable(result: PictureResult) -> bool:
    """Neighbouring cells differ by a CIE76 of 20 (5th percentile over the pattern), and the pitch is 8 px or more."""
    return result.contrast >= LEAST_CONTRAST and result.pitch_px >= LEAST_PITCH_PX


def separable_rows(results: Sequence[PictureResult]) -> list[EffectRow]:
    """The separable pictures of the effects of light and inks, and those of all effects."""
    separable = [result for result in results if is_separable(result)]
    colored = [result for result in separable if result.case.kind in COLOR_EFFECTS]
    named = ((COLORS_SEPARABLE, colored), (ALL_SEPARABLE, separable))
    return [effect_row(name, chosen) for name, chosen in named if chosen]


def effect_rows(results: Sequence[PictureResult]) -> list[EffectRow]:
    """One row per effect in the order of a camera, of separable pictures, and of all pictures."""
    rows = []
    for kind in KINDS:
        of_kind = [result for result in results if result.case.kind == kind]
        if of_kind:
            rows.append(effect_row(kind, of_kind))
    return [*rows, *separable_rows(results), effect_row(TOGETHER, results)]


def graded_rows(results: Sequence[PictureResult]) -> list[EffectRow]:
    """One row per effect and strength."""
    rows = []
    for kind in KINDS:
        of_kind = [result for result in results if result.case.kind == kind]
        for strength in sorted({result.case.strength for result in of_kind}):
            at_strength = [result for result in of_kind if result.case.strength == strength]
            rows.append(effect_row(f"{kind}={strength:g}", at_strength))
    return rows


HEAD = (
    f"{'effect':<24}{'pictures':>9}{'unread':>7}{'meas.%':>8}{'ids':>6}{'places':>7}{'rms px':>9}{'z':>8}"
    f"{'median z':>9}{'beyond %':>9}{'95 %':>15}{'p50 ms':>8}{'p99 ms':>8}  reasons"
)


def rows_table(rows: Iterable[EffectRow]) -> str:
    """The printed table. ``ids`` and ``places`` count wrong ids and wrong positions."""
    return "\n".join([HEAD, *(_row_line(row) for row in rows)])


def _row_line(row: EffectRow) -> str:
    calibration = row.calibration
    beyond = calibration.beyond
    interval = f"{100 * beyond.low:.1f} to {100 * beyond.high:.1f}" if math.isfinite(beyond.low) else "-"
    reasons = ", ".join(f"{name} {count}" for name, count in row.reasons.items())
    return (
        f"{row.effect:<24}{row.pictures:>9}{row.unread:>7}{_number(100 * row.measured_share, 8, 1)}"
        f"{row.wrong_ids:>6}{row.wrong_places:>7}{_number(row.rms_px, 9, 4)}{_number(calibration.z.value, 8, 2)}"
        f"{_number(calibration.median_z, 9, 2)}{_number(100 * beyond.value, 9, 2)}{interval:>15}"
        f"{row.p50_ms:>8.1f}{row.p99_ms:>8.1f}  {reasons}"
    ).rstrip()


def _number(value: float, width: int, digits: int) -> str:
    return f"{value:>{width}.{digits}f}" if math.isfinite(value) else f"{'-':>{width}}"


def result_line(result: PictureResult) -> str:
    """The line of one picture."""
    calibration = summarise([result.d2])
    return (
        f"{result.case.name:<28} visible {result.visible:>4} measured {result.measured:>4} wrong ids "
        f"{result.wrong_ids:>3} wrong positions {result.wrong_places:>3} rms {_number(result.rms_px, 6, 4)} px "
        f"z {_number(calibration.z.value, 6, 2)}  {result.ms:.0f} ms  {result.reason}"
    ).rstrip()


def failure_lines(results: Iterable[PictureResult]) -> list[str]:
    """One line per picture that raised or has wrong markers, wrong ids first."""
    failed = [result for result in results if result.raised or result.wrong_ids or result.wrong_places]
    failed.sort(key=lambda result: (-result.raised, -result.wrong_ids, -result.wrong_places))
    lines = [
        f"RAISED   {result.case.name}  {result.reason}"
        if result.raised
        else f"WRONG    {result.wrong_ids:>4} ids {result.wrong_places:>4} positions  {result.case.name}"
        for result in failed[:MOST_FAILURES]
    ]
    return [*lines, f"and {len(failed) - MOST_FAILURES} more"] if len(failed) > MOST_FAILURES else lines
