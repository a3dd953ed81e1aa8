"""Rows and tables of path-traced pictures: by family, pooled, and errors over covariances."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.suites.photoreal.pictures import NO_PATTERN
from benchmarks.suites.photoreal.reading import PLACES, TracedResult
from benchmarks.suites.scoring.calibration import Calibration, calibration_head, calibration_line, summarise

POOLS = {"A to H, O": "ABCDEFGHO", "A to H": "ABCDEFGH", "I, L": "IL", "all but N": "ABCDEFGHOIL"}
NAME_WIDTH = 40
HEAD = (
    f"{'family':<11}{'pictures':>9}{'read':>6}{'visible':>9}{'meas.%':>8}{'ids':>5}{'places':>7}{'invented':>9}"
    f"{'reasons':>8}{'p50 ms':>8}{'max ms':>8}  reasons"
)


@dataclass(frozen=True)
class FamilyRow:
    """Pooled pictures. Counts are of markers, but for ``read`` and ``right_reasons``.

    Attributes:
        name: of the family or the pool.
        read: pictures with any marker.
        invented: reported markers of pictures without a pattern.
        right_reasons: pictures whose reason, or its absence, agrees with the truth.
        reasons: pictures by reason.
        p50_ms, most_ms: processor time of a picture.
    """

    name: str
    pictures: int
    read: int
    visible: int
    measured: int
    wrong_ids: int
    wrong_places: int
    invented: int
    right_reasons: int
    reasons: dict[str, int]
    p50_ms: float
    most_ms: float


def family_row(name: str, results: Sequence[TracedResult]) -> FamilyRow:
    """The row of some pictures; at least one."""
    times_ms = [result.ms for result in results]
    return FamilyRow(
        name=name,
        pictures=len(results),
        read=sum(result.is_read for result in results),
        visible=sum(result.visible for result in results),
        measured=sum(result.measured for result in results),
        wrong_ids=sum(result.wrong_ids for result in results),
        wrong_places=sum(result.wrong_places for result in results),
        invented=sum(result.reported for result in results if result.picture.family == NO_PATTERN),
        right_reasons=sum(result.is_reason_right for result in results),
        reasons=dict(sorted(Counter(result.reason for result in results if result.reason).items())),
        p50_ms=float(np.median(times_ms)),
        most_ms=max(times_ms),
    )


def family_rows(results: Sequence[TracedResult]) -> list[FamilyRow]:
    """A row for each family that has pictures, then the pools."""
    by_family: dict[str, list[TracedResult]] = {}
    for result in results:
        by_family.setdefault(result.picture.family, []).append(result)
    rows = [family_row(name, by_family[name]) for name in sorted(by_family)]
    for name, families in POOLS.items():
        pooled = [result for result in results if result.picture.family in families]
        if pooled:
            rows.append(family_row(name, pooled))
    return rows


def rows_table(rows: Sequence[FamilyRow]) -> str:
    """The rows as text."""
    return "\n".join([HEAD, *(_row_line(row) for row in rows)])


def _row_line(row: FamilyRow) -> str:
    measured = f"{100 * row.measured / row.visible:.1f}" if row.visible else "-"
    reasons = ", ".join(f"{reason} {count}" for reason, count in row.reasons.items())
    line = (
        f"{row.name:<11}{row.pictures:>9}{row.read:>6}{row.visible:>9}{measured:>8}{row.wrong_ids:>5}"
        f"{row.wrong_places:>7}{row.invented:>9}{row.right_reasons:>8}{row.p50_ms:>8.1f}{row.most_ms:>8.1f}"
    )
    return f"{line}  {reasons}".rstrip()


def calibrations(results: Sequence[TracedResult]) -> dict[str, Calibration]:
    """Errors over covariances by ``PLACES``, without places of no picture."""
    found = {
        place: summarise([result.squares[place] for result in results if place in result.squares])
        for place in PLACES
    }
    return {place: calibration for place, calibration in found.items() if calibration.count}


def calibration_table(found: dict[str, Calibration]) -> str:
    """A line for each of ``PLACES``."""
    lines = [calibration_line(place, calibration, NAME_WIDTH) for place, calibration in found.items()]
    return "\n".join([calibration_head("errors over covariances, measured", NAME_WIDTH), *lines])


def picture_line(result: TracedResult) -> str:
    """One picture on one line."""
    wrong = f", wrong ids {result.wrong_ids}, positions {result.wrong_places}"
    squares = ", ".join(
        f"z {summarise([d2]).z.value:.2f} ({place})" for place, d2 in result.squares.items() if len(d2)
    )
    reason = f", {result.reason}" if result.reason else ""
    reason += "" if result.is_reason_right else " (wrong reason)"
    return (
        f"{result.picture.name:<22} {result.measured} of {result.visible} measured, {result.reported} reported"
        f"{wrong}{', ' if squares else ''}{squares}, {result.ms:.0f} ms{reason}  [{', '.join(result.picture.effects)}]"
    )


def measured_record(results: Sequence[TracedResult]) -> dict[str, Any]:
    """Rows, calibrations and pictures as JSON knows them."""
    return {
        "table": f"{rows_table(family_rows(results))}\n\n{calibration_table(calibrations(results))}",
        "rows": [asdict(row) for row in family_rows(results)],
        "calibration": {place: asdict(found) for place, found in calibrations(results).items()},
        "pictures": [
            {
                "name": result.picture.name,
                "visible": result.visible,
                "measured": result.measured,
                "reported": result.reported,
                "wrong_ids": result.wrong_ids,
                "wrong_places": result.wrong_places,
                "unmeasured": list(result.unmeasured),
                "reason": result.reason,
                "is_reason_right": result.is_reason_right,
                "ms": result.ms,
            }
            for result in results
        ],
    }
