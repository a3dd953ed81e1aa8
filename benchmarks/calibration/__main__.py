"""Calibration of stated covariances: errors over covariances in all suites, for all presets.

For an error e and its stated covariance C, d2 = e' C^-1 e. z = sqrt(mean d2 / 2) and median z = sqrt(median d2 /
(2 ln 2)) are 1 for a right covariance, above 1 for a covariance that is too small; "beyond" is the share of d2 above
11.83, 0.27 % for normal errors with that covariance. Intervals are of 95 %, by bootstrap over pictures. All reported
markers count, wrong ones included. Rows are of measured markers and virtual markers by kind of picture; of each suite
together, also of repaired and fitted markers and of interpolated virtual markers. The default seed of the camera suite
comes from the commit's hash, the default of the other suites is 0. All seeds are printed.
"""

from __future__ import annotations

from benchmarks.frame.experiment import Experiment, Found, OptionError, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.suites.calibration.reading import SuiteJob, calibrations_by_suite, in_order, read_pictures
from benchmarks.suites.calibration.suites import suites_by_name, usual_seed
from benchmarks.suites.scoring.calibration import calibration_table
from extractor.presets import PRESETS

PARTS = 8  # jobs per suite


def measure(
    quick: bool = False,
    preset: str = "",
    suite: str = "",
    seed: int | None = None,
    processes: int = PROCESSES,
) -> Shown:
    """One table per preset and suite.

    Args:
        quick: few pictures.
        preset: one; all by default.
        suite: one; all by default.
        seed: of all random choices, of all suites.
    """
    presets, suites = tuple(PRESETS), tuple(suites_by_name())
    for chosen, known in ((preset, presets), (suite, suites)):
        if chosen and chosen not in known:
            raise OptionError(f"{chosen!r} is none of {', '.join(known)}")
    presets, suites = (preset,) if preset else presets, (suite,) if suite else suites
    try:
        seeds = {name: usual_seed(name) if seed is None else seed for name in suites}
    except ValueError as error:
        raise OptionError(error) from None
    jobs = [
        SuiteJob(name, presets, quick, own, part, PARTS)
        for name, own in seeds.items()
        for part in range(PARTS)
    ]
    readings = in_order(results_of(read_pictures, jobs, processes, chunk=1))
    for title, found in calibrations_by_suite(readings).items():
        yield calibration_table(title, found)
    pictures = len({(reading.suite, reading.number) for reading in readings})
    yield f"{pictures} pictures, seed of {', '.join(f'{name} {own}' for name, own in seeds.items())}"
    return Found({"seeds": seeds})


main = Experiment("calibration", measure)
main.run_as(__name__)
