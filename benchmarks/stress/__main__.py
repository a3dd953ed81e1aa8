"""The stress suite: shares of read and of wrong markers in every condition of ``suites.stress``.

Times are processor times of one core, the best of some runs. Each run follows a run on the plain frame; the stated
ratio is the median of the ratios of such pairs.
"""

from __future__ import annotations

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.suites.scoring.calibration import calibration_table
from benchmarks.suites.scoring.reading import CaseResult, read_case
from benchmarks.suites.scoring.report import by_condition, failure_lines, results_table, summary_text
from benchmarks.suites.scoring.squares import calibrations_by_position
from benchmarks.suites.stress.conditions import BY_NAME, make_cases
from benchmarks.suites.stress.kinds import StressCase

# per image, and per image of conditions with many images; a median of five errs by 0.03
RUNS, FEW_RUNS = 15, 5


def read_job(job: tuple[StressCase, int]) -> CaseResult:
    return read_case(*job).result


def measure(quick: bool = False, processes: int = PROCESSES) -> Shown:
    """All conditions, the failures, the severest first, and the totals; fails if a marker is wrong or an image raised.

    Args:
        quick: the patterns take turns, no large images, one run.
    """
    runs = {"nothing": FEW_RUNS}
    jobs = [
        (case, 1 if quick else runs.get(BY_NAME[case.kind].group, RUNS)) for case in make_cases(quick=quick)
    ]
    # large images first
    jobs.sort(key=lambda job: BY_NAME[job[0].kind].group != "view")
    results = results_of(read_job, jobs, processes, chunk=1)
    conditions = by_condition(results)
    yield results_table(conditions)
    yield from failure_lines(conditions)
    yield calibration_table("all images", calibrations_by_position([result.squares for result in results]))
    yield f"{summary_text(conditions)}; {len(BY_NAME)} kinds"
    return Found(failed=any(result.score.wrong or result.raised for result in results))


main = Experiment("stress", measure)
main.run_as(__name__)
