"""Every kind of condition. A new one is a line in a table of its group's file; all else takes it from here."""

from __future__ import annotations

from benchmarks.suites.stress.around import AROUND
from benchmarks.suites.stress.damage import DIRTY, MISSING, NO_WHITE
from benchmarks.suites.stress.drawn import DRAWN
from benchmarks.suites.stress.empty import EMPTY
from benchmarks.suites.stress.frames import PATTERNS, Frame
from benchmarks.suites.stress.imaging import IMAGING, LIGHT
from benchmarks.suites.stress.kinds import Case, Kind, frame_of
from benchmarks.suites.stress.view import SURFACE, VIEW

KINDS = (*IMAGING, *LIGHT, *VIEW, *SURFACE, *MISSING, *DIRTY, *NO_WHITE, *DRAWN, *AROUND, *EMPTY)
BY_NAME: dict[str, Kind] = {kind.name: kind for kind in KINDS}
LARGE_PX = 3_000_000


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
                    if not (quick and kind.group == "view" and pixels(case) > LARGE_PX):
                        chosen.append(case)
    return chosen


def pixels(case: Case) -> int:
    """Of the case's image."""
    frame = frame_of(case, BY_NAME[case.kind])
    width, height = frame.size
    return width * height * (2 if isinstance(frame, Frame) and frame.beside else 1)


def matching(text: str) -> list[Case]:
    """The full run's cases of a kind (``blur``), a condition (``blur=3``), a case (``blur=3/round/100``)."""
    return [
        case
        for case in cases(quick=False)
        if text == case.kind or f"{case.name}/".startswith(text.rstrip("/") + "/")
    ]
