"""Hard cases: each gives right places, or lost markers with a reason; never a NaN that spreads, nor a wrong id.

``docs/explanation/hard-cases.md`` lists them. Warnings are errors in every test here, as everywhere.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import (
    Blob,
    Camera,
    Damage,
    Light,
    Optics,
    Press,
    Rendered,
    Scene,
    Sensor,
    composed,
    render,
)
from cmpdesign.scene.standard import BLACK_RGB, INKS, standard_layout, standard_scene
from extractor import Extractor, Markers, Reason, Status, parse_layout

ROOT = Path(__file__).parents[2]
NAMED_TEST = re.compile(r"`([\w/]+)::(test_\w+)`")  # folder/file::function, below tests/
PRESETS = ("balanced", "accurate")
LAYERS = 5
SIZE = (300, 260)
WRONG = 0.3  # of the shortest edge
Image = NDArray[np.uint8]


@cache
def extractor(pattern: str = "honeycomb", preset: str = "balanced") -> Extractor:
    return Extractor(parse_layout(layout_to_json(standard_layout(pattern, LAYERS))), preset)  # type: ignore[arg-type]


@cache
def scene(pattern: str = "honeycomb") -> Scene:
    return standard_scene(standard_layout(pattern, LAYERS))


def sound(markers: Markers, seen: Rendered | None = None) -> NDArray[np.bool_]:
    """Which markers were found; fails where anything is half known, or has another marker's id."""
    found = markers.status != Status.LOST
    np.testing.assert_array_equal(np.isfinite(markers.xy_px), np.stack([found, found], axis=1))
    assert np.isfinite(markers.cov_px2[found]).all() and np.isnan(markers.cov_px2[~found]).all()
    assert (np.linalg.eigvalsh(markers.cov_px2[found]) > 0).all()
    assert (markers.reason not in (None, Reason.FEW_MARKERS)) == (markers.mirrored is None)
    if markers.reason is None:
        refined = markers.stages["refine"]
        assert np.isfinite(refined.blur_px) and np.isfinite(refined.noise)
    placed = markers.virtual_status != 0
    np.testing.assert_array_equal(np.isfinite(markers.virtual_xy_px[..., 0]), placed)
    assert (
        np.isfinite(markers.virtual_cov_px2[placed]).all()
        and np.isnan(markers.virtual_cov_px2[~placed]).all()
    )
    assert (np.linalg.eigvalsh(markers.virtual_cov_px2[placed]) > 0).all()
    if seen is not None:
        true = seen.truth.marker_xy_px
        edges = extractor().layout.edges
        shortest = np.linalg.norm(true[edges[:, 0]] - true[edges[:, 1]], axis=1).min()
        assert not (np.linalg.norm(markers.xy_px - true, axis=1) > WRONG * shortest).any()
    return np.asarray(found)


def rms(markers: Markers, seen: Rendered) -> float:
    error = (markers.xy_px - seen.truth.marker_xy_px)[markers.status == Status.MEASURED]
    return float(np.sqrt(np.mean(error**2)))


# -- colors


@pytest.mark.parametrize(
    "red", [(200.0, 40.0, 45.0), (200.0, 40.0, 40.0), (200.0, 45.0, 40.0), (200.0, 20.0, 60.0)]
)
def test_red_straddles_the_wrap(red: tuple[float, float, float]) -> None:
    """Hues of 358, 0, 2 and 347 degrees: with noise, the 8-bit hue jumps between 0 and 179 within a cell."""
    seen = render(replace(scene(), inks={**INKS, "red": red}, sensor=Sensor(noise=4.0)), size=SIZE)
    markers = extractor().extract(seen.image)
    assert sound(markers, seen).all() and rms(markers, seen) < 0.03


@pytest.mark.parametrize("bgr", [(0, 0, 0), (255, 255, 255), (0, 0, 255), (255, 0, 0)])
def test_seeds_that_are_black_or_clipped_lose_their_cells_only(bgr: tuple[int, int, int]) -> None:
    """The middles of some cells are painted: in HSV, P . mean is 0 there, or as large as it gets."""
    seen = render(scene(), size=SIZE)
    image = np.asarray(seen.image).copy()
    layout = scene().layout
    colored = layout.cell_corners[layout.cell_color < BLACK][::6]
    for x, y in seen.truth.marker_xy_px[colored].mean(axis=1):
        cv2.circle(image, (round(x), round(y)), 2, bgr, -1)
    assert sound(extractor().extract(image), seen).mean() > 0.85


@pytest.mark.parametrize("gray", [0, 60, 128, 255])
def test_achromatic_regions_are_no_cells(gray: int) -> None:
    """Patches whose hue is undefined, on the pattern and beside it."""
    seen = render(scene(), size=SIZE)
    image = np.asarray(seen.image).copy()
    image[100:118, 60:78] = image[5:30, 5:30] = gray
    found = sound(extractor().extract(image), seen)
    assert found.mean() > 0.9


@pytest.mark.parametrize(("gain", "limit_px"), [((1.2, 1.2, 1.2), 0.03), ((1.6, 1.9, 1.6), 0.4)])
def test_saturated_channels_are_read(gain: tuple[float, float, float], limit_px: float) -> None:
    """Light that clips the white cell, and light that clips every ink's own channel: that moves its edges outward."""
    seen = render(replace(scene(), light=Light(rgb=gain)), size=SIZE)
    assert (np.asarray(seen.image) == 255).any(axis=(0, 1)).all()
    markers = extractor().extract(seen.image)
    assert sound(markers, seen).all() and rms(markers, seen) < limit_px


def test_clipped_cells_are_read_without_an_estimate_of_the_noise() -> None:
    """Every channel of every cell is 0 or 255, where noise does not show."""
    seen = render(scene(), size=SIZE)
    image = np.clip((np.asarray(seen.image, np.float64) - 100) * 8, 0, 255).astype(np.uint8)
    markers = extractor().extract(image)
    assert np.isnan(markers.quality.noise)
    assert sound(markers, seen).all() and rms(markers, seen) < 0.4


# -- shapes


def test_regions_of_one_pixel_are_clutter() -> None:
    """Single pixels of every ink all over the picture."""
    seen = render(scene(), size=SIZE)
    image = np.asarray(seen.image).copy()
    rng = np.random.default_rng(1)
    y, x = rng.integers(0, SIZE[1], 300), rng.integers(0, SIZE[0], 300)
    image[y, x] = np.array([(45, 50, 200), (60, 150, 40), (190, 60, 45)], np.uint8)[np.arange(300) % 3]
    assert sound(extractor().extract(image), seen).mean() > 0.95


@pytest.mark.parametrize("grain_px", [0.7, 2.0, 4.0])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_a_pattern_amid_colored_noise_is_read(pattern: str, grain_px: float) -> None:
    """Thousands of domains around the pattern, so many that only domains like cells are examined; also coarse
    domains.
    """
    seen = render(scene(pattern), size=SIZE)
    grain = np.random.default_rng(2).standard_normal((600, 800, 3), dtype=np.float32)
    grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), grain_px))
    image = np.clip(127 + 70 * grain / grain.std(), 0, 255).astype(np.uint8)
    within = cv2.convexHull(np.rint(seen.truth.marker_xy_px).astype(np.int32))
    mask = cv2.dilate(cv2.fillConvexPoly(np.zeros(SIZE[::-1], np.uint8), within, 1), np.ones((15, 15)))
    image[: SIZE[1], : SIZE[0]][mask > 0] = seen.image[mask > 0]
    markers = extractor(pattern).extract(image)
    assert sound(markers, seen).all() and rms(markers, seen) < 0.05


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("grain_px", [0.7, 1.0, 3.0])
def test_in_an_image_of_noise_there_is_nothing(grain_px: float, seed: int) -> None:
    grain = np.random.default_rng(seed).standard_normal((480, 640, 3), dtype=np.float32)
    grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), grain_px))
    image = np.clip(127 + 70 * grain / grain.std(), 0, 255).astype(np.uint8)
    markers = extractor().extract(image)
    assert not sound(markers).any() and markers.reason is not None


def test_lines_one_pixel_wide_are_no_triangles() -> None:
    """Their corners are collinear; alone they are no pattern. Around one they change nothing, or hide where it ends."""
    seen = render(scene(), size=SIZE)

    def with_lines(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        height, width = image.shape[:2]
        for k in range(6, 48, 8):
            color = ((45, 50, 200), (60, 150, 40), (190, 60, 45))[k // 8 % 3]
            cv2.line(image, (k, 4), (k, height - 5), color, 1)
            cv2.line(image, (4, k), (width - 5, k), color, 1)
            cv2.line(image, (4, height - k), (k, height - 4), color, 1)
        return image

    assert not sound(extractor().extract(with_lines(np.zeros_like(seen.image)))).any()
    found = []
    for x, y in ((60, 70), (90, 100)):
        around = np.full((y + 330, x + 360, 3), 20, np.uint8)
        around[y : y + SIZE[1], x : x + SIZE[0]] = seen.image
        markers = extractor().extract(with_lines(around))
        found.append(sound(markers).all())
        assert found[-1] or markers.reason is Reason.REFERENCE_LOST
        if found[-1]:
            np.testing.assert_allclose(markers.xy_px - (x, y), seen.truth.marker_xy_px, atol=0.3)
    assert any(found)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("tilt_deg", [60.0, 66.0, 70.0, 78.0, 84.0])
def test_gridlines_seen_nearly_parallel(tilt_deg: float, preset: str) -> None:
    """From the side all gridlines run nearly along one direction, two of them on one line, and edges across it are a
    pixel long."""
    seen = render(replace(scene(), camera=Camera(26.0, 7.3, tilt_deg, 20.0)), size=(360, 260))
    found = sound(extractor(preset=preset).extract(seen.image), seen)
    assert found.all() or tilt_deg > 66.0


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    ("pitch_px", "blur_px"), [(18.0, 19.0), (8.0, 9.0), (8.0, 2.0), (6.0, 1.0), (4.0, 0.5)]
)
def test_edges_shorter_than_the_blur(preset: str, pitch_px: float, blur_px: float) -> None:
    shown = replace(scene(), camera=Camera(pitch_px, rotation_deg=7.3), optics=Optics(blur_px))
    seen = render(shown, size=SIZE)
    sound(extractor(preset=preset).extract(seen.image), seen)


# -- places


@pytest.mark.parametrize("shift_px", [(0.0, 0.0), (-0.49, -0.49), (0.5, 0.5), (-1.0, 3.0), (7.3, -4.1)])
def test_markers_at_the_images_border(shift_px: tuple[float, float]) -> None:
    """A frame that cuts the pattern: markers on the border's pixels, just outside and just inside."""
    at = (SIZE[0] / 4 + shift_px[0], SIZE[1] / 4 + shift_px[1])
    seen = render(replace(scene(), camera=Camera(20.0, centre_px=at)), size=(SIZE[0] // 2, SIZE[1] // 2))
    markers = extractor().extract(seen.image)
    found = sound(markers, seen)
    limit = np.array([SIZE[0] // 2, SIZE[1] // 2]) - 0.5
    assert ((markers.xy_px[found] >= -0.5) & (markers.xy_px[found] <= limit)).all()
    deep = ((seen.truth.marker_xy_px > 20) & (seen.truth.marker_xy_px < limit - 20)).all(axis=1)
    assert deep.sum() > 10 and found[deep].all()


@pytest.mark.parametrize("pitch_mm", [0.05, 500.0])
def test_patterns_of_any_size_are_read_alike(pitch_mm: float) -> None:
    """The picture is the same; only the layout's millimetres differ."""
    options = {"layers": str(LAYERS), "pitch_mm": str(pitch_mm), "border_mm": str(pitch_mm)}
    layout = build_layout(load_design("honeycomb", options))
    usual = render(scene(), size=SIZE)
    markers = Extractor(parse_layout(layout_to_json(layout))).extract(usual.image)
    np.testing.assert_allclose(markers.xy_px, extractor().extract(usual.image).xy_px, atol=1e-5)
    image = np.asarray(usual.image).copy()
    image[100:140, 120:150] = BLACK_RGB
    repaired = Extractor(parse_layout(layout_to_json(layout))).extract(image)
    assert (sound(repaired) == sound(extractor().extract(image))).all()
    np.testing.assert_array_equal(repaired.status, extractor().extract(image).status)


@pytest.mark.parametrize("origin_px", [(9600, 0), (0, 9600), (19200, 0)])
def test_a_pattern_far_from_the_origin_is_read_alike(origin_px: tuple[int, int]) -> None:
    """A window of a stitched picture, with a hole in it."""
    seen = render(scene(), size=SIZE)
    near = np.asarray(seen.image).copy()
    near[100:140, 120:150] = BLACK_RGB
    x, y = origin_px
    far = np.full((y + SIZE[1], x + SIZE[0], 3), 20, np.uint8)
    far[y:, x:] = near
    found, moved = extractor().extract(near), extractor().extract(far)
    np.testing.assert_array_equal(sound(moved), sound(found))
    assert np.nanmax(np.linalg.norm(moved.xy_px - origin_px - seen.truth.marker_xy_px, axis=1)) < 0.5
    assert rms(replace(moved, xy_px=moved.xy_px - origin_px), seen) < 0.05


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_a_layer_with_few_markers_left_is_not_invented(pattern: str, share: float) -> None:
    """Any cells of the rim and beside the rim are missing: fitted markers between have correct positions."""
    layout = scene(pattern).layout
    at_rim = (layout.marker_layer[layout.cell_corners] >= LAYERS - 1).any(axis=1) & (
        layout.cell_color < BLACK
    )
    for seed in range(4):
        gone = np.flatnonzero(at_rim & (np.random.default_rng(seed).random(len(at_rim)) < share))
        surface = composed(Press(5.0, 1.0)) if seed % 2 else None
        damage = Damage(missing_cells=tuple(gone.tolist()))
        seen = render(replace(scene(pattern), damage=damage, surface=surface, seed=seed), size=SIZE)
        markers = extractor(pattern).extract(seen.image)
        sound(markers, seen)
        assert np.nanmax(np.linalg.norm(markers.xy_px - seen.truth.marker_xy_px, axis=1)) < 2.0


# -- dirt


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("seed", range(6))
def test_a_marker_put_back_beside_dirt_spreads_no_nan(seed: int, preset: str) -> None:
    """Large dark blots: markers leave the solution and come back, and their cells' levels were never seen."""
    rng = np.random.default_rng(200 + seed)
    blots = tuple(Blob((float(x), float(y)), 1.6, BLACK_RGB) for x, y in rng.uniform(-3.5, 3.5, (2, 2)))
    shown = replace(scene(), damage=Damage(blobs=blots), surface=composed(Press(3.0, 0.4)), seed=seed)
    seen = render(shown, size=SIZE)
    markers = extractor(preset=preset).extract(seen.image)
    sound(markers, seen)
    if markers.reason is None:
        assert 1.0 < markers.stages["refine"].noise < 6.0  # 2 in truth; blots are not all of the misfit


# -- the table


def test_every_hard_case_of_the_table_names_a_test() -> None:
    page = (ROOT / "docs" / "explanation" / "hard-cases.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("|")][2:]
    assert len(rows) >= 15
    for row in rows:
        named = NAMED_TEST.findall(row)
        assert named, f"no test is named in {row!r}"
        for module, name in named:
            text = (ROOT / "tests" / f"{module}.py").read_text(encoding="utf-8")
            assert f"\ndef {name}(" in text, (module, name)
    listed = {name for _, name in NAMED_TEST.findall(page)}
    mine = {name for name in globals() if name.startswith("test_") and "table" not in name}
    assert mine <= listed, mine - listed
