"""All kinds of conditions. A new kind is one line in the table of its group's file."""

from __future__ import annotations

from benchmarks.suites.stress.damage import DIRT_KINDS, MISSING_KINDS, NO_WHITE_KINDS
from benchmarks.suites.stress.empty import EMPTY_KINDS
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame
from benchmarks.suites.stress.imaging import IMAGING_KINDS, LIGHT_KINDS
from benchmarks.suites.stress.kinds import ConditionKind, StressCase, make_frame
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from benchmarks.suites.stress.surroundings import AROUND_KINDS
from benchmarks.suites.stress.view import SURFACE_KINDS, VIEW_KINDS

KINDS = (
    *IMAGING_KINDS,
    *LIGHT_KINDS,
    *VIEW_KINDS,
    *SURFACE_KINDS,
    *MISSING_KINDS,
    *DIRT_KINDS,
    *NO_WHITE_KINDS,
    *RANDOM_KINDS,
    *AROUND_KINDS,
    *EMPTY_KINDS,
)
BY_NAME: dict[str, ConditionKind] = {kind.name: kind for kind in KINDS}
LARGE_PX = 3_000_000


def make_cases(*, quick: bool) -> list[StressCase]:
    """Cases of all patterns and seeds. A quick run has one pattern per step, in turn, and no large images."""
    chosen, turn = [], 0
    for kind in KINDS:
        for step in kind.steps:
            turn += 1
            for number, pattern in enumerate(PATTERNS):
                if quick and number != turn % len(PATTERNS):
                    continue
                for repeat in range(1 if quick else kind.repeats):
                    case = StressCase(kind.name, step, pattern, 100 * number + repeat)
                    if not (quick and kind.group == "view" and case_pixels(case) > LARGE_PX):
                        chosen.append(case)
    return chosen


def case_pixels(case: StressCase) -> int:
    """Pixels of the case's image."""
    frame = make_frame(case, BY_NAME[case.kind])
    width, height = frame.size
    return width * height * (2 if isinstance(frame, PatternFrame) and frame.second else 1)


def matching_cases(text: str) -> list[StressCase]:
    """The full run's cases of a kind (``blur``), a condition (``blur=3``), a case (``blur=3/round/100``)."""
    return [
        case
        for case in make_cases(quick=False)
        if text == case.kind or f"{case.name}/".startswith(text.rstrip("/") + "/")
    ]
