"""Sweeps: one condition changes step by step; steps that are refused between two that are read, and wrong ids.

Eight sets of inks, three seeds of noise each; 40 lamps (black bodies of 2,000 to 15,000 K, then triples of a red, a
green and a blue LED round the circle of hues) by spectra, with color matrix and white balance of daylight; black
raised from 0 to 90 of 255; exposure from 0.3 to 3. A reader that depends on light smoothly reads one stretch of a line.
"read" are pictures with markers and no reason.
"""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.pooled import Columns, counted, grouped, pooled_table, share, total
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.sweeps.lines import SEEDS, LineResult, make_lines, read_line

COLUMNS: Columns = {
    "steps": ("d", total("steps")),
    "read": ("d", total("read")),
    "between": ("d", total("between")),
    "one in": (".0f", share("steps", "between")),
    "ids": ("d", total("wrong_ids")),
    "reasons": (TEXT, lambda results: counted(word for result in results for word in result.reasons)),
}


def lines_table(results: Sequence[LineResult]) -> Table:
    """The lines of each kind: steps, read ones, refused ones between two read ones, wrong ids."""
    return pooled_table("sweeps", "line", COLUMNS, {**grouped(results, "line.kind"), "together": results})


def broken_line(result: LineResult) -> str:
    """A line with refused steps between read ones; ``.`` read, ``x`` refused."""
    steps = "".join("x" if reason else "." for reason in result.reasons)
    line = result.line
    return f"{line.kind}, inks {line.inks}, seed {line.seed}: {steps}"


def measure(quick: bool = False, processes: int = PROCESSES) -> Shown:
    """A row for each kind of line and the broken lines; fails if an id is wrong.

    Args:
        quick: lines of one seed.
    """
    results = results_of(read_line, make_lines(1 if quick else SEEDS), processes, chunk=1)
    yield lines_table(results)
    yield from (broken_line(result) for result in results if result.between)
    return Found(failed=any(result.wrong_ids for result in results))


main = Experiment("sweeps", measure)
main.run_as(__name__)
