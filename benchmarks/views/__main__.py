"""Views without the white cell: read where the visible cells fit one motion of the pattern only, refused elsewhere.

Random crops of patterns of 5 to 11 layers, tilted up to 30 degrees; crops with covered spots and scratches. The white
cell is covered or out of view. By the truth the cells that are wholly visible fit one motion (a turn and a shift that
keep colors; the side is told), or several. Of several only one may be left where cells are counted of which a quarter
or more is visible; else nothing but a guess could number them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from benchmarks.frame.experiment import COMMIT, Experiment, Found, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.views.views import KINDS, DrawnView, ViewResult, read_view

COLUMNS = {
    "views": TEXT, "count": "d", "share": ".1%", "read": "d", "read share": ".1%", "wrong ids": "d",
    "wrong views": "d", "reasons": TEXT,
}  # fmt: skip


def kind_row(name: str, results: Sequence[ViewResult], of: int) -> tuple[object, ...]:
    """Views of one kind: how many of all, read ones, wrong ids, and views with wrong ids."""
    read = sum(result.reported > 0 for result in results)
    reasons = Counter(result.reason for result in results if result.reason)
    told = ", ".join(f"{reason} {count}" for reason, count in sorted(reasons.items()))
    read_share = read / len(results) if results else None
    ids = [result.wrong_ids for result in results]
    return name, len(results), len(results) / of, read, read_share, sum(ids), sum(map(bool, ids)), told


def measure(views: int = 300, seed: int = COMMIT, processes: int = PROCESSES) -> Shown:
    """Three rows for each kind of view; fails if an id is wrong.

    Args:
        views: of each kind.
    """
    drawn = [DrawnView(kind, seed, number) for kind in KINDS for number in range(views)]
    results, rows = results_of(read_view, drawn, processes), []
    for kind in KINDS:
        of_kind = [result for result in results if result.view.kind == kind]
        one = [result for result in of_kind if result.motions == 1]
        parts = [r for r in of_kind if r.motions != 1 and r.motions_of_parts == 1]
        several = [r for r in of_kind if r.motions != 1 and r.motions_of_parts != 1]
        for name, chosen in (("one motion", one), ("one by cut cells", parts), ("several", several)):
            rows.append(kind_row(f"{kind}, {name}", chosen, views))
    yield Table("views", COLUMNS, rows)
    for result in results:
        if result.wrong_ids:
            of = f"{result.wrong_ids} wrong ids, {result.motions} motions"
            yield f"{result.view.kind}/{result.view.number}: {of}"
    return Found(failed=any(result.wrong_ids for result in results))


main = Experiment("views", measure)

if __name__ == "__main__":
    raise SystemExit(main())
