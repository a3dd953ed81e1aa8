"""Reports of the stress suite: failures by severity, and one row per condition."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from benchmarks.frame.pooled import Columns, Figure, grouped, percentile, pooled_table, total
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scoring.calibration import stated_columns
from benchmarks.suites.scoring.reading import CaseResult
from benchmarks.suites.scoring.squares import MEASURED
from benchmarks.suites.stress.conditions import BY_NAME, KINDS
from benchmarks.suites.stress.kinds import StressCase

PROMISED_SHARE = 0.99
SLOWEST_RATIO = 1.3
Results = Sequence[CaseResult]
Conditions = Mapping[str, Results]


def _of_visible(name: str) -> Figure:
    """A count over the visible markers, or over the reported markers if none is visible."""

    def figure(results: Results) -> float:
        markers = total("score.visible")(results) or total("score.reported")(results)
        return total(f"score.{name}")(results) / markers if markers else 0.0

    return figure


def promised(results: Results) -> list[CaseResult]:
    """The images with a promise."""
    return [one for one in results if one.score.promised]


def kept_share(results: Results) -> float:
    """The share of the promised markers that is kept; NaN without a promise."""
    sure = total("score.sure")(promised(results))
    return total("score.kept")(promised(results)) / sure if sure else math.nan


def _promise(results: Results) -> str:
    count = len(promised(results))
    return f"{count}/{len(results)}" if 0 < count < len(results) else "yes" if count else "no"


def _pooled_rms(results: Results, name: str, counted: tuple[str, ...]) -> float:
    """The RMS of the images' RMS, by their counts of markers."""
    parts = [
        (getattr(one.score, name), sum(getattr(one.score, count) for count in counted)) for one in results
    ]
    known = [(value, count) for value, count in parts if count and math.isfinite(value)]
    number = sum(count for _, count in known)
    return math.sqrt(sum(value**2 * count for value, count in known) / number) if number else math.nan


def _reasons(results: Results) -> str:
    return ", ".join(sorted({one.reason for one in results if one.reason}))


STATED = stated_columns(lambda result: result.squares.get(MEASURED))
COLUMNS: Columns = {
    "group": (TEXT, lambda results: BY_NAME[results[0].case.kind].group),
    "promised": (TEXT, _promise),
    "visible": ("d", total("score.visible")),
    **{name: (".2%", _of_visible(name)) for name in ("measured", "repaired", "fitted", "lost")},
    **{name: ("d", total(f"score.{name}")) for name in ("wrong", "outside", "hidden")},
    "kept": (".2%", kept_share),
    "rms px": (".4f", partial(_pooled_rms, name="rms_px", counted=("measured",))),
    "repaired rms px": (".3f", partial(_pooled_rms, name="repaired_rms_px", counted=("repaired", "fitted"))),
    **{name: STATED[name] for name in ("z", "median z", "beyond")},
    "ms": (".1f", percentile("ms", 50)),
    "ratio": (".2f", percentile("ratio", 50)),
    "reason": (TEXT, _reasons),
}


def by_condition(results: Results) -> dict[str, list[CaseResult]]:
    """The images of each condition, in the order of their names; the conditions in the order of ``KINDS``."""
    found = grouped(sorted(results, key=lambda one: one.case.name), "case.condition")
    conditions = (StressCase(kind.name, step, "", 0).condition for kind in KINDS for step in kind.steps)
    return {condition: found[condition] for condition in conditions if condition in found}


def results_table(conditions: Conditions) -> Table:
    """One row per condition."""
    return pooled_table("conditions", "condition", COLUMNS, conditions)


def _severity(result: CaseResult) -> tuple[bool, int, float]:
    figures = result.score
    lost = 1 - figures.kept / figures.sure if figures.promised else 0.0
    return result.raised, figures.wrong, lost


def _failures(results: Results) -> Iterator[tuple[int, float, str]]:
    """Severity, its size, and a line."""
    worst = max(results, key=_severity).case.name
    raised, reasons, kept = total("raised")(results), _reasons(results), kept_share(results)
    wrong, outside, reported = (total(f"score.{name}")(results) for name in ("wrong", "outside", "reported"))
    if raised:
        yield 0, -raised, f"RAISED   {raised:>6} images    {worst}  {reasons}"
    if wrong:
        yield 1, -wrong, f"WRONG    {wrong:>6} of {reported:<6} {worst}"
    if outside:
        yield 2, -outside, f"OUTSIDE  {outside:>6} of {reported:<6} {worst}"
    if kept < PROMISED_SHARE:
        note = f"  ({reasons})" if reasons else ""
        yield 3, kept, f"LOST     {100 * kept:>6.2f} % kept     {worst}{note}"
    ratio = percentile("ratio", 50)(results)
    if ratio > SLOWEST_RATIO:
        slowest = max(results, key=lambda one: one.ratio if math.isfinite(one.ratio) else 0.0)
        yield 4, -ratio, f"SLOW     {ratio:>6.2f} x plain    {slowest.case.name}"


def failure_lines(conditions: Conditions) -> list[str]:
    """One line per failure, the severest first: raised, wrong, outside the image, promise broken, slow."""
    found = [failure for results in conditions.values() for failure in _failures(results)]
    return [line for _, _, line in sorted(found)]


def result_line(result: CaseResult) -> str:
    """The line of one image."""
    figures = result.score
    return (
        f"{result.case.name:<44} visible {figures.visible:>5} measured {figures.measured:>5} repaired "
        f"{figures.repaired:>4} fitted {figures.fitted:>4} lost {figures.lost:>5} outside {figures.outside:>3} "
        f"WRONG {figures.wrong:>4}  {'promised' if figures.promised else 'not promised'}  "
        f"{result.ms:.0f} ms  {result.reason}"
    )


def summary_text(conditions: Conditions) -> str:
    """One line of totals and one of promises."""
    every = [one for results in conditions.values() for one in results]
    empty = [one for one in every if BY_NAME[one.case.kind].group == "nothing"]
    kept = [share for share in map(kept_share, conditions.values()) if math.isfinite(share)]
    slow = sum(percentile("ratio", 50)(results) > SLOWEST_RATIO for results in conditions.values())

    def count(name: str, results: Results = every) -> Any:
        return total(f"score.{name}")(results)

    return (
        f"{len(conditions)} conditions, {len(every)} images, {count('visible')} visible markers\n"
        f"{count('wrong')} wrong of {count('reported')} reported, {count('wrong', empty)} of them on "
        f"{len(empty)} images without a pattern\n"
        f"promise (99 % measured or repaired) held in {sum(share >= PROMISED_SHARE for share in kept)} of "
        f"{len(kept)} conditions, {100 * kept_share(every):.2f} % together; "
        f"slower than {SLOWEST_RATIO} x plain: {slow}"
    )
