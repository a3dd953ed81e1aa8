"""The square pattern's readers on rendered pictures with exact truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from cmpdesign.evaluation.square.contour_reader import SquareReader, join_corners
from cmpdesign.evaluation.square.quads import find_quads
from cmpdesign.evaluation.square.saddle_reader import SaddleReader
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Blob, Camera, Damage, Light, Optics, Scene, Sensor, Truth, Twist, composed, render
from tests.support.layouts import small_layout

PITCH_PX = 26.0
LAYERS = 3
READERS = (SquareReader, SaddleReader)


def layout() -> Layout:
    return small_layout("square", LAYERS)


def seen(turn_deg: float = 0.0, mirrored: bool = False, **parts: object) -> tuple[np.ndarray, Truth]:
    camera = Camera(pitch_px=PITCH_PX, rotation_deg=turn_deg, tilt_deg=10, mirrored=mirrored)
    parts = {"optics": Optics(1.0), "sensor": Sensor(noise=2.0), **parts}
    rendered = render(Scene(layout=layout(), camera=camera, **parts), size=(320, 280))  # type: ignore[arg-type]
    return rendered.image, rendered.truth


def reader(kind: type[SquareReader] = SquareReader, mirrored: bool = False) -> SquareReader:
    return kind(layout(), PITCH_PX, np.array([[-1.0 if mirrored else 1.0, 0.0], [0.0, 1.0]]))


def away(found: np.ndarray, truth: Truth) -> np.ndarray:
    return np.linalg.norm(found - truth.marker_xy_px, axis=1)


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turn_deg", [-35, 0, 20])
def test_every_marker_is_found_to_a_fraction_of_a_pixel(
    kind: type[SquareReader], mirrored: bool, turn_deg: float
) -> None:
    image, truth = seen(turn_deg, mirrored)
    error = away(reader(kind, mirrored).read(image), truth)
    assert np.isfinite(error).all() and np.sqrt(np.mean(error**2)) < 0.2


@pytest.mark.parametrize("response", ["srgb", 2.2])
def test_corners_are_refined_in_light(response: Literal["srgb"] | float) -> None:
    """Refined in values, the corners of the rim and of the reference cell are off by twice as much and more."""
    image, truth = seen(20, sensor=Sensor(noise=2.0, response=response))
    light, values = (
        np.sqrt(np.mean(away(replace(reader(), response=known).read(image), truth) ** 2))
        for known in (response, "linear")
    )
    assert light < 0.5 * values


@pytest.mark.parametrize("turn_deg", [52, 90, -60])
def test_beyond_the_articles_limit_numbers_are_turned(turn_deg: float) -> None:
    """Eq. 2 with n = 4: at more than 45 degrees the reference cell's corners are taken for their neighbours."""
    image, truth = seen(turn_deg)
    error = away(reader().read(image), truth)
    centre = np.isfinite(error)
    assert centre.any() and (error[centre] > PITCH_PX / 2).mean() > 0.9


@pytest.mark.parametrize("kind", READERS)
def test_a_bent_pattern_in_uneven_light_is_read(kind: type[SquareReader]) -> None:
    surface = composed(Twist(3.0, 25.0, (3.0, -4.0)))
    image, truth = seen(
        5, surface=surface, light=Light(rgb=(0.8, 0.8, 0.8), gradient=(0.4, 0.2), vignetting=0.3)
    )
    error = away(reader(kind).read(image), truth)
    assert np.isfinite(error).mean() > 0.95 and np.nanmax(error) < 3


def test_sticking_loses_markers_and_saddles_bring_some_back() -> None:
    """Blur joins the squares at their corners; a speck joins two for good."""
    x, y = layout().marker_xy_mm[layout().cell_corners[10]].mean(axis=0) + [0.75, 0.75]
    bridge = Damage(blobs=(Blob((float(x), float(y)), 0.55, (240.0, 240.0, 240.0)),))
    image, truth = seen(0, damage=bridge, optics=Optics(2.0))
    found = {kind: away(reader(kind).read(image), truth) for kind in READERS}
    lost = {kind: int(np.isnan(error).sum()) for kind, error in found.items()}
    assert lost[SquareReader] > 0 and lost[SaddleReader] <= lost[SquareReader]
    assert np.nanmax(found[SquareReader]) < PITCH_PX / 2


@pytest.mark.parametrize("kind", READERS)
def test_without_the_reference_cell_nothing_is_numbered(kind: type[SquareReader]) -> None:
    image, _ = seen(0, damage=Damage(missing_cells=(layout().reference_cell,)))
    assert np.isnan(reader(kind).read(image)).all()


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_picture_is_data(kind: type[SquareReader], level: int) -> None:
    assert np.isnan(reader(kind).read(np.full((200, 240, 3), level, np.uint8))).all()


def test_noise_is_no_pattern() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 240, 3), dtype=np.uint8)
    assert np.isnan(reader().read(noise)).all()


def test_quads_are_squares_with_their_corners_put_back() -> None:
    image, truth = seen(10)
    quads = find_quads(image, PITCH_PX)
    nearest = np.linalg.norm(quads.corners_px[:, :, None] - truth.marker_xy_px, axis=-1).min(axis=-1)
    assert np.median(nearest) < 1.5
    assert quads.reference is not None and quads.light[quads.reference]


def test_corners_join_across_quads_and_never_within_one() -> None:
    square = np.array([[0.0, 0], [20, 0], [20, 20], [0, 20]])
    touching = square + [21.0, 20.5]
    nodes, places = join_corners(np.stack([square, touching]))
    assert nodes[0, 2] == nodes[1, 0] and len(places) == 7
    assert places[nodes[0, 2]] == pytest.approx([20.5, 20.25])
