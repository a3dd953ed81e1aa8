"""Sweeps: one condition changes step by step; steps that are refused between two that are read, and wrong ids.

    python -m benchmarks.sweeps [--quick] [--processes N] [--json FILE]

Eight sets of inks, three seeds of noise each; 40 lamps (black bodies of 2,000 to 15,000 K, then triples of a red, a
green and a blue LED round the circle of hues) by spectra, with color matrix and white balance of daylight; black
raised from 0 to 90 of 255; exposure from 0.3 to 3. A reader that depends on light smoothly reads one stretch of a line.
"read" are pictures with markers and no reason.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from benchmarks.suites.sweeps.lines import BLACKS, EXPOSURES, LAMPS, SEEDS, LineResult, make_lines, read_line
from benchmarks.support.command import publishing_parser
from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.workers import worker_pool

HEAD = f"{'line':<12}{'steps':>7}{'read':>7}{'between':>9}{'one in':>8}{'ids':>5}  reasons"


def row_line(name: str, results: Sequence[LineResult]) -> str:
    """The lines of a kind: steps, read ones, refused ones between two read ones, wrong ids."""
    reasons = Counter(reason for result in results for reason in result.reasons)
    read, steps, between = (
        reasons.pop("", 0),
        sum(len(r.reasons) for r in results),
        sum(r.between for r in results),
    )
    refused = ", ".join(f"{reason} {count}" for reason, count in sorted(reasons.items()))
    one_in = f"{steps / between:.0f}" if between else "-"
    wrong = sum(result.wrong_ids for result in results)
    return f"{name:<12}{steps:>7}{read:>7}{between:>9}{one_in:>8}{wrong:>5}  {refused}".rstrip()


def broken_line(result: LineResult) -> str:
    """A line with refused steps between read ones; ``.`` read, ``x`` refused."""
    steps = "".join("x" if reason else "." for reason in result.reasons)
    line = result.line
    return f"{line.kind}, inks {line.inks}, seed {line.seed}: {steps}"


def main(arguments: list[str] | None = None) -> int:
    """Print a row for each kind of line and the broken lines. Returns 1 if an id is wrong."""
    parser = publishing_parser("sweeps", __doc__, "lines, of one seed", publish=False)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    with worker_pool(options.processes) as pool:
        results = list(pool.map(read_line, make_lines(1 if options.quick else SEEDS)))
    print(HEAD)
    for kind in (LAMPS, BLACKS, EXPOSURES):
        print(row_line(kind, [result for result in results if result.line.kind == kind]))
    print(row_line("together", results))
    print("\n".join(broken_line(result) for result in results if result.between))
    print(f"{conditions_text()}; {time.perf_counter() - started:.0f} s")
    if options.json:
        write_json(options.json, {"lines": [asdict(result) for result in results]})
    return int(any(result.wrong_ids for result in results))
