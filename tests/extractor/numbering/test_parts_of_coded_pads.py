"""Parts of coded pads are registered by their bits at the right place or not at all."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.pad_codes.parts import (
    NO_BRIGHT_PLACES,
    Pad,
    is_right,
    measured,
    moved,
    pad_of,
    random_motion,
    seen_part,
)

RADIUS = 5  # of the windows that the codes of 7 to 10 layers tell apart


def require_every_window_placed(pad: Pad, radius: int) -> None:
    """Every window inside the pad, read without error, has its place by its bits; in no place by another code."""
    rng = np.random.default_rng(0)
    layers = pad.lattice.layers - radius
    axial = pad.lattice.axial
    span = np.arange(-layers, layers + 1)
    centers = [(q, r) for q in span for r in span if abs(q + r) <= layers]
    for center in centers:
        step = pad.down - center
        corners = step[:, None] + np.array([[0, 0], [0, 1], [-1, 1]])
        inside = (np.abs(corners).max(axis=(1, 2)) <= radius) & (
            np.abs(corners.sum(axis=2)).max(axis=1) <= radius
        )
        part = np.isin(np.arange(len(axial)), pad.beside[inside])
        places, near = axial[part], pad.down_cells_of(part) & inside
        motion = random_motion(rng)
        frame = moved(places, motion, up=True), moved(pad.down[near], motion, up=False)
        seen = seen_part(places, *frame, pad.is_white[near].astype(float))
        placed = pad.registration.register(seen, NO_BRIGHT_PLACES)
        assert placed.is_certain and placed.is_proved_by_bits and is_right(placed, places), center


def test_every_window_of_a_code_has_its_place() -> None:
    require_every_window_placed(pad_of(10, 1), RADIUS)


@pytest.mark.slow
@pytest.mark.parametrize("code", range(2, 256))
def test_every_window_of_every_code_has_its_place(code: int) -> None:
    require_every_window_placed(pad_of(10, code), RADIUS)


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
