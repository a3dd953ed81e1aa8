"""Sweeps of light, and views without the white cell: spectra, steps between read ones, motions by the truth."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.suites.camera.parts import PIGMENTS, Chain, Inks, Pose
from benchmarks.suites.camera.shoot import shoot
from benchmarks.suites.scenes import standard_layout
from benchmarks.suites.sweeps.lines import (
    BLACK_LEVELS,
    BLACKS,
    LAMPS,
    LED_TRIPLES,
    TEMPERATURES,
    Line,
    LineResult,
    line_chains,
    make_lines,
)
from benchmarks.suites.sweeps.spectra import DAYLIGHT_K, blackbody, inks_under, led_triple
from benchmarks.suites.views.motions import fitting_motions
from benchmarks.suites.views.views import (
    CROPS,
    DAMAGED,
    DrawnView,
    colored_cells,
    read_view,
    seen_cells,
    up_cells,
)
from benchmarks.sweeps.__main__ import lines_table


def test_daylight_shows_the_inks_as_they_are() -> None:
    for inks in (Inks(), *PIGMENTS):
        np.testing.assert_allclose(
            astuple(inks_under(blackbody(DAYLIGHT_K), inks)), astuple(inks), atol=1e-12
        )


def test_lamps_color_the_white_cell() -> None:
    """Red over blue falls with the temperature; a lone LED shows its channel most; no channel is below zero."""
    ratios = [np.divide(*inks_under(blackbody(kelvin), Inks()).white[::2]) for kelvin in (2500, 5000, 10000)]
    assert ratios == sorted(ratios, reverse=True) and ratios[0] > 2 > 1 > ratios[-1]
    for channel, power in enumerate(np.eye(3) + 0.02):
        seen = inks_under(led_triple(tuple(power)), Inks())
        assert int(np.argmax(seen.white)) == channel
        assert np.min(astuple(seen)) >= 0


def test_a_line_has_the_stated_steps() -> None:
    chains = line_chains(Line(LAMPS, 0, 0))
    assert len(chains) == TEMPERATURES + LED_TRIPLES == 40
    assert len(make_lines(3)) == 3 * 8 * 3
    last = line_chains(Line(BLACKS, 0, 0))[-1]
    assert np.median(shoot(last).image[:20]) >= BLACK_LEVELS[-1]


def test_steps_between_read_ones_are_counted() -> None:
    def between(steps: str) -> int:
        return LineResult(Line(LAMPS, 0, 0), tuple("x" if step == "x" else "" for step in steps), 0).between

    assert [between(steps) for steps in ("...", "xx..x", ".x.xx.", "xxx", "x.x")] == [0, 0, 3, 0, 0]
    broken = LineResult(Line(LAMPS, 0, 0), ("", "no_color", ""), 2)
    assert lines_table([broken]).rows[0] == ("lamps", 3, 2, 1, 3.0, 2, "no_color 1")


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1), layers=st.integers(2, 5), share=st.floats(0.05, 0.95), block=st.booleans()
)
def test_motions_are_those_of_the_plane(seed: int, layers: int, share: float, block: bool) -> None:
    """Turns and shifts of places in the plane, tried one by one, put the same number of views into the pattern."""
    layout, rng = standard_layout("honeycomb", layers), np.random.default_rng(seed)
    cells = colored_cells(layout)
    order = rng.permutation(len(cells))
    middle_mm = layout.marker_xy_mm[layout.cell_corners[cells]].mean(axis=1)
    if block:
        order = np.argsort(np.linalg.norm(middle_mm - middle_mm[order[0]], axis=1))
    chosen = order[: max(int(share * len(cells)), 1)]
    color = layout.cell_color[cells]
    count, first = 0, middle_mm[chosen[0]]
    for angle in np.radians([0, 120, 240]):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned = (middle_mm[chosen] - first) @ turn.T
        for target in np.flatnonzero(color == color[chosen[0]]):
            distance = np.linalg.norm((turned + middle_mm[target])[:, None] - middle_mm, axis=2)
            nearest = distance.argmin(axis=1)
            fits = (distance.min(axis=1) < 0.1) & (color[nearest] == color[chosen])
            count += bool(fits.all())
    seen = up_cells(layout, cells[chosen])
    assert fitting_motions(up_cells(layout, cells), seen) == count
    assert fitting_motions(up_cells(layout, cells), up_cells(layout, cells)) == 1


def test_seen_cells_are_clear_of_covers_and_in_the_picture() -> None:
    picture = shoot(Chain(pose=Pose(layers=5, pitch_px=30.0)))
    cells = colored_cells(picture.layout)
    covers = np.zeros(picture.image.shape[:2], np.uint8)
    every = seen_cells(picture, covers, cells)
    assert np.array_equal(every, colored_cells(picture.layout))
    covers[:, :320] = 1
    clear = seen_cells(picture, covers, cells)
    left = picture.marker_xy_px[picture.layout.cell_corners[every]].min(axis=(1,))[:, 0]
    assert set(clear) >= set(every[left > 325]) and not set(clear) & set(every[left < 319])
    aside = seen_cells(
        replace(picture, marker_xy_px=picture.marker_xy_px + (200, 0)), np.zeros_like(covers), cells
    )
    assert 0 < len(aside) < len(every)


@pytest.mark.parametrize("kind", [CROPS, DAMAGED])
def test_a_view_without_the_white_cell_has_no_wrong_id(kind: str) -> None:
    results = [read_view(DrawnView(kind, 1, number)) for number in range(3)]
    assert not any(result.wrong_ids for result in results)
    assert all(result.seen.motions >= 1 and result.seen.cells for result in results)
    assert results == [read_view(DrawnView(kind, 1, number)) for number in range(3)]


@pytest.mark.parametrize("number", [198, 257])
def test_parts_that_find_no_place_do_not_outvote_the_right_motion(number: int) -> None:
    """Under the right motion of the largest part, the others found no place, and under a wrong one they did."""
    assert read_view(DrawnView(DAMAGED, 990271, number, pitch_px=(24.0, 76.0))).wrong_ids == 0


@pytest.mark.parametrize(("kind", "seed", "number"), [(DAMAGED, 770413, 273), (CROPS, 551177, 12)])
def test_a_bright_place_that_is_no_triangle_is_no_white_cell(kind: str, seed: int, number: int) -> None:
    """The true white cell is covered; with glare for a weak witness, these views had 198 and 155 wrong ids."""
    assert read_view(DrawnView(kind, seed, number)).wrong_ids == 0
