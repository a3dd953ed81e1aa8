"""The white cell is a cell: a white area on a black cell that is no triangle of this size is not taken for the cell."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.suites.scoring.reading import cached_extractor
from benchmarks.suites.scoring.score import score_markers
from benchmarks.suites.stress.damage import DIRT, cell_centres_mm, cell_rings, white_missing
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame, plain_frame
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import Blob, Damage, Glare, Scratch
from cmpdesign.scene.standard import INKS
from extractor import Markers, Origin

HALF_MM = 8.0


def cropped(frame: PatternFrame) -> PatternFrame:
    """The camera is so near that no outline is in view: only the white cell determines the numbering."""
    return frame.with_camera(pitch_px=46.0)


def read(frame: PatternFrame) -> Markers:
    shot = frame.shoot()
    markers = cached_extractor(frame.layout.pattern, 11).extract(shot.image)
    assert score_markers(markers, shot, promised=False).wrong == 0
    return markers


def black_cell(frame: PatternFrame) -> tuple[float, float]:
    """The middle of one, away from the white."""
    black = np.flatnonzero((frame.layout.cell_color == BLACK) & (cell_rings(frame.layout) == 3))
    x, y = cell_centres_mm(frame.layout)[black[frame.scene.seed % len(black)]]
    return float(x), float(y)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_white_cell_tells_where_no_outline_does(pattern: str) -> None:
    markers = read(cropped(plain_frame(pattern, 3)))
    assert markers.origin is Origin.WHITE and (markers.status > 0).sum() > 60


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("kind", ["drop", "large drop", "scratch", "crossing", "glare"])
def test_what_is_no_cell_is_not_white(pattern: str, kind: str) -> None:
    """The white cell is missing, and something else is white."""
    frame = cropped(plain_frame(pattern, 3))
    x, y = black_cell(frame)
    white = INKS["white"]
    gone = white_missing(frame).scene.damage
    assert gone is not None
    across = [((x - HALF_MM, y), (x + HALF_MM, y)), ((x, y - HALF_MM), (x, y + HALF_MM))]
    shot = frame.shoot()
    corners = frame.layout.marker_xy_mm
    nearest = shot.truths[0].marker_xy_px[np.argmin(np.hypot(*(corners - (x, y)).T))]
    parts = {
        "drop": {"blobs": (Blob((x, y), 0.25, white),)},
        "large drop": {"blobs": (Blob((x, y), 0.6, white),)},
        "scratch": {"scratches": (Scratch(*across[0], 0.45, white),)},
        "crossing": {"scratches": tuple(Scratch(*ends, 0.35, white) for ends in across)},
        "glare": {"glare": (Glare((float(nearest[0]), float(nearest[1])), 12.0),)},
    }
    damaged = frame.with_parts(damage=Damage(missing_cells=gone.missing_cells, **parts[kind]))
    assert (read(damaged).status == 0).all()


@pytest.mark.parametrize("pattern", PATTERNS)
def test_dirt_beside_the_white_cell_does_not_hide_it(pattern: str) -> None:
    frame = cropped(plain_frame(pattern, 3))
    scratch = Scratch((-HALF_MM, -0.9), (HALF_MM, -0.9), 0.5, DIRT)
    markers = read(frame.damaged(scratches=(scratch,)))
    assert markers.origin is Origin.WHITE
