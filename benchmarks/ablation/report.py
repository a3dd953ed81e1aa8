"""What the trials found, as docs/measured/ablation.json and as tables.

A row is a rule that was ever tried, on the pictures of one seed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.frame.published import read_measured
from benchmarks.suites.ablation.comparison import Comparison
from benchmarks.suites.ablation.rules import BY_NAME
from benchmarks.support.command import write_published

NAME = "ablation"
JUDGED = ("wrong", "lost", "rms_px", "typical_px", "departure", "beyond", "ms")


def comparison_row(found: Comparison) -> dict[str, Any]:
    """The figures of a rule as they are written."""
    changes = {name: getattr(found, name)._asdict() for name in JUDGED}
    named = {"rule": found.rule.name, "stage": found.rule.stage, "kind": found.rule.kind}
    return {**found._asdict(), **changes, **named, "verdict": found.verdict}


def publish(rows: Iterable[Mapping[str, Any]], command: str, seed: int) -> list[Path]:
    """Put the rows beside those of the rules that were tried earlier. Returns the written files."""
    earlier = read_measured(NAME).get("rows", [])
    own = [{**row, "command": command, "seed": seed} for row in rows]
    measured = {"rows": merged_rows(earlier, own)}
    return write_published(NAME, measured, documentation_blocks(measured))


def merged_rows(
    earlier: Iterable[Mapping[str, Any]], rows: Iterable[Mapping[str, Any]]
) -> list[Mapping[str, Any]]:
    """The rows of a rule one after another, the rules in the order of their first row.

    A row replaces the earlier one of the same rule and seed.
    """
    by_rule: dict[str, dict[int, Mapping[str, Any]]] = {}
    for row in (*earlier, *rows):
        of_rule = by_rule.setdefault(row["rule"], {})
        of_rule.pop(row["seed"], None)
        of_rule[row["seed"]] = row
    return [row for of_rule in by_rule.values() for row in of_rule.values()]


def documentation_blocks(measured: Mapping[str, Any]) -> dict[str, str]:
    """The tables of docs/explanation/rules.md from the content of docs/measured/ablation.json."""
    rows = measured["rows"]
    lines = [
        "| rule | of | seed | pictures | changed | wrong ids | wrong positions | lost, % | RMS, % | typical RMS, % "
        "| by the figures | rule |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
        *(_line(row) for row in rows),
    ]
    timed = [row for row in rows if row["kind"] == "errors and time" and "beyond" in row]
    more = [
        "| rule | seed | z | beyond three deviations, % | processor time |",
        "|---|---|---|---|---|",
        *(
            f"| {row['rule']} | {row['seed']} | {row['z'][0]:.2f} > {row['z'][1]:.2f} "
            f"| {100 * row['beyond']['full']:.2f} > {100 * row['beyond']['without']:.2f} "
            f"| {row['time_ratio']:.2f} |"
            for row in timed
        ),
    ]
    commands = dict.fromkeys(row["command"] for row in rows)
    written = ["Written by", *(f"`{command}`" for command in commands)]
    return {NAME: "\n".join([*lines, "", *more, "", "\n".join(written)])}


def _line(row: Mapping[str, Any]) -> str:
    fate = "stays" if row["rule"] in BY_NAME else "deleted"
    counts = (f"{before} > {after}" for before, after in (row["wrong_ids"], row["wrong_positions"]))
    shares = (_share(row[name]) for name in ("lost", "rms_px", "typical_px"))
    cells = (
        row["rule"],
        row["stage"],
        row["seed"],
        row["pictures"],
        row["touched"],
        *counts,
        *shares,
        row["verdict"],
        fate,
    )
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def _share(change: Mapping[str, float | None]) -> str:
    """The difference and its interval, in percent of the figure with the rule; "-" where nothing is left to measure."""
    values = [change[name] for name in ("full", "without", "low", "high")]
    full, without, low, high = (math.nan if value is None else value for value in values)
    if math.isnan(full + without + low + high):
        return "-"
    unit = 100 / full
    return f"{unit * (without - full):+.1f} [{unit * low:+.1f}, {unit * high:+.1f}]"
