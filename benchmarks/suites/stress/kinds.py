"""Kinds of conditions, and the single cases of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.suites.stress.frames import EmptyFrame, PatternFrame, plain_frame

FrameChange = Callable[[PatternFrame, float], "PatternFrame | EmptyFrame"]


@dataclass(frozen=True)
class ConditionKind:
    """One kind of degradation, in graded steps.

    Attributes:
        name: the kind's name.
        unit: the steps' unit.
        steps: strengths from mild to hard.
        change: plain frame and step -> the condition's frame.
        promised: False where no share of markers is promised (ambiguous, or no white cell).
        repeats: seeds for each pattern in a full run.
        group: the group's name, set by ``group_kinds``.
    """

    name: str
    unit: str
    steps: tuple[float, ...]
    change: FrameChange
    promised: bool = True
    repeats: int = 1
    group: str = ""


def group_kinds(group: str, *kinds: ConditionKind) -> tuple[ConditionKind, ...]:
    """The kinds with the name of their group."""
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
    """The frame of a case."""
    return kind.change(plain_frame(case.pattern, case.seed), case.step)
