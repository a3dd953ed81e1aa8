"""The camera suite: inks, lamps, pad, lens, motion, sensor and file format, alone and combined at random.

The same seed gives the same pictures. Each effect has
strengths of 0.25 to 1; the largest strengths are 0.1 or 8 times the light, 13 px of motion, JPEG at quality 15 and
similar.
Columns: the share of visible markers measured; wrong ids (reported at another marker's place) and wrong positions
(error above 0.3 of the shortest edge); RMS error per axis of measured markers that are not wrong; z, median z and the
share beyond of all measured markers, wrong ones included, with its interval; processor time of one picture, the
faster of two readings. Rows with "CIE76 20" are of pictures in which neighbouring cells differ by as much (5th
percentile over the pattern) at a pitch of 8 px or more: those of the effects of light and inks, and those of all.
"""

from __future__ import annotations

from functools import partial

from benchmarks.camera.page import page, shown_record, shown_results
from benchmarks.camera.report import effects_table, failure_lines
from benchmarks.frame.experiment import COMMIT, Experiment, Found, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.suites.camera.cases import TURN, make_cases
from benchmarks.suites.camera.reading import read_case
from extractor.presets import Preset


def measure(
    pictures: int = 40 * len(TURN),
    seed: int = COMMIT,
    preset: Preset = "balanced",
    processes: int = PROCESSES,
) -> Shown:
    """A row per effect and one of all pictures; fails if an id is wrong or a picture raised."""
    results = results_of(partial(read_case, preset=preset), make_cases(pictures, seed), processes)
    table = effects_table(results)
    yield table
    yield from failure_lines(results)
    shown = [shown_record(result) for result in shown_results(results)]
    record = {"seed": seed, "table": str(table), "effects": table.records(), "shown": shown}
    return Found(record, any(result.wrong_ids or result.raised for result in results))


main = Experiment("camera", measure, page, published_options=("pictures", "seed", "preset"))
main.run_as(__name__)
