"""What one step by synthesis leaves of the markers' errors.

Inside: the reader takes as many steps as a picture needs, and no result says what one of them leaves.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmpdesign.scene import Camera
from extractor.refine import synthesis_steps
from extractor.refine.synthesis_steps import SynthesisSolver
from tests.support.standard_views import extractor, shown

LAYERS, ERROR_PX = 6, 0.01


def test_a_step_leaves_a_seventh_of_independent_errors_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """Markers that are off by themselves bend the gridlines around others, too; a step that does not know leaves 0.17
    of the errors, and more at the rim.
    """
    steps, max_steps = SynthesisSolver.steps, synthesis_steps.MAX_STEPS
    calls: list[tuple[Any, ...]] = []

    def keep(solver: SynthesisSolver, view: Any, estimate: Any, schedule: Any) -> Any:
        last = steps(solver, view, estimate, schedule._replace(small_remainder=0.0))
        calls.append((solver, view, last, schedule))
        return last

    monkeypatch.setattr(SynthesisSolver, "steps", keep)
    left, rng = [], np.random.default_rng(0)
    for pattern in ("honeycomb", "round", "elliptical"):
        for seed in range(2):
            seen = shown(pattern, layers=LAYERS, size=(320, 280), camera=Camera(20.0), seed=seed)
            monkeypatch.setattr(synthesis_steps, "MAX_STEPS", max_steps)
            extractor(pattern, "balanced", LAYERS).extract(seen.image)
            solver, view, last, schedule = calls[-1]
            error = rng.normal(0.0, ERROR_PX, last.measured.shape)
            moved = last._replace(measured=last.measured + error, reliable=last.reliable + error)
            monkeypatch.setattr(synthesis_steps, "MAX_STEPS", 1)
            left.append(steps(solver, view, moved, schedule).measured - last.measured)
    assert np.sqrt(np.mean(np.concatenate(left) ** 2)) < ERROR_PX / 7
