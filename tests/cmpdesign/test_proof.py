"""The proof: an SVG file, drawn by another renderer, is read with the layout's ids.

A measured marker farther than 0.3 of its shortest edge from its true position has a wrong id; there is none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import pytest

from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.colors import BLUE, GREEN, RED
from cmpdesign.products.drawing.svg import layout_to_svg
from extractor import Extractor, Status, parse_layout
from tests.support.layouts import small_layout, small_text
from tests.support.photographs import View, photograph, raster_from_layout, rasterise, through

TRIANGULAR = ("honeycomb", "round", "elliptical")
ROTATIONS_DEG = tuple(range(0, 360, 30))
PITCHES_PX = (12, 17, 26, 40)
TILTS_DEG = (0, 30, 50)
WRONG_SHARE = 0.3
MEASURED_SHARE = 0.995
RULER_PX = 0.2  # of the raster, 0.05 px in the photographs: resvg samples its edges 4 x 4 times


@dataclass(frozen=True)
class Row:
    """One photograph against the truth."""

    pattern: str
    layers: int
    view: View
    present: int
    measured: int
    wrong: int
    side_known: bool
    rms_px: float
    reason: str | None

    @property
    def good(self) -> bool:
        return self.wrong == 0 and self.side_known

    def __str__(self) -> str:
        view = self.view
        return (
            f"{self.pattern:<11}{self.layers:>3}{view.pitch_px:>6g}{view.rotation_deg:>6g}{view.tilt_deg:>6g}"
            f"{view.tilt_axis_deg:>6g}  {'back ' if view.mirrored else 'front'}{self.measured:>6}/{self.present:<6}"
            f"{self.wrong:>5}  {'yes' if self.side_known else 'NO':<5}{self.rms_px:>8.4f}  {self.reason or ''}"
        )


HEAD = "pattern    lay pitch  turn  tilt  axis  side   measured   wrong  side  rms px  reason"


@cache
def extractor(pattern: str, layers: int) -> Extractor:
    return Extractor(parse_layout(small_text(pattern, layers)), side="either")


def read_back(pattern: str, layers: int, view: View) -> Row:
    """Photograph the SVG, extract it, compare."""
    layout = small_layout(pattern, layers)
    taken = photograph(layout, view)
    markers = extractor(pattern, layers).extract(taken.image)
    ends = taken.xy_px[layout.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    shortest = np.full(len(taken.xy_px), np.inf)
    for side in (0, 1):
        np.minimum.at(shortest, layout.edges[:, side], length)
    measured = markers.status == Status.MEASURED
    error = markers.xy_px[measured] - taken.xy_px[measured]
    wrong = ~(np.hypot(*error.T) <= WRONG_SHARE * shortest[measured])
    return Row(
        pattern, layers, view,
        present=int(layout.present.sum()),
        measured=int((measured & layout.present).sum()),
        wrong=int(wrong.sum()),
        side_known=markers.mirrored == view.mirrored,
        rms_px=float(np.sqrt(np.mean(error[~wrong] ** 2))) if (~wrong).any() else float("nan"),
        reason=markers.reason,
    )  # fmt: skip


def judge(rows: Iterable[Row]) -> None:
    """No wrong id in any photograph, and the stated share of all markers measured; else the table."""
    rows = list(rows)
    poor = [row for row in rows if not row.good or row.measured < row.present]
    table = "\n".join(["", HEAD, *map(str, poor[:60]), f"{len(poor)} of {len(rows)} are not perfect"])
    assert all(row.good for row in rows), table
    share = sum(row.measured for row in rows) / sum(row.present for row in rows)
    assert share >= MEASURED_SHARE, f"{share:.2%} measured{table}"


def mixed_views() -> Iterator[View]:
    """All rotations, with pitch, tilt and side changing along the way so that most pairs occur."""
    for n, rotation_deg in enumerate(ROTATIONS_DEG):
        for step in range(2):
            m = n + 5 * step
            yield View(
                pitch_px=PITCHES_PX[(m + step) % 4],
                rotation_deg=rotation_deg + 7.0 * step,
                tilt_deg=TILTS_DEG[(m // 2 + step) % 3],
                tilt_axis_deg=40.0 * m,
                mirrored=bool((m // 3 + step) % 2),
                seed=m,
            )


def test_every_triangular_pattern_is_proven() -> None:
    assert {name for name in registered_patterns() if small_layout(name).cell_corners.shape[1] == 3} == set(
        TRIANGULAR
    )


@pytest.mark.parametrize("ink", [RED, GREEN, BLUE])
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_the_raster_is_where_the_layout_says(pattern: str, ink: int) -> None:
    """The proof's own ruler: centroid and extent of all cells of one ink in resvg's raster."""
    layout = small_layout(pattern, 3)
    raster = rasterise(layout_to_svg(layout), px_per_mm := 79.3).astype(np.int16)[..., ::-1]
    cover = np.maximum(raster[..., ink] - np.delete(raster, ink, axis=2).max(axis=2), 0)
    corners = layout.marker_xy_mm[layout.cell_corners[layout.cell_color == ink]]
    cells = through(raster_from_layout(layout, px_per_mm), corners.reshape(-1, 2)).reshape(-1, 3, 2)
    side = np.diff(cells, axis=1)
    area = np.abs(side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0])
    middles = 0.5 * (
        cells + np.roll(cells, 1, axis=1)
    )  # their mean integrates squares over a triangle exactly
    for axis in (0, 1):
        mean = np.average(cells[..., axis].mean(axis=1), weights=area)
        spread = np.average(((middles[..., axis] - mean) ** 2).mean(axis=1), weights=area) ** 0.5
        seen = cover.sum(axis=axis)
        place = np.arange(len(seen))
        found = np.average(place, weights=seen)
        assert found == pytest.approx(mean, abs=RULER_PX)
        assert np.average((place - found) ** 2, weights=seen) ** 0.5 == pytest.approx(spread, abs=RULER_PX)


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_ids_survive_svg_renderer_camera_and_extractor(pattern: str) -> None:
    judge(read_back(pattern, 5, view) for view in mixed_views())


@pytest.mark.slow
@pytest.mark.parametrize("pattern", TRIANGULAR)
@pytest.mark.parametrize("mirrored", [False, True], ids=["front", "back"])
def test_the_whole_grid(pattern: str, mirrored: bool) -> None:
    """Every rotation with every pitch and tilt, ten layers where the pitch leaves them small."""
    grid = enumerate(product(ROTATIONS_DEG, PITCHES_PX, TILTS_DEG))
    judge(
        read_back(pattern, 10 if pitch < 20 else 4, View(pitch, turn, tilt, 25.0 * n, mirrored, seed=n))
        for n, (turn, pitch, tilt) in grid
    )
