"""Parts of coded pads are registered by their bits at the right place or not at all."""

from __future__ import annotations

import pytest

from benchmarks.pad_codes.parts import measured
from benchmarks.pad_codes.windows import placed_windows
from cmpdesign.patterns.pad_code import MAX_CODE


def test_every_window_of_a_code_has_its_place() -> None:
    found = placed_windows(10, codes=1, seed=0)
    assert found.windows == 91 and found.failed == 0


@pytest.mark.slow
@pytest.mark.parametrize("layers", range(4, 25))
def test_every_window_of_every_code_has_its_place(layers: int) -> None:
    found = placed_windows(layers, MAX_CODE, seed=layers)
    assert found.windows > 0 and found.failed == 0


def require_none_wrong(layers: int, parts: int, seed: int) -> None:
    counts = measured(layers, parts, seed)
    assert sum(one["wrong"] for one in counts.values()) == 0
    assert counts["120 and more"]["right"] > 0.3 * counts["120 and more"].total()


def test_no_abused_part_has_a_wrong_place() -> None:
    require_none_wrong(10, 300, 21)


@pytest.mark.slow
@pytest.mark.parametrize("layers", [7, 10, 16, 20])
def test_no_abused_part_of_very_many_has_a_wrong_place(layers: int) -> None:
    require_none_wrong(layers, 250_000, layers)
