"""Views without the white cell: read where the visible cells fit one motion of the pattern only, refused elsewhere.

Random crops of patterns of 5 to 11 layers, tilted up to 30 degrees; crops with covered spots and scratches. The white
cell is covered or out of view. By the truth the cells that are wholly visible fit one motion (a turn and a shift that
keep colors; the side is told), or several. Of several only one may be left where cells are counted of which a quarter
or more is visible; else nothing but a guess could number them.
"""

from __future__ import annotations

from benchmarks.frame.experiment import COMMIT, Experiment, Found, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.pooled import Columns, mean, pooled_table, reasons, total
from benchmarks.frame.table import TEXT
from benchmarks.suites.views.views import KINDS, DrawnView, ViewResult, read_view


def columns(views: int) -> Columns:
    """Of some of a number of views of a kind: how many, read ones, wrong ids, and views with wrong ids."""
    return {
        "count": ("d", len),
        "share": (".1%", lambda results: len(results) / views),
        "read": ("d", total("is_read")),
        "read share": (".1%", mean("is_read")),
        "wrong ids": ("d", total("wrong_ids")),
        "wrong views": ("d", lambda results: sum(result.wrong_ids > 0 for result in results)),
        "reasons": (TEXT, reasons),
    }


def measure(views: int = 300, seed: int = COMMIT, processes: int = PROCESSES) -> Shown:
    """Up to three rows for each kind of view; fails if an id is wrong.

    Args:
        views: of each kind.
    """
    drawn = [DrawnView(kind, seed, number) for kind in KINDS for number in range(views)]
    results = results_of(read_view, drawn, processes)
    groups: dict[str, list[ViewResult]] = {
        f"{kind}, {name}": [] for kind in KINDS for name in ("one motion", "one by cut cells", "several")
    }
    for result in results:
        cut = "one by cut cells" if result.seen.motions_of_parts == 1 else "several"
        groups[f"{result.view.kind}, {'one motion' if result.seen.motions == 1 else cut}"].append(result)
    yield pooled_table("views", "views", columns(views), groups)
    for result in results:
        if result.wrong_ids:
            of = f"{result.wrong_ids} wrong ids, {result.seen.motions} motions"
            yield f"{result.view.kind}/{result.view.number}: {of}"
    return Found(failed=any(result.wrong_ids for result in results))


main = Experiment("views", measure)
main.run_as(__name__)
