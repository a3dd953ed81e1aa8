"""Reports of the stress suite: failures by severity, and one row per condition."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scoring.calibration import Calibration, summarise
from benchmarks.suites.scoring.reading import CaseResult
from benchmarks.suites.scoring.squares import MEASURED
from benchmarks.suites.stress.kinds import ConditionKind

PROMISED_SHARE = 0.99
SLOWEST_RATIO = 1.3
COLUMNS = {
    "condition": TEXT, "group": TEXT, "promised": TEXT, "visible": "d", "measured": ".2%", "repaired": ".2%",
    "fitted": ".2%", "lost": ".2%", "wrong": "d", "outside": "d", "hidden": "d", "kept": ".2%", "rms px": ".4f",
    "repaired rms px": ".3f", "z": ".2f", "median z": ".2f", "beyond": ".2%", "ms": ".1f", "ratio": ".2f",
    "reason": TEXT,
}  # fmt: skip


@dataclass(frozen=True)
class ConditionRow:
    """All images of one condition. Counts are of markers, see ``MarkerScore``; times are medians.

    Attributes:
        promised: yes, no, or the number of images with a promise.
        calibration: errors of measured markers over their covariances.
        worst, slowest: names of images.
    """

    condition: str
    group: str
    images: int
    visible: int
    measured: int
    repaired: int
    fitted: int
    lost: int
    reported: int
    wrong: int
    outside: int
    hidden: int
    sure: int
    kept: int
    promised: str
    rms_px: float
    repaired_rms_px: float
    calibration: Calibration
    ms: float
    ratio: float
    raised: int
    reasons: str
    worst: str
    slowest: str

    @property
    def kept_share(self) -> float:
        """The share of the promised markers that is kept."""
        return self.kept / self.sure if self.sure else math.nan

    def share(self, name: str) -> float:
        """A count over the visible markers, or over the reported markers if none is visible."""
        total = self.visible or self.reported
        return float(getattr(self, name)) / total if total else 0.0


def condition_rows(results: Iterable[CaseResult], kinds: Sequence[ConditionKind]) -> list[ConditionRow]:
    """One row per condition, in the order of the conditions."""
    results = list(results)
    rows = []
    for kind in kinds:
        for step in kind.steps:
            of_condition = [r for r in results if (r.case.kind, r.case.step) == (kind.name, step)]
            if of_condition:
                rows.append(_condition_row(kind, sorted(of_condition, key=lambda r: r.case.name)))
    return rows


def _condition_row(kind: ConditionKind, of_condition: list[CaseResult]) -> ConditionRow:
    promised = [r for r in of_condition if r.score.promised]
    counted = ("visible", "measured", "repaired", "fitted", "lost", "reported", "wrong", "outside", "hidden")
    reasons = sorted({r.reason for r in of_condition if r.reason})
    return ConditionRow(
        condition=of_condition[0].case.condition,
        group=kind.group,
        images=len(of_condition),
        **{name: sum(getattr(r.score, name) for r in of_condition) for name in counted},
        sure=sum(r.score.sure for r in promised),
        kept=sum(r.score.kept for r in promised),
        promised=f"{len(promised)}/{len(of_condition)}"
        if 0 < len(promised) < len(of_condition)
        else ("yes" if promised else "no"),
        rms_px=_pooled_rms([(r.score.rms_px, r.score.measured) for r in of_condition]),
        repaired_rms_px=_pooled_rms(
            [(r.score.repaired_rms_px, r.score.repaired + r.score.fitted) for r in of_condition]
        ),
        calibration=summarise([r.squares[MEASURED] for r in of_condition if r.squares]),
        ms=_median([r.ms for r in of_condition]),
        ratio=_median([r.ratio for r in of_condition]),
        raised=sum(r.raised for r in of_condition),
        reasons=", ".join(reasons),
        worst=max(of_condition, key=_severity).case.name,
        slowest=max(of_condition, key=lambda r: r.ratio if math.isfinite(r.ratio) else 0.0).case.name,
    )


def _severity(result: CaseResult) -> tuple[bool, int, float]:
    figures = result.score
    lost = 1 - figures.kept / figures.sure if figures.promised else 0.0
    return result.raised, figures.wrong, lost


def _pooled_rms(parts: list[tuple[float, int]]) -> float:
    """The RMS of several RMS with their counts."""
    known = [(value, count) for value, count in parts if count and math.isfinite(value)]
    total = sum(count for _, count in known)
    return math.sqrt(sum(value**2 * count for value, count in known) / total) if total else math.nan


def _median(values: list[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.median(known)) if known else math.nan


def failure_lines(rows: list[ConditionRow]) -> list[str]:
    """One line per failure, the severest first: raised, wrong, outside the image, promise broken, slow."""
    found: list[tuple[int, float, str]] = []
    for row in rows:
        if row.raised:
            found.append((0, -row.raised, f"RAISED   {row.raised:>6} images    {row.worst}  {row.reasons}"))
        if row.wrong:
            found.append((1, -row.wrong, f"WRONG    {row.wrong:>6} of {row.reported:<6} {row.worst}"))
        if row.outside:
            found.append((2, -row.outside, f"OUTSIDE  {row.outside:>6} of {row.reported:<6} {row.worst}"))
        if row.sure and row.kept_share < PROMISED_SHARE:
            note = f"  ({row.reasons})" if row.reasons else ""
            found.append(
                (3, row.kept_share, f"LOST     {100 * row.kept_share:>6.2f} % kept     {row.worst}{note}")
            )
        if row.ratio > SLOWEST_RATIO:
            found.append((4, -row.ratio, f"SLOW     {row.ratio:>6.2f} x plain    {row.slowest}"))
    return [line for _, _, line in sorted(found)]


def results_table(rows: Sequence[ConditionRow]) -> Table:
    """The table of all rows."""
    shares = ("measured", "repaired", "fitted", "lost")
    return Table(
        "conditions",
        COLUMNS,
        [
            (
                row.condition, row.group, row.promised, row.visible, *(row.share(name) for name in shares), row.wrong,
                row.outside, row.hidden, row.kept_share, row.rms_px, row.repaired_rms_px, row.calibration.z.value,
                row.calibration.median_z, row.calibration.beyond.value, row.ms, row.ratio, row.reasons,
            )
            for row in rows
        ],
    )  # fmt: skip


def result_line(result: CaseResult) -> str:
    """The line of one image."""
    figures = result.score
    return (
        f"{result.case.name:<44} visible {figures.visible:>5} measured {figures.measured:>5} repaired "
        f"{figures.repaired:>4} fitted {figures.fitted:>4} lost {figures.lost:>5} outside {figures.outside:>3} "
        f"WRONG {figures.wrong:>4}  {'promised' if figures.promised else 'not promised'}  "
        f"{result.ms:.0f} ms  {result.reason}"
    )


def summary_text(rows: list[ConditionRow]) -> str:
    """One line of totals and one of promises."""
    total = {
        name: sum(getattr(row, name) for row in rows)
        for name in ("images", "visible", "reported", "wrong", "sure", "kept")
    }
    empty = [row for row in rows if row.group == "nothing"]
    promised = [row for row in rows if row.sure]
    kept_promises = sum(row.kept_share >= PROMISED_SHARE for row in promised)
    slow = sum(row.ratio > SLOWEST_RATIO for row in rows)
    images = sum(row.images for row in empty)
    return (
        f"{len(rows)} conditions, {total['images']} images, {total['visible']} visible markers\n"
        f"{total['wrong']} wrong of {total['reported']} reported, {sum(row.wrong for row in empty)} of them on "
        f"{images} images without a pattern\n"
        f"promise (99 % measured or repaired) held in {kept_promises} of {len(promised)} conditions, "
        f"{100 * total['kept'] / max(total['sure'], 1):.2f} % together; slower than {SLOWEST_RATIO} x plain: {slow}"
    )
