"""Several white cells in one picture: each agrees with the cells around it, so no numbering is chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, WHITE
from cmpdesign.scene import Camera, Optics, Rendered, Scene, Sensor, render
from extractor import Origin, Reason
from tests.support.layouts import small_layout
from tests.support.pictures import extractor, picture

LAYERS = 11  # of the layout that is read
ENDLESS = 20  # layers of the tiling, more than any view here shows


def down_cells(layout: Layout) -> tuple[NDArray[np.intp], NDArray[np.int_]]:
    """The black and white cells with their axial places: multiples of both steps of the lattice, from the white one."""
    middle = layout.marker_xy_mm[layout.cell_corners].mean(axis=1)
    white = int(np.flatnonzero(layout.cell_color == WHITE)[0])
    cells = np.flatnonzero(layout.cell_color >= BLACK)
    pitch_mm = float(layout.parameters["pitch_mm"])
    steps = pitch_mm * np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    return cells, np.rint((middle[cells] - middle[white]) @ np.linalg.inv(steps)).astype(int)


def tiling(period: int, first: tuple[int, int]) -> Layout:
    """A pattern without an end in view, with a white cell every ``period`` steps both ways."""
    layout = small_layout("honeycomb", ENDLESS)
    cells, place = down_cells(layout)
    color = layout.cell_color.copy()
    color[cells] = np.where(((place - first) % period == 0).all(axis=1), WHITE, BLACK)
    return replace(layout, cell_color=color)


def seen(layout: Layout, pitch_px: float, turn_deg: float) -> Rendered:
    scene = Scene(
        layout, Camera(pitch_px, turn_deg, 12.0, 50.0), optics=Optics(1.0), sensor=Sensor(noise=2.0)
    )
    return render(scene, size=(640, 480))


@pytest.mark.parametrize("pitch_px", [36.0, 44.0, 60.0])
@pytest.mark.parametrize("period", [3, 5, 7, 9])
@pytest.mark.parametrize("first", [(0, 0), (1, -1), (2, 1)])
def test_a_tiling_with_several_white_cells_is_not_numbered(
    period: int, first: tuple[int, int], pitch_px: float
) -> None:
    layout = tiling(period, first)
    shot = seen(layout, pitch_px, 37.0 * period)
    whites = int(shot.truth.cell_visible[layout.cell_color == WHITE].sum())
    assert whites > 0
    markers = extractor("honeycomb", LAYERS).extract(shot.image)
    if whites > 1:
        assert markers.reason in (Reason.SEVERAL_PADS, Reason.REFERENCE_LOST)
        assert np.isnan(markers.xy_px).all()


def test_the_reason_says_that_there_are_several() -> None:
    """All that is in view fits into one pad: only the second white cell speaks against it."""
    layout = tiling(9, (0, 0))
    shot = seen(layout, 40.0, 17.0)
    assert shot.truth.cell_visible[layout.cell_color == WHITE].sum() == 2
    assert extractor("honeycomb", LAYERS).extract(shot.image).reason is Reason.SEVERAL_PADS


def test_one_white_cell_in_the_same_view_is_numbered() -> None:
    markers = extractor("honeycomb", LAYERS).extract(seen(tiling(60, (0, 0)), 40.0, 17.0).image)
    assert markers.reason is None and markers.origin is Origin.WHITE


def test_two_pads_side_by_side_are_several() -> None:
    image = picture().image
    assert extractor().extract(np.hstack([image, image])).reason is Reason.SEVERAL_PADS
