"""Hidden markers on flat or bent surfaces: repaired where the surroundings determine the position, else lost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import Blob, Camera, Damage, Press, composed
from cmpdesign.scene.standard import standard_layout
from extractor import Status
from tests.support.errors import deviations, errors_px, rms
from tests.support.standard_views import extractor, shown

LAYERS, EDGE_PX, SIZE = 6, 20.0, (400, 400)
PATTERNS = ("honeycomb", "round", "elliptical")
ONE, GAPS, RING = [0], [0, 1, 3, 5], [0, 1, 2, 3, 4, 5, 6]  # markers whose cells are all missing


def twisted(turn: float) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """A surface turned by an angle (rad) that grows towards the middle; the surface is odd about marker 0."""

    def surface(xy_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = xy_mm.T
        angle = turn * np.exp(-(x**2 + y**2) / 8.0)
        cos, sin = np.cos(angle), np.sin(angle)
        return np.stack([x * cos - y * sin, x * sin + y * cos, np.zeros_like(x)], axis=1)

    return surface


def without_cells_at(pattern: str, markers: list[int]) -> Damage:
    layout = standard_layout(pattern, LAYERS)
    around = np.isin(layout.cell_corners, markers).any(axis=1) & (layout.cell_color < BLACK)
    return Damage(missing_cells=tuple(np.flatnonzero(around).tolist()))


@pytest.mark.parametrize(
    ("gone", "turn", "least", "limit_edges"),  # least: the share of them that is repaired; None: all are lost
    [
        (ONE, 0.0, 1.0, 0.002),
        (ONE, 0.4, 1.0, 0.006),
        (ONE, 0.9, None, 0.0),
        (GAPS, 0.0, 1.0, 0.002),
        (GAPS, 0.4, 1.0, 0.02),
        (GAPS, 0.9, None, 0.0),
        (RING, 0.0, 0.8, 0.002),
        (RING, 0.4, 0.8, 0.07),
        (RING, 0.9, None, 0.0),
    ],
)
@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("pattern", ["honeycomb", "round"])
def test_what_is_missing_is_repaired_as_far_as_the_surface_lets(
    pattern: str, preset: str, gone: list[int], turn: float, least: float | None, limit_edges: float
) -> None:
    """Where a quadratic through the markers around misses these, as where all turns, a marker is lost."""
    seen = shown(
        pattern, layers=LAYERS, size=SIZE, camera=Camera(EDGE_PX), damage=without_cells_at(pattern, gone),
        surface=twisted(turn) if turn else None,
    )  # fmt: skip
    markers = extractor(pattern, preset, LAYERS).extract(seen.image)
    if least is None:
        assert (markers.status[gone] == Status.LOST).all()
        return
    assert (markers.status[gone] == Status.REPAIRED).mean() >= least
    assert np.nanmax(errors_px(markers, seen)[gone]) < limit_edges * EDGE_PX
    assert np.nanmax(deviations(markers, seen)[gone]) < 3.0


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_an_island_of_cells_is_placed_right(pattern: str, preset: str) -> None:
    """A few cells amid missing ones, which no neighbour vouches for: measured, and the ring around repaired or lost."""
    layout = standard_layout(pattern, LAYERS)
    middle = layout.marker_xy_mm[layout.cell_corners].mean(axis=1)
    for place in ((3.0, 0.5), (-2.0, -3.0), (0.0, 0.0)):
        marker = np.linalg.norm(layout.marker_xy_mm - place, axis=1).argmin()
        away = np.linalg.norm(middle - layout.marker_xy_mm[marker], axis=1)
        gone = (away > 0.9) & (away < 2.6) & (layout.cell_color < BLACK)
        damage = Damage(missing_cells=tuple(np.flatnonzero(gone).tolist()))
        seen = shown(pattern, layers=LAYERS, size=SIZE, camera=Camera(EDGE_PX, 7.3), damage=damage, seed=1)
        markers = extractor(pattern, preset, LAYERS).extract(seen.image)
        assert markers.status[marker] == Status.MEASURED
        assert np.nanmax(errors_px(markers, seen)) < 0.035 * EDGE_PX


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_under_dirt_on_its_cells_the_rim_is_right_or_lost(pattern: str, preset: str) -> None:
    """Drops on the rim's cells move two of their corners, or the third, the pattern's tip, too."""
    layout = standard_layout(pattern, LAYERS)
    rim = layout.marker_layer == LAYERS
    at_rim = np.flatnonzero((layout.cell_color < BLACK) & rim[layout.cell_corners].any(axis=1))
    error, normalised, lost = [], [], 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        middle = layout.marker_xy_mm[layout.cell_corners[rng.choice(at_rim, 6, replace=False)]].mean(axis=1)
        places = (middle + rng.normal(0, 0.25, middle.shape)).tolist()
        damage = Damage(blobs=tuple(Blob((x, y), 0.35, (rng.uniform(20, 160),) * 3) for x, y in places))
        surface = None if seed % 2 else composed(Press(6.0, 0.8))
        seen = shown(
            pattern,
            layers=LAYERS,
            size=SIZE,
            camera=Camera(EDGE_PX, 7.3),
            damage=damage,
            surface=surface,
            seed=seed,
        )
        markers = extractor(pattern, preset, LAYERS).extract(seen.image)
        error += list(errors_px(markers, seen)[rim])
        normalised += list(deviations(markers, seen)[rim])
        lost += int((markers.status[rim] == Status.LOST).sum())
        assert np.nanmax(errors_px(markers, seen)[~rim]) < 0.15 * EDGE_PX
    assert lost <= 0.03 * len(error)
    assert np.nanmax(error) < 0.17 * EDGE_PX
    assert rms(np.array(normalised)) < 1.6 and np.nanmax(normalised) < 7.0
