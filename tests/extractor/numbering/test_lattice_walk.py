"""Stages 6 and 7: every marker gets the layout's number, or none."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import (
    Camera,
    Damage,
    Optics,
    Press,
    Scene,
    Scratch,
    Sensor,
    Shear,
    Twist,
    composed,
    render,
)
from extractor import Markers, Reason, Status
from tests.support.layouts import small_layout
from tests.support.pictures import extractor, picture, recolored, scene_of

TRIANGULAR = ("honeycomb", "round", "elliptical")


def assert_numbered_as_the_layout(markers: Markers, truth_xy_px: NDArray[np.float64], least: float) -> None:
    """Brute force: the nearest true marker of each measured one is the marker itself."""
    found = np.flatnonzero(markers.status == Status.MEASURED)
    away = np.linalg.norm(markers.xy_px[found, None] - truth_xy_px[None], axis=2)
    np.testing.assert_array_equal(away.argmin(axis=1), found)
    assert len(found) >= least * len(truth_xy_px)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("rotation_deg", range(0, 360, 30))
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_numbers_at_every_rotation(pattern: str, rotation_deg: int, mirrored: bool) -> None:
    seen = picture(pattern, rotation_deg=rotation_deg, mirrored=mirrored)
    markers = extractor(pattern).extract(seen.image)
    assert markers.mirrored is mirrored and markers.reason is None
    assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 1.0)


# an elliptical pattern of one layer has three cells, of which two do not meet where the white cell blurs their corner
@pytest.mark.parametrize(
    ("pattern", "layers"), [*product(TRIANGULAR, [2, 3, 9]), ("honeycomb", 1), ("round", 1)]
)
def test_numbers_of_few_and_of_many_layers(pattern: str, layers: int) -> None:
    pitch_px = 26.0 if layers < 5 else 14.0
    seen = picture(pattern, layers, pitch_px=pitch_px)
    markers = extractor(pattern, layers).extract(seen.image)
    assert markers.reason is None
    assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 1.0)


SURFACES = {
    "pressed": composed(Press(3.0, 0.8)),
    "twisted": composed(Twist(4.0, 25.0)),
    "sheared": composed(Shear(3.0, (0.9, 0.5), (1.0, -1.0))),
}


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_numbers_of_a_deformed_surface(pattern: str, surface: str) -> None:
    scene = Scene(
        small_layout(pattern, 5), camera=Camera(22, 40), surface=SURFACES[surface], optics=Optics(1.0),
        sensor=Sensor(noise=2.0),
    )  # fmt: skip
    seen = render(scene, size=(360, 300))
    assert_numbered_as_the_layout(extractor(pattern, 5).extract(seen.image), seen.truth.marker_xy_px, 0.97)


@pytest.mark.parametrize("share", [0.05, 0.15])
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_missing_cells_shift_no_number(pattern: str, share: float) -> None:
    layout = small_layout(pattern, 5)
    colored = np.flatnonzero(layout.cell_color < BLACK)
    for seed in range(4):
        gone = np.random.default_rng(seed).choice(colored, int(share * len(colored)), replace=False)
        seen = scene_of(recolored(layout, dict.fromkeys(gone.tolist(), BLACK)), pitch_px=22)
        markers = extractor(pattern, 5).extract(seen.image)
        assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 0.0)


@pytest.mark.parametrize("offset_mm", [-4.0, -1.5, 1.5, 4.0])
def test_a_scratch_across_shifts_no_number(offset_mm: float) -> None:
    scratch = Scratch((-20.0, offset_mm), (20.0, offset_mm + 2.0), 0.7)
    scene = Scene(
        small_layout("honeycomb", 5), camera=Camera(22, 10), optics=Optics(1.0), sensor=Sensor(noise=2.0),
        damage=Damage(scratches=(scratch,)),
    )  # fmt: skip
    seen = render(scene, size=(360, 300))
    assert_numbered_as_the_layout(extractor("honeycomb", 5).extract(seen.image), seen.truth.marker_xy_px, 0.4)


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_missing_cells_and_cells_of_a_wrong_ink_shift_no_number(pattern: str) -> None:
    """At any rotation, from either side: every id is the layout's id, also in a picture of few cells."""
    layout, shares = small_layout(pattern, 5), []
    colored = np.flatnonzero(layout.cell_color < BLACK)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        odd = rng.permutation(colored).tolist()
        wrong, gone = odd[: rng.integers(0, 5)], odd[5 : 5 + rng.integers(0, 9)]
        colors = {cell: (int(layout.cell_color[cell]) + int(rng.integers(1, 3))) % 3 for cell in wrong}
        mirrored = bool(rng.integers(2))
        seen = scene_of(
            recolored(layout, {**colors, **dict.fromkeys(gone, BLACK)}),
            22.0,
            float(rng.uniform(0, 360)),
            mirrored,
        )
        markers = extractor(pattern, 5).extract(seen.image)
        assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 0.0)
        assert markers.mirrored in (mirrored, None)
        shares.append(np.mean(markers.status != Status.LOST))
    assert np.median(shares) > 0.95 and sorted(shares)[2] > 0.9


@pytest.mark.parametrize("count", [2, 3, 6])
def test_cells_in_a_row_are_no_pattern(count: int) -> None:
    """No triangle of cells, and so no marker between three of them."""
    image = np.full((120, 300, 3), 20, np.uint8)
    inks = ((45, 50, 200), (60, 150, 40), (190, 60, 45))
    for k in range(count):
        x = 40 + 36 * k
        corners = np.array([(x, 70), (x + 30, 70), (x + 15, 44)], np.int32)
        cv2.fillConvexPoly(image, corners, inks[k % 3], cv2.LINE_AA)
    markers = extractor().extract(image)
    assert (markers.status == Status.LOST).all() and markers.reason in (Reason.NO_PATTERN, Reason.NO_COLOR)
