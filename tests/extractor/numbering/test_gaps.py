"""Across gaps and beside dirt: ids are correct, and no dirt is taken for the white cell."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from benchmarks.suites.ablation.provoking import LARGE_LAYERS, LARGE_PITCH_PX, provoking_cases
from benchmarks.suites.scoring.reading import cached_extractor
from benchmarks.suites.scoring.score import MarkerScore, score_markers
from benchmarks.suites.stress.damage import missing_hole, with_scratches
from benchmarks.suites.stress.frames import PATTERNS, RGB, PatternFrame, plain_frame
from cmpdesign.scene import Press, Scratch, Shear, Twist

BLACK_RGB, GREY_RGB = (20.0, 20.0, 20.0), (120.0, 110.0, 100.0)
SURFACES = ((), (Shear(6.0, (0.6, 0.4)),), (Twist(7.0, 20.0),), (Press(6.0, 1.0),))


def read(frame: PatternFrame) -> MarkerScore:
    shot = frame.shoot()
    return score_markers(cached_extractor(frame.layout.pattern, 11).extract(shot.image), shot, promised=True)


@pytest.mark.parametrize(
    ("width", "least"), [(0.3, 0.99), (0.5, 0.99), (1.0, 0.99), (1.5, 0.985), (2.0, 0.98), (3.0, 0.7)]
)
@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_part_beyond_a_gap_is_numbered_no_step_aside(pattern: str, width: float, least: float) -> None:
    """Two gaps, in edges, cut the pattern into three parts: the outer parts also agree with the ids one lattice step
    farther. The part between is stretched, turned or pressed; narrow scratches also cut cells to pieces."""
    y = 2.5 + width / 2
    gaps = (
        Scratch((-14.0, y + 0.5), (14.0, y + 1.5), width, BLACK_RGB),
        Scratch((-14.0, -y - 1.0), (14.0, -y), width, GREY_RGB),
    )
    narrow = tuple(Scratch((x, y + width), (x + 2.0, 14.0), 0.1, BLACK_RGB) for x in (-4.0, 1.0))
    for number, surface in enumerate(SURFACES):
        frame = plain_frame(pattern, int(width * 10) + number).with_surface(*surface)
        figures = read(frame.damaged(scratches=gaps + (narrow if number % 2 else ())))
        assert figures.wrong == 0
        assert figures.kept >= (least - 0.02 * (number % 2)) * figures.sure


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "number", "least"), [(880231, 178, 0.97), (903377, 388, 0.7)])
def test_cells_that_seem_to_touch_across_a_scratch_join_no_parts(
    seed: int, number: int, least: float
) -> None:
    """10,981 markers in two parts, one of them walked to a step aside: one wrong contact, or all along a scratch of one
    cell's width, made it part of the other.
    """
    case = next(islice(provoking_cases(seed), number, None))
    shot = case.shoot()
    markers = cached_extractor(case.layout.pattern, LARGE_LAYERS).extract(shot.image)
    error_px = np.linalg.norm(markers.xy_px - shot.truths[0].marker_xy_px, axis=1)
    assert np.nanmax(error_px) < 0.5 * LARGE_PITCH_PX
    assert np.isfinite(error_px).mean() > least


@pytest.mark.parametrize(
    ("pattern", "seed", "count", "width_mm", "rgb", "aside"),
    [
        ("honeycomb", 1374, 2, 0.49, (32.0, 76.0, 160.0), 1.08),
        ("elliptical", 1028, 3, 0.86, (46.0, 183.0, 143.0), 1.03),
        ("round", 1099, 3, 0.6, (191.0, 93.0, 131.0), 2.49),
        ("elliptical", 1160, 2, 0.86, (167.0, 153.0, 178.0), 1.3),
        ("honeycomb", 1308, 3, 0.39, (82.0, 138.0, 45.0), 1.37),
        ("elliptical", 1466, 3, 0.22, (168.0, 49.0, 83.0), 1.22),
    ],
)
def test_dirt_of_any_color_is_not_the_white_cell(
    pattern: str, seed: int, count: int, width_mm: float, rgb: RGB, aside: float
) -> None:
    """Scratches that cross black cells, and cut the pattern into parts that have no white cell of their own."""
    figures = read(with_scratches(plain_frame(pattern, seed), count, width_mm, rgb, aside))
    assert figures.wrong == 0
    assert figures.kept >= 0.96 * figures.sure


def test_a_block_beyond_a_scratch_is_numbered() -> None:
    figures = read(with_scratches(plain_frame("honeycomb", 0), 5, 0.3))
    assert figures.wrong == 0 and figures.kept >= 0.99 * figures.sure


@pytest.mark.parametrize("pattern", PATTERNS)
def test_cells_in_a_row_beside_a_hole_have_corners(pattern: str) -> None:
    figures = read(missing_hole(plain_frame(pattern, 0), 0.3))
    assert figures.wrong == 0 and figures.kept >= 0.98 * figures.sure


@pytest.mark.parametrize("pattern", PATTERNS)
def test_cells_that_touch_by_corners_are_numbered(pattern: str) -> None:
    """Three of ten cells are missing, at random: the mesh is disconnected, but cells still share corners."""
    figures = [read(plain_frame(pattern, seed).damaged(missing_share=0.3)) for seed in (3, 4, 5)]
    assert all(one.wrong == 0 for one in figures)
    assert sum(one.kept for one in figures) >= 0.99 * sum(one.sure for one in figures)
