"""Surfaces that turn away from the camera: hidden parts, against points in a depth buffer."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import (
    Blob,
    Damage,
    Dent,
    Optics,
    Pinhole,
    Scene,
    SceneError,
    Sensor,
    composed,
    render,
    standard_layout,
)
from cmpdesign.scene.drawing.occlusion import update_hidden_parts
from cmpdesign.scene.drawing.patches import ground_patches, subdivide_triangle
from cmpdesign.scene.drawing.view import single_view

SIZE = (200, 160)
WINDOW = (slice(50, 110), slice(75, 140))  # rows and columns around the dent
FINER = 3
Points = NDArray[np.float64]


@pytest.fixture(scope="module")
def steep() -> Scene:
    camera = Pinhole.looking(
        SIZE, distance_mm=12, field_of_view_deg=24, tilt_deg=55, azimuth_deg=30, back=True
    )
    return Scene(
        standard_layout(layers=3),
        camera,
        composed(Dent(0.5, 1.1, (0.3, 0.4))),
        sensor=Sensor(response="linear"),
    )


def depth_buffer(scene: Scene) -> tuple[NDArray[np.float64], Points]:
    """The nearest of many points in every sub-pixel: image (H, W, 3) BGR, and depth of the finer image."""
    layout, view = scene.layout, single_view(scene, SIZE)
    ground = ground_patches(layout)
    near = np.linalg.norm(ground.mean(axis=1) - (0.3, 0.4), axis=1) < 1.6
    count = SIZE[0] * FINER * SIZE[1] * FINER
    depth, color = np.full(count, np.inf), np.full((count, 3), 20.0)
    inks = np.array([scene.ink(int(c))[::-1] for c in layout.cell_color] + [scene.ink(BLACK)[::-1]])
    for number, (corners, dense) in enumerate(zip(ground, near, strict=True)):
        at, _ = subdivide_triangle(300 if dense else 100)
        x, y, away = view.depth_from_layout(at @ corners).T
        column, row = (np.floor((v + 0.5) * FINER).astype(int) for v in (x, y))
        inside = (column >= 0) & (column < SIZE[0] * FINER) & (row >= 0) & (row < SIZE[1] * FINER)
        place, away = (row * SIZE[0] * FINER + column)[inside], away[inside]
        before = depth.copy()
        np.minimum.at(depth, place, away)
        color[depth < before] = inks[min(number, len(inks) - 1)]
    shape = (SIZE[1], FINER, SIZE[0], FINER)
    return color.reshape(*shape, 3).mean(axis=(1, 3)), depth.reshape(SIZE[1] * FINER, SIZE[0] * FINER)


def test_the_nearest_part_is_drawn(steep: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    expected, _ = depth_buffer(steep)
    drawn = render(steep, size=SIZE)
    assert len(drawn.warnings) == 1 and "% of the pattern turn away" in drawn.warnings[0]
    error = np.abs(drawn.image[WINDOW] - expected[WINDOW]).mean(axis=2)
    assert error.max() < 100 and error.mean() < 2.0  # the buffer's own edges are a third of a pixel wide
    # Without the correction it is wrong there, so the comparison can fail.
    monkeypatch.setattr(sys.modules["cmpdesign.scene.drawing.render"], "update_hidden_parts", lambda *_: None)
    signed = np.abs(render(steep, size=SIZE).image[WINDOW] - expected[WINDOW]).mean(axis=2)
    assert (signed > 100).mean() > 0.003


def test_hidden_markers_are_not_visible(steep: Scene) -> None:
    _, nearest = depth_buffer(steep)
    layout, view = steep.layout, single_view(steep, SIZE)
    truth = render(steep, size=SIZE).truth
    flat = render(replace(steep, surface=None), size=SIZE).truth
    hidden = np.flatnonzero(flat.visible & ~truth.visible)
    for marker in np.flatnonzero(flat.visible):
        x, y, depth = view.depth_from_layout(layout.marker_xy_mm[marker : marker + 1])[0]
        column, row = int((x + 0.5) * FINER), int((y + 0.5) * FINER)
        around = nearest[row - 1 : row + 2, column - 1 : column + 2]
        assert (depth > around.max() + 0.05) <= (marker in hidden)
        assert (depth < around.min() + 0.01) <= (marker not in hidden)
    assert 1 <= len(hidden) <= 4
    assert 0 < flat.cell_visible.sum() - truth.cell_visible.sum() < 8


def test_nothing_changes_beside_the_fold(steep: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    blurred = replace(steep, optics=Optics(1.0))
    with_it = render(blurred, size=SIZE).image.astype(int)
    monkeypatch.setattr(sys.modules["cmpdesign.scene.drawing.render"], "update_hidden_parts", lambda *_: None)
    changed = np.abs(with_it - render(blurred, size=SIZE).image).max(axis=2) > 0
    assert 20 < changed.sum() < 0.03 * changed.size
    rows, columns = np.nonzero(changed)
    assert rows.min() >= WINDOW[0].start and rows.max() < WINDOW[0].stop
    assert columns.min() >= WINDOW[1].start and columns.max() < WINDOW[1].stop


def test_a_blur_spreads_what_was_corrected_without_loss(steep: Scene) -> None:
    folds = single_view(steep, SIZE).occlusion
    assert folds is not None
    width, height = folds.texture_size
    texture = np.zeros((1, height, width), np.float32)
    texture[0, :, : width // 2] = 1.0
    sums = []
    for blur_px in (0.0, 0.7, 1.5):
        planes = np.zeros((1, SIZE[1], SIZE[0]), np.float32)
        update_hidden_parts(planes, folds, texture, blur_px)
        sums.append(planes.sum())
    assert abs(sums[0]) > 1
    np.testing.assert_allclose(sums, sums[0], rtol=2e-3)


def test_dirt_and_bleeding_inks_are_hidden_like_all_else(steep: Scene) -> None:
    """A blob paints the nearest part alone: a blob under the whole surface paints all visible parts in its color."""
    everywhere = Damage(blobs=(Blob((0.0, 0.0), 5.0, (90, 80, 70)),))
    drawn = render(replace(steep, damage=everywhere), size=SIZE).image[WINDOW].astype(int)
    np.testing.assert_allclose(drawn - (70, 80, 90), 0, atol=1)
    plain = render(steep, size=SIZE).image.astype(int)
    dirty = render(
        replace(steep, damage=Damage(blobs=(Blob((0.3, 0.4), 0.25, (255, 0, 255)),))), size=SIZE
    ).image
    away = np.abs(dirty - plain).max(axis=2) > 1
    x, y = single_view(steep, SIZE).image_from_layout(np.array([[0.3, 0.4]]))[0]
    rows, columns = np.nonzero(away)
    assert 20 < away.sum() < 600 and np.hypot(rows - y, columns - x).max() < 25
    bled = render(replace(steep, damage=Damage(bleed_mm=0.02)), size=SIZE).image
    assert np.abs(bled - plain).mean() < 4 and np.abs(bled - plain).max() > 20


def test_too_much_is_refused(steep: Scene) -> None:
    with pytest.raises(SceneError, match="% of the pattern turn away from the camera"):
        render(replace(steep, surface=composed(Dent(2.0, 9.0))), size=SIZE)
    with pytest.raises(SceneError, match="not finite"):
        render(replace(steep, surface=lambda xy: np.column_stack([xy, np.full(len(xy), np.nan)])), size=SIZE)


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "square"])
def test_patches_fill_the_outline_and_face_the_front(pattern: str) -> None:
    layout: Layout = standard_layout(pattern, 3)
    ground = ground_patches(layout)
    a, b = (ground[:, i] - ground[:, 0] for i in (1, 2))
    areas = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(shapely.Polygon(layout.outline_mm).area, rel=1e-9)
    assert shapely.union_all(shapely.polygons(ground)).area == pytest.approx(areas.sum())
    cells = layout.marker_xy_mm[layout.cell_corners]
    np.testing.assert_array_equal(ground[: len(cells)], cells[:, :3])


@pytest.mark.parametrize("parts", [1, 2, 5])
def test_a_subdivision_fills_its_triangle(parts: int) -> None:
    at, small = subdivide_triangle(parts)
    assert len(small) == parts**2 and len(at) == (parts + 1) * (parts + 2) // 2
    corners = (at @ np.array([[0.0, 0], [1, 0], [0, 1]]))[small]
    a, b = (corners[:, i] - corners[:, 0] for i in (1, 2))
    np.testing.assert_allclose(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), 0.5 / parts**2)
