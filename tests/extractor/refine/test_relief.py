"""Pads with relief: the height of cells moves markers to the plane of the black; covariances say how well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import AsMade, Layout
from cmpdesign.scene import Camera, Press, composed, render, standard_layout, standard_scene
from extractor import Extractor, Markers, Status, Tracker, parse_layout

CAMERAS = tuple(
    Camera(28.0, rotation_deg=turn, tilt_deg=tilt, tilt_axis_deg=2 * turn, focal_px=focal)
    for turn, tilt, focal in (
        (7.0, 0.0, 450.0),
        (50.0, 6.0, 600.0),
        (111.0, 12.0, 500.0),
        (200.0, 20.0, 550.0),
    )
)


def made(height_mm: float) -> Layout:
    layout = standard_layout("honeycomb", 6)
    return replace(layout, as_made=AsMade(layout.digest, "measured", "front", cell_height_mm=height_mm))


def read(layout: Layout, image: np.ndarray) -> Markers:
    return Extractor(parse_layout(layout_to_json(layout))).extract(image)


@pytest.mark.parametrize("height_mm", [-0.15, 0.15])
def test_the_height_of_cells_brings_markers_to_the_black_and_without_it_errors_are_covered(
    height_mm: float,
) -> None:
    squares, untold_squares, told, untold = [], [], [], []
    for camera in CAMERAS:
        shot = render(replace(standard_scene(made(height_mm)), camera=camera))
        with_height, without = (read(made(height), shot.image) for height in (height_mm, 0.0))
        measured = (with_height.status == Status.MEASURED) & (without.status == Status.MEASURED)
        assert measured.mean() > 0.95
        for found, d2, errors in ((with_height, squares, told), (without, untold_squares, untold)):
            error, cov = (found.xy_px - shot.truth.marker_xy_px)[measured], found.cov_px2[measured]
            d2.append(np.einsum("mi,mij,mj->m", error, np.linalg.inv(cov), error))
            errors.append((error**2).sum(axis=1))
        assert not np.array_equal(with_height.virtual_xy_px, without.virtual_xy_px)
    d2 = np.concatenate(squares)
    assert 0.4 < np.sqrt(d2.mean() / 2) < 1.3 and (d2 > 11.83).mean() < 0.01
    assert np.sqrt(np.concatenate(untold_squares).mean() / 2) < 1.3  # 3.1 to 3.9 by the noise alone
    assert np.concatenate(told).mean() < 0.5 * np.concatenate(untold).mean()


def test_a_flat_pad_is_read_as_before() -> None:
    """A height of 0 is no height: the same bits as without ``as_made``."""
    layout = made(0.0)
    image = render(replace(standard_scene(layout), camera=CAMERAS[1])).image
    flat, designed = read(layout, image), read(replace(layout, as_made=None), image)
    for name in ("xy_px", "cov_px2", "status", "virtual_xy_px", "virtual_cov_px2"):
        np.testing.assert_array_equal(getattr(flat, name), getattr(designed, name))


def test_a_tracker_keeps_the_parallax_of_its_first_picture() -> None:
    """A contact changes the apparent sizes of cells; displacements are as good as without the height."""
    scene = replace(standard_scene(made(-0.15)), camera=CAMERAS[2])
    pressed = replace(scene, surface=composed(Press(radius_mm=3.0, depth_mm=0.4)), seed=1)
    shots = [render(each) for each in (scene, replace(scene, seed=2), pressed)]
    moved = shots[2].truth.marker_xy_px - shots[0].truth.marker_xy_px
    errors = {}
    for height_mm in (-0.15, 0.0):
        tracker = Tracker(parse_layout(layout_to_json(made(height_mm))))
        rest, _, contact = (tracker.track(shot.image).markers.xy_px for shot in shots)
        errors[height_mm] = float(np.sqrt(np.nanmean((contact - rest - moved) ** 2)))
    assert errors[-0.15] < 1.1 * errors[0.0]
