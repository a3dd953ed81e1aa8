"""Pictures made to provoke wrong ids.

Walks through damage, cells missing or swapped, several references, other tilings, and a very large pattern. Ten kinds
follow each other; twenty pictures hold about a hundred thousand markers, half of them in large patterns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np

from benchmarks.suites.calibration.cases import CalibrationCase
from benchmarks.suites.scenes import standard_layout
from benchmarks.suites.stress.damage import (
    band,
    missing_cell_clusters,
    white_elsewhere,
    white_neighbours_missing,
)
from benchmarks.suites.stress.empty import EMPTY_KINDS
from benchmarks.suites.stress.frames import PATTERNS, CaseImage, EmptyFrame, PatternFrame, plain_frame
from benchmarks.suites.stress.random_damage import (
    RANDOM_KINDS,
    sample_deformed,
    sample_long_scratches,
    sample_short_scratches,
)
from benchmarks.suites.stress.surroundings import other_pattern_name, pattern_behind, second_pattern_beside
from cmpdesign.patterns.colors import BLACK, WHITE

LAYERS, LARGE_LAYERS, LARGE_PITCH_PX = 11, 60, 9.0
LARGE_SIZE = (1200, 1050)
SWAPPED_SHARES = (0.02, 0.3)
Rng = np.random.Generator


def damaged_at_random(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """Scratches, fragments, blots, glare and missing cells on deformed surfaces."""
    changed = RANDOM_KINDS[int(rng.integers(len(RANDOM_KINDS)))].change(frame, 0)
    assert isinstance(changed, PatternFrame)
    return changed


def with_swapped_cells(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """Some colored cells in the inks of others, as if put into the wrong places."""
    color = frame.layout.cell_color.copy()
    colored = np.flatnonzero((color != BLACK) & (color != WHITE))
    swapped = rng.permuted(colored)[: int(rng.uniform(*SWAPPED_SHARES) * len(colored))]
    color[swapped] = rng.permuted(color[swapped])
    return frame.with_parts(layout=replace(frame.layout, cell_color=color))


def with_white_cells(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """One to four black cells are white, too; in half of the pictures the white cell is missing."""
    color = frame.layout.cell_color.copy()
    black = np.flatnonzero(color == BLACK)
    color[rng.permuted(black)[: int(rng.integers(1, 5))]] = WHITE
    own = frame.with_parts(layout=replace(frame.layout, cell_color=color))
    return own.damaged(missing_cells=(frame.layout.reference_cell,)) if rng.random() < 0.5 else own


def with_white_drop(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """A white drop instead of the white cell, elsewhere."""
    return white_elsewhere(frame, float(rng.uniform(0.25, 0.6)))


def with_pads_beside(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """A second pad beside the first, of the same or another pattern."""
    name = frame.layout.pattern if rng.random() < 0.5 else other_pattern_name(frame)
    return second_pattern_beside(frame, name, 12.0, mirrored=bool(rng.random() < 0.3))


def before_a_tiling(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """Another tiling of about the same pitch as background, and cells missing at the rim."""
    behind = pattern_behind(frame.with_camera(pitch_px=12), float(rng.uniform(9, 16)))
    return behind.damaged(missing_share=float(rng.uniform(0, 0.15)))


def cut_in_parts(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """Black bands as wide as one or two cells cut the pattern, around the white cell as well."""
    reach, start, bands = max(frame.layout.size_mm), rng.uniform(0, np.pi), []
    for k in range(int(rng.integers(2, 5))):
        turn = start + k * np.pi / 3 + rng.normal(0, 0.05)
        offset_mm, width_mm = rng.uniform(1, 0.3 * reach), float(rng.uniform(0.5, 2.2))
        bands.append(band(frame, turn, offset_mm, width_mm, (20.0, 20.0, 20.0)))
    return sample_deformed(frame.damaged(scratches=tuple(bands)), rng)


def with_missing_clusters(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """Groups of cells missing on a deformed surface, or those around the white cell."""
    if rng.random() < 0.3:
        return white_neighbours_missing(frame, float(rng.integers(3, 12)))
    return sample_deformed(missing_cell_clusters(frame, float(rng.uniform(0.1, 0.45))), rng)


def large_and_damaged(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """A pattern of 60 layers, 10,981 markers, scratched, with missing cells."""
    layout = standard_layout(frame.layout.pattern, LARGE_LAYERS)
    large = replace(frame.with_parts(layout=layout).with_camera(pitch_px=LARGE_PITCH_PX), size=LARGE_SIZE)
    draw = sample_long_scratches if rng.random() < 0.5 else sample_short_scratches
    return large.damaged(**draw(large, rng), missing_share=float(rng.uniform(0, 0.1)))


CHANGES: dict[str, Callable[[PatternFrame, Rng], PatternFrame]] = {
    "damage at random": damaged_at_random,
    "cut in parts": cut_in_parts,
    "swapped cells": with_swapped_cells,
    "missing clusters": with_missing_clusters,
    "several white cells": with_white_cells,
    "a white drop": with_white_drop,
    "pads beside": with_pads_beside,
    "before a tiling": before_a_tiling,
    "large": large_and_damaged,
}
FOREIGN = "foreign tiling"


def shoot_foreign(seed: int, pattern: str) -> CaseImage:
    """A tiling that is not the reader's pattern, or a picture without a pattern."""
    rng = np.random.default_rng([seed, 6])
    kind = EMPTY_KINDS[int(rng.integers(len(EMPTY_KINDS)))]
    frame = kind.change(plain_frame(pattern, seed), float(rng.choice(kind.steps)))
    assert isinstance(frame, EmptyFrame)
    return frame.shoot()


def provoking_cases(seed: int) -> Iterator[CalibrationCase]:
    """The kinds in turn, the patterns in turn, endlessly."""
    kinds = (*CHANGES, FOREIGN)
    for number in count():
        kind, turn = kinds[number % len(kinds)], number // len(kinds)
        pattern, own = PATTERNS[turn % len(PATTERNS)], (seed + 7919 * number) % 2**31
        layout = standard_layout(pattern, LARGE_LAYERS if kind == "large" else LAYERS)
        if kind == FOREIGN:
            yield CalibrationCase(kind, layout, partial(shoot_foreign, own, pattern))
        else:
            frame = CHANGES[kind](plain_frame(pattern, own), np.random.default_rng([own, 7]))
            yield CalibrationCase(kind, layout, frame.shoot)
