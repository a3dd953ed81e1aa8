"""The whole chain: a binocular image is rendered, each half is read, and the surface is found to micrometres."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.scene import load_scene, render
from extractor import (
    FrameStatus,
    ImageError,
    Reconstructor,
    Rig,
    ShapeTracker,
    Status,
    View,
    ViewExtractor,
    VirtualStatus,
    load_rig,
    parse_layout,
)
from tests.support.view_scenes import (
    HALF,
    SMALL,
    Array,
    binocular,
    binocular_shot,
    contact,
    reference,
    rig_of,
)

LAYOUT = reference(layers=SMALL)


def sees(mirror: bool) -> tuple[ViewExtractor, Reconstructor]:
    views = ViewExtractor(LAYOUT, rig_of(binocular(mirror=mirror)), side="back")
    return views, Reconstructor(LAYOUT, views.rig, views.extract(binocular_shot(mirror=mirror).image))


@pytest.fixture(scope="module")
def plain() -> tuple[ViewExtractor, Reconstructor]:
    return sees(False)


def test_both_halves_are_read_in_the_frame_of_the_whole_image(
    plain: tuple[ViewExtractor, Reconstructor],
) -> None:
    shot = binocular_shot(contact, 1)
    for markers, truth in zip(plain[0].extract(shot.image), shot.truth.marker_xy_px, strict=True):
        assert (markers.status == Status.MEASURED).all() and markers.mirrored
        assert np.abs(markers.xy_px - truth).max() < 0.1
    virtual = plain[0].extract(shot.image)[1].virtual_xy_px
    assert np.nanmin(virtual[..., 0]) > HALF[0]


@pytest.mark.parametrize("mirror", [False, True])
def test_the_error_in_space_is_what_the_pixels_covariance_implies(mirror: bool) -> None:
    views, reconstructor = sees(mirror)
    flat = np.column_stack([LAYOUT.xy_mm, np.zeros(len(LAYOUT.xy_mm))])
    for surface in (None, contact):
        shots = [binocular_shot(surface, seed, mirror=mirror) for seed in (11, 12)]
        errors, sigmas, moved = [], [], []
        for shot in shots:
            shape = reconstructor.reconstruct(views.extract(shot.image))
            assert (shape.status == Status.MEASURED).all() and (
                shape.virtual_status == VirtualStatus.INTERPOLATED
            ).all()
            errors.append(shape.xyz_mm - shot.truth.marker_xyz_mm)
            sigmas.append(shape.cov_mm2[:, [0, 1, 2], [0, 1, 2]])
            moved.append(shape.displacement_mm - (shot.truth.marker_xyz_mm - flat))
        ratio = np.sqrt(np.mean(np.square(errors), axis=(0, 1)) / np.mean(sigmas, axis=(0, 1)))
        assert (ratio < 1.5).all() and (ratio > 0.6).all(), ratio
        assert np.sqrt(np.mean(np.square(errors))) < 0.0012 and np.sqrt(np.mean(np.square(moved))) < 0.0015


def test_a_sequence_keeps_every_frame(plain: tuple[ViewExtractor, Reconstructor]) -> None:
    tracker, alone = ShapeTracker(plain[1], threads=2), ShapeTracker(plain[1], threads=1)

    def deeper(k: int) -> Callable[[Array], Array]:
        return lambda xy: np.column_stack([xy, -0.3 * k * np.exp(-(xy**2).sum(axis=1) / 20)])

    images = [binocular_shot(deeper(k), 20 + k).image for k in range(4)]
    dark = images[2].copy()
    dark[:, : HALF[0]] = 0
    frames = [
        tracker.track(image, time_s=0.1 * k, reason=why)
        for k, (image, why) in enumerate(
            [
                (images[0], ""),
                (images[1], ""),
                (dark, ""),
                (None, "torn"),
                (images[0][:100], ""),
                (images[3], ""),
            ]
        )
    ]
    assert [f.index for f in frames] == list(range(6)) and [f.time_s for f in frames] == [
        0.1 * k for k in range(6)
    ]
    good, lost, unreadable = FrameStatus.TRACKED, FrameStatus.LOST, FrameStatus.UNREADABLE
    assert [f.status for f in frames] == [good, good, lost, unreadable, unreadable, good]
    assert frames[2].reason.startswith("left: no_") and "right" not in frames[2].reason
    assert frames[3].reason == "left: torn; right: torn"
    assert (
        "view 'left': area_px [0, 0, 480, 360] reaches beyond the image of 960 x 100 px" in frames[4].reason
    )
    assert not frames[0].reason and np.nanmin(frames[5].shape.displacement_mm[:, 2]) < -0.5
    assert np.isnan(frames[2].shape.xyz_mm).all()
    for frame, image in zip(frames[:2], images, strict=False):  # the same bits on any number of threads
        shape = alone.track(image).shape
        np.testing.assert_array_equal(shape.xyz_mm, frame.shape.xyz_mm)
        np.testing.assert_array_equal(shape.virtual_cov_mm2, frame.shape.virtual_cov_mm2)


def test_one_image_a_view_is_plain_stereo() -> None:
    cameras = binocular()
    image = binocular_shot(contact, 30).image
    halves = [np.ascontiguousarray(image[:, : HALF[0]]), np.ascontiguousarray(image[:, HALF[0] :])]
    rig = rig_of(cameras)
    left, right = rig.views
    own = Rig(
        (
            replace(left, area_px=None),
            View(
                "right", right.focal_px, (right.centre_px[0] - HALF[0], right.centre_px[1]), right.distortion
            ),
        )
    )
    one = ViewExtractor(LAYOUT, rig, side="back").extract(image)
    two = ViewExtractor(LAYOUT, own, side="back").extract(halves)
    np.testing.assert_array_equal(one[0].xy_px, two[0].xy_px)
    np.testing.assert_allclose(one[1].xy_px, two[1].xy_px + (HALF[0], 0))
    shapes = [Reconstructor(LAYOUT, r, m).reconstruct(m) for r, m in ((rig, one), (own, two))]
    np.testing.assert_allclose(shapes[0].xyz_mm, shapes[1].xyz_mm, atol=1e-7)


def test_images_that_do_not_fit_the_rig(plain: tuple[ViewExtractor, Reconstructor]) -> None:
    image = np.zeros((200, 960, 3), np.uint8)
    with pytest.raises(
        ImageError, match=r"view 'left': area_px \[0, 0, 480, 360\] reaches beyond the image of 960 x 200"
    ):
        plain[0].extract(image)
    with pytest.raises(ImageError, match="3 images; give one for all views, or one for each of 2"):
        plain[0].extract([image] * 3)
    with pytest.raises(ImageError, match="view 'right': the image is NoneType"):
        plain[0].extract([np.zeros((360, 480, 3), np.uint8), None])  # type: ignore[list-item]


def test_a_scene_file_is_a_rig_file() -> None:
    """The virtual binocular of the templates: each view by one mirror, its pose given, or found in the rest frame."""
    path = Path(__file__).parents[3] / "templates" / "scenes" / "tac3d-binocular.toml"
    layout = build_layout(load_design("tac3d"))
    found, rig = load_scene(path, layout), load_rig(path)
    scene = found.scene()
    rest = render(replace(scene, surface=None), size=found.size_px)
    pressed = render(scene, size=found.size_px)
    views = ViewExtractor(parse_layout(layout_to_json(layout)), rig)
    seen = views.extract(rest.image), views.extract(pressed.image)
    given, placed = (Reconstructor(views.layout, r, seen[0]) for r in (rig, rig.without_poses()))
    for view, true in zip(placed.poses.views, rig.views, strict=True):
        assert true.placed and view.mirrored and not rig.without_poses().views[0].placed
        np.testing.assert_allclose(view.R_camera_from_layout, true.R_camera_from_layout, atol=2e-3)
    for reconstructor in (given, placed):
        assert not reconstructor.warnings
        shape = reconstructor.reconstruct(seen[1])
        assert (shape.status != Status.LOST).mean() > 0.98
        assert np.sqrt(np.nanmean((shape.xyz_mm - pressed.truth.marker_xyz_mm) ** 2)) < 0.003
        deepest = (pressed.truth.marker_xyz_mm - rest.truth.marker_xyz_mm)[:, 2].min()
        assert -0.8 < deepest < -0.6  # the pattern lies below the surface that is pressed by 0.8 mm
        assert np.nanmin(shape.displacement_mm[:, 2]) == pytest.approx(deepest, abs=0.01)


@pytest.mark.slow
def test_the_benchmark_runs_and_its_figures_hold(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", "benchmarks.reconstruction", "--quick", "--json", str(out)]
    root = Path(__file__).parents[3]
    run = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=600, check=False)
    assert run.returncode == 0, run.stderr
    *tables, times = json.loads(out.read_text(encoding="utf-8"))["tables"].values()
    assert [len(rows) for rows in tables] == [8, 8] and len(times) == 6
    for r in (row for rows in tables for row in rows):
        assert r["reported"] > 0.95 and r["err/cov"] < 4
        if r["state"] in ("at rest", "ball 20 mm: press 0.5 mm"):
            assert r["err/stated"] < 1.5 and r["err/image"] < 1.7 and 0.8 < r["err/cov"] < 1.3
