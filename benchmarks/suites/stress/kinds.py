"""A kind of condition, and the single cases that a run is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.suites.stress.frames import EmptyFrame, PatternFrame, plain_frame

FrameChange = Callable[[PatternFrame, float], "PatternFrame | EmptyFrame"]


@dataclass(frozen=True)
class ConditionKind:
    """One way to make reading harder, in graded steps.

    Attributes:
        name: of the kind.
        unit: of its steps.
        steps: from mild to hard.
        change: from the plain frame and a step to the condition's frame.
        promised: False where a share of read markers can not be asked for (ambiguous, or no white cell).
        repeats: seeds for each pattern in a full run.
        group: set by ``group_kinds``.
    """

    name: str
    unit: str
    steps: tuple[float, ...]
    change: FrameChange
    promised: bool = True
    repeats: int = 1
    group: str = ""


def group_kinds(group: str, *kinds: ConditionKind) -> tuple[ConditionKind, ...]:
    return tuple(replace(kind, group=group) for kind in kinds)


@dataclass(frozen=True)
class StressCase:
    """One image of the suite: ``kind=step/pattern/seed``."""

    kind: str
    step: float
    pattern: str
    seed: int

    @property
    def condition(self) -> str:
        return f"{self.kind}={self.step:g}"

    @property
    def name(self) -> str:
        return f"{self.condition}/{self.pattern}/{self.seed}"


def make_frame(case: StressCase, kind: ConditionKind) -> PatternFrame | EmptyFrame:
    return kind.change(plain_frame(case.pattern, case.seed), case.step)
