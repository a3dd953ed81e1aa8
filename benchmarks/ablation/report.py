"""What the trials found, as docs/measured/ablation.json and as tables.

A row is a rule that was ever tried, on the pictures of one seed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.ablation.comparison import Comparison
from benchmarks.suites.ablation.rules import BY_NAME

JUDGED = ("wrong", "lost", "rms_px", "typical_px", "departure", "beyond", "ms")


def comparison_row(found: Comparison) -> dict[str, Any]:
    """The figures of a rule as they are written."""
    changes = {name: getattr(found, name)._asdict() for name in JUDGED}
    named = {"rule": found.rule.name, "stage": found.rule.stage, "kind": found.rule.kind}
    return {**found._asdict(), **changes, **named, "verdict": found.verdict}


def merged(earlier: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """The rows of a run beside those of the rules that were tried earlier."""
    own = [{**row, "command": new["command"], "seed": new["seed"]} for row in new["rows"]]
    return {"conditions": new["conditions"], "rows": merged_rows(earlier.get("rows", []), own)}


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


def rules_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """What is counted; changes in percent of the figure with the rule, with their intervals."""
    columns = dict.fromkeys(
        ("rule", "of", "seed", "pictures", "changed", "wrong ids", "wrong positions", "lost, %", "RMS, %")
        + ("typical RMS, %", "by the figures"),
        TEXT,
    )
    return Table(
        "rules",
        columns,
        [
            (
                row["rule"], row["stage"], str(row["seed"]), str(row["pictures"]), str(row["touched"]),
                *("{} > {}".format(*row[name]) for name in ("wrong_ids", "wrong_positions")),
                *(_share(row[name]) for name in ("lost", "rms_px", "typical_px")), row["verdict"],
            )
            for row in rows
        ],
    )  # fmt: skip


def times_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """True errors and time, of the rules that are judged by these."""
    columns = dict.fromkeys(("rule", "seed", "z", "beyond three deviations, %", "processor time"), TEXT)
    return Table(
        "errors and time",
        columns,
        [
            (
                row["rule"], str(row["seed"]), "{:.2f} > {:.2f}".format(*row["z"]),
                f"{100 * row['beyond']['full']:.2f} > {100 * row['beyond']['without']:.2f}",
                f"{row['time_ratio']:.2f}",
            )
            for row in rows
            if row["kind"] == "errors and time" and "beyond" in row
        ],
    )  # fmt: skip


def page(measured: Mapping[str, Any]) -> Page:
    """The tables of docs/explanation/rules.md from the content of docs/measured/ablation.json."""
    rows = measured["rows"]
    table = rules_table(rows)
    fates = [(*row, "stays" if row[0] in BY_NAME else "deleted") for row in table.rows]
    ruled = Table("", {**table.columns, "today": TEXT}, fates).markdown()
    commands = dict.fromkeys(f"`{row['command']}`" for row in rows)
    written = "\n".join(["Written by", *commands])
    return Page({"ablation": f"{ruled}\n\n{times_table(rows).markdown()}\n\n{written}"})


def _share(change: Mapping[str, float | None]) -> str:
    """The difference and its interval, in percent of the figure with the rule; "-" where either is nothing."""
    values = [change[name] for name in ("full", "without", "low", "high")]
    full, without, low, high = (math.nan if value is None else value for value in values)
    if not full or math.isnan(full + without + low + high):
        return "-"
    unit = 100 / full
    return f"{unit * (without - full):+.1f} [{unit * low:+.1f}, {unit * high:+.1f}]"
