"""Views without the white cell: read where the visible cells fit one motion of the pattern only, refused elsewhere.

    python -m benchmarks.views [--views N] [--seed S] [--processes N] [--json FILE]

Random crops of patterns of 5 to 11 layers, tilted up to 30 degrees; crops with covered spots and scratches. The white
cell is covered or out of view. By the truth the cells that are wholly visible fit one motion (a turn and a shift that
keep colors; the side is told), or several. Of several only one may be left where cells are counted of which a quarter
or more is visible; else nothing but a guess could number them. The default seed comes from the commit's hash.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from benchmarks.suites.camera.cases import commit_seed
from benchmarks.suites.views.views import KINDS, View, ViewResult, read_view
from benchmarks.support.command import publishing_parser
from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.workers import worker_pool

VIEWS, FEW_VIEWS = 300, 30
HEAD = f"{'views':<32}{'count':>7}{'share %':>9}{'read':>7}{'read %':>8}{'wrong ids':>11}{'wrong views':>13}  reasons"


def row_line(name: str, results: Sequence[ViewResult], of: int) -> str:
    """Views of one kind: how many of all, read ones, wrong ids, and views with wrong ids."""
    read = sum(result.reported > 0 for result in results)
    reasons = Counter(result.reason for result in results if result.reason)
    told = ", ".join(f"{reason} {count}" for reason, count in sorted(reasons.items()))
    share, read_share = (
        f"{100 * part / whole:.1f}" if whole else "-"
        for part, whole in ((len(results), of), (read, len(results)))
    )
    ids, wrong = sum(result.wrong_ids for result in results), sum(result.wrong_ids > 0 for result in results)
    return (
        f"{name:<32}{len(results):>7}{share:>9}{read:>7}{read_share:>8}{ids:>11}{wrong:>13}  {told}".rstrip()
    )


def main(arguments: list[str] | None = None) -> int:
    """Print three rows for each kind of view. Returns 1 if an id is wrong."""
    parser = publishing_parser("views", __doc__, "views", publish=False)
    parser.add_argument("--views", type=int, metavar="N", help=f"of each kind; else {VIEWS}")
    parser.add_argument("--seed", type=int, metavar="S", help="repeat a run; else the commit's hash gives it")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    seed = commit_seed() if options.seed is None else options.seed
    count = options.views or (FEW_VIEWS if options.quick else VIEWS)
    views = [View(kind, seed, number) for kind in KINDS for number in range(count)]
    with worker_pool(options.processes) as pool:
        results = list(pool.map(read_view, views, chunksize=4))
    print(f"seed {seed}\n{HEAD}")
    for kind in KINDS:
        of_kind = [result for result in results if result.view.kind == kind]
        one = [result for result in of_kind if result.motions == 1]
        parts = [r for r in of_kind if r.motions != 1 and r.motions_of_parts == 1]
        several = [r for r in of_kind if r.motions != 1 and r.motions_of_parts != 1]
        for name, results_of_row in (("one motion", one), ("one by cut cells", parts), ("several", several)):
            print(row_line(f"{kind}, {name}", results_of_row, count))
    for result in results:
        if result.wrong_ids:
            print(
                f"{result.view.kind}/{result.view.number}: {result.wrong_ids} wrong ids, {result.motions} motions"
            )
    print(f"{conditions_text()}; {time.perf_counter() - started:.0f} s")
    if options.json:
        write_json(options.json, {"seed": seed, "views": [asdict(result) for result in results]})
    return int(any(result.wrong_ids for result in results))
