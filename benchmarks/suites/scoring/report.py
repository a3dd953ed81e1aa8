"""Reports of the stress suite: failures by severity, one row per condition, a plot, a file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.suites.scoring.calibration import Calibration, calibration_head, summarise
from benchmarks.suites.scoring.reading import CaseResult
from benchmarks.suites.scoring.squares import MEASURED, calibration_lines
from benchmarks.suites.stress.kinds import ConditionKind
from benchmarks.support.machine import null_for_nan
from cmpdesign.files.atomic import staged_file, write_file

PROMISED_SHARE = 0.99
SLOWEST_RATIO = 1.3
COLORS = {
    "measured": "#3a8f5c",
    "repaired": "#7cc6e8",
    "fitted": "#3b6fb5",
    "lost": "#d9d9d9",
    "wrong": "#d62728",
}


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


HEAD = (
    f"{'condition':<38}{'prom.':>6}{'visible':>8}{'meas.%':>8}{'rep.%':>7}{'fit.%':>7}{'lost%':>7}{'wrong':>7}"
    f"{'outs.':>6}{'hidden':>7}{'kept%':>8}{'rms px':>9}{'rep.rms':>9}{'z':>7}{'med.z':>7}"
    f"{'bey.%':>8}{'ms':>8}{'ratio':>7}  reason"
)


def results_table(rows: list[ConditionRow]) -> str:
    """The table of all rows, with headings by group."""
    lines, group = [HEAD], ""
    for row in rows:
        if row.group != group:
            group = row.group
            lines.append(f"-- {group}")
        lines.append(_row_line(row))
    return "\n".join(lines)


def _row_line(row: ConditionRow) -> str:
    shares = "".join(
        f"{100 * row.share(name):>{width}.2f}"
        for name, width in (("measured", 8), ("repaired", 7), ("fitted", 7), ("lost", 7))
    )
    return (
        f"{row.condition:<38}{row.promised:>6}{row.visible:>8}{shares}{row.wrong:>7}{row.outside:>6}{row.hidden:>7}"
        f"{_or_dash(100 * row.kept_share, 8, 2)}{_or_dash(row.rms_px, 9, 4)}{_or_dash(row.repaired_rms_px, 9, 3)}"
        f"{_or_dash(row.calibration.z.value, 7, 2)}{_or_dash(row.calibration.median_z, 7, 2)}"
        f"{_or_dash(100 * row.calibration.beyond.value, 8, 2)}"
        f"{_or_dash(row.ms, 8, 1)}{_or_dash(row.ratio, 7, 2)}  {row.reasons}"
    )


def _or_dash(value: float, width: int, digits: int) -> str:
    return f"{value:>{width}.{digits}f}" if math.isfinite(value) else f"{'-':>{width}}"


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


def calibration_table(results: Sequence[CaseResult]) -> str:
    """Errors over covariances, pooled over all images, by how positions were found."""
    lines = calibration_lines("all images", [result.squares for result in results])
    return "\n".join([calibration_head("errors over covariances"), *lines])


def write_json(rows: list[ConditionRow], path: Path) -> None:
    """Write every row as an object, NaN as null."""
    columns = [null_for_nan(asdict(row)) for row in rows]
    write_file(path, json.dumps(columns, indent=1) + "\n")


def plot_conditions(rows: list[ConditionRow], kinds: Sequence[ConditionKind], path: Path) -> None:
    """Plot one panel per kind, one bar per step: shares of the visible markers; wrong ones in red, with their count."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    shown = [kind for kind in kinds if any(_is_of_kind(row, kind) for row in rows)]
    across = 9
    down = math.ceil(len(shown) / across)
    figure, axes = pyplot.subplots(down, across, figsize=(2.1 * across, 1.75 * down), squeeze=False)
    for panel in axes.ravel()[len(shown) :]:
        panel.set_visible(False)
    for kind, panel in zip(shown, axes.ravel(), strict=False):
        _draw_panel(panel, kind, [row for row in rows if _is_of_kind(row, kind)])
    handles = [matplotlib.patches.Patch(color=color, label=name) for name, color in COLORS.items()]
    figure.legend(handles=handles, loc="upper center", ncols=len(handles), frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.98))
    with staged_file(path) as staged:
        figure.savefig(
            staged,
            format=path.suffix[1:] or "png",
            dpi=110,
            metadata={"Software": None} if path.suffix == ".png" else None,
        )
    pyplot.close(figure)


def _is_of_kind(row: ConditionRow, kind: ConditionKind) -> bool:
    return row.condition.rpartition("=")[0] == kind.name


def _draw_panel(panel: Any, kind: ConditionKind, rows: list[ConditionRow]) -> None:
    bottom = np.zeros(len(rows))
    for name in ("measured", "repaired", "fitted", "lost"):
        share = np.array([row.share(name) for row in rows])
        panel.bar(range(len(rows)), share, bottom=bottom, color=COLORS[name], width=0.85)
        bottom += share
    for place, row in enumerate(rows):
        if row.wrong:
            panel.bar(place, max(min(row.share("wrong"), 1.0), 0.04), color=COLORS["wrong"], width=0.85)
            panel.text(place, 0.5, str(row.wrong), ha="center", va="center", fontsize=7, weight="bold")
    panel.set_title(kind.name, fontsize=7, pad=2)
    panel.set_xticks(range(len(rows)), [row.condition.rpartition("=")[2] for row in rows], fontsize=6)
    panel.set_xlabel(kind.unit, fontsize=6, labelpad=1)
    panel.set_ylim(0, 1)
    panel.set_yticks([])
