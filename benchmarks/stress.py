"""The stress suite: how much is read, and how much of it wrong, in every condition of ``stress_conditions``.

    python -m benchmarks.stress [--quick] [--table] [--json FILE] [--plot FILE]
    python -m benchmarks.stress --only "blur=3/round" --save DIR     some cases: their images and overlays

Times are of the processor, one core, the best of some runs; their ratio is to the plain frame's, read right before.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")  # before numpy and numba: times are of one core
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also as a script, from anywhere

from benchmarks.stress_conditions import KINDS, PATTERNS
from benchmarks.stress_kinds import Case, frame_of
from benchmarks.stress_report import failures, plot, rows_of, summary, table, write_json
from benchmarks.stress_result import LARGE_PX, Result, overlay, read, warm_up

BY_NAME = {kind.name: kind for kind in KINDS}


def cases(*, quick: bool) -> list[Case]:
    """All patterns and seeds; in a quick run the patterns take turns, and large images are left out."""
    chosen, turn = [], 0
    for kind in KINDS:
        for step in kind.steps:
            turn += 1
            for number, pattern in enumerate(PATTERNS):
                if quick and number != turn % len(PATTERNS):
                    continue
                for repeat in range(1 if quick else kind.repeats):
                    case = Case(kind.name, step, pattern, 100 * number + repeat)
                    if not (quick and kind.group == "view" and is_large(case)):
                        chosen.append(case)
    return chosen


def is_large(case: Case) -> bool:
    size = frame_of(case, BY_NAME[case.kind]).size
    return size[0] * size[1] > LARGE_PX


def matching(text: str) -> list[Case]:
    """The full run's cases of a kind (``blur``), a condition (``blur=3``), a case (``blur=3/round/100``)."""
    every = cases(quick=False)
    return [
        case
        for case in every
        if text in (case.kind, case.condition) or (case.name + "/").startswith(text.rstrip("/") + "/")
    ]


def _job(job: tuple[Case, int]) -> Result:
    case, runs = job
    return read(case, BY_NAME[case.kind], runs)[0]


def run(chosen: list[Case], processes: int, runs: int) -> Iterator[Result]:
    """Results as they come, the large images first."""
    last = [case for case in chosen if BY_NAME[case.kind].group != "view"]
    first = [case for case in chosen if BY_NAME[case.kind].group == "view"]
    jobs = [(case, runs) for case in [*first[::-1], *last]]
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        yield from pool.imap_unordered(_job, jobs)


def with_progress(chosen: list[Case], processes: int, runs: int) -> list[Result]:
    results, started = [], time.perf_counter()
    for result in run(chosen, processes, runs):
        results.append(result)
        if sys.stderr.isatty() or len(results) % 200 == 0:
            seconds = time.perf_counter() - started
            end = "\r" if sys.stderr.isatty() else "\n"
            print(
                f"{len(results)}/{len(chosen)} images, {seconds:.0f} s", end=end, file=sys.stderr, flush=True
            )
    return results


def one_by_one(chosen: list[Case], save: Path | None) -> list[Result]:
    """Read here, printing a line a case; write its image and overlay."""
    import cv2

    warm_up()
    results = []
    for case in chosen:
        result, shot, markers = read(case, BY_NAME[case.kind], 1)
        results.append(result)
        figures = result.score
        print(
            f"{case.name:<44} visible {figures.visible:>5} measured {figures.measured:>5} repaired "
            f"{figures.repaired:>4} fitted {figures.fitted:>4} lost {figures.lost:>5} WRONG {figures.wrong:>4}  "
            f"{'promised' if figures.promised else 'not promised'}  {result.ms:.0f} ms  {result.reason}"
        )
        if save is not None:
            save.mkdir(parents=True, exist_ok=True)
            stem = case.name.replace("/", "-").replace(" ", "_")
            cv2.imwrite(str(save / f"{stem}.png"), shot.image)
            if markers is not None:
                cv2.imwrite(str(save / f"{stem}.overlay.png"), overlay(shot, case, markers))
    return results


def main(arguments: list[str] | None = None) -> int:
    """Print the failures, the severest first, and the totals; 1 when a marker is wrong or an image raised."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stress", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="the patterns take turns, no large images")
    parser.add_argument(
        "--only", metavar="NAME", help="one kind, condition or case: blur, blur=3, blur=3/round"
    )
    parser.add_argument(
        "--save", type=Path, metavar="DIR", help="with --only: write images and overlays here"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw every kind (png, svg or pdf)")
    parser.add_argument("--table", action="store_true", help="print every row, also in a quick run")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    asked = parser.parse_args(arguments)

    started = time.perf_counter()
    if asked.only:
        chosen = matching(asked.only)
        if not chosen:
            parser.error(f"no case is named {asked.only!r}; the kinds are {', '.join(BY_NAME)}")
        results = one_by_one(chosen, asked.save)
    else:
        results = with_progress(cases(quick=asked.quick), asked.processes, 1 if asked.quick else 3)
    rows = rows_of(results, KINDS)
    if asked.table or not asked.quick:
        print(table(rows))
    print("\n".join(failures(rows)))
    print(f"{summary(rows)}; {len(BY_NAME)} kinds; {time.perf_counter() - started:.0f} s")
    if asked.json:
        write_json(rows, asked.json)
    if asked.plot:
        plot(rows, KINDS, asked.plot)
    return int(any(row.wrong or row.raised for row in rows))


if __name__ == "__main__":
    sys.exit(main())
