"""Every kind of image, pictures of other things, damaged white cells: no id is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK, WHITE
from cmpdesign.scene import Truth
from extractor import (
    Extractor,
    ImageError,
    LayoutError,
    Markers,
    Origin,
    Reason,
    Status,
    VirtualStatus,
    parse_layout,
)
from extractor.draw import STATUS_BGR, draw_markers
from tests.support.layouts import PATTERNS, small_layout, small_text
from tests.support.pictures import (
    STRANGE,
    Image,
    extractor,
    picture,
    recolored,
    scene_of,
    srgb_light,
    srgb_values,
)

TRIANGULAR = PATTERNS[:3]
STAGES = ["image", "seeds", "mesh", "light", "walk", "number", "triangles", "place", "refine"]


def errors_px(markers: Markers, truth: Truth) -> NDArray[np.float64]:
    """Distances of the found markers from the truth; a wrong id has an error of many pixels."""
    found = np.isfinite(markers.xy_px).all(axis=1)
    return np.asarray(np.hypot(*(markers.xy_px[found] - truth.marker_xy_px[found]).T))


def assert_close(found: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    """The same markers to a fraction of their error: the noise is the same, only the order of the pixels is not."""
    distance = np.hypot(*(found - expected).T)
    assert np.median(distance) < 0.02 and distance.max() < 0.15


def assert_nothing(markers: Markers, *reasons: Reason) -> None:
    assert markers.reason in reasons
    assert np.isnan(markers.xy_px).all() and np.isnan(markers.cov_px2).all()
    assert (markers.status == Status.LOST).all() and (markers.virtual_status == VirtualStatus.LOST).all()
    assert np.isnan(markers.virtual_xy_px).all()
    assert markers.mirrored is None


def test_the_legend_has_the_color_of_every_status_that_is_drawn() -> None:
    """The strip at the bottom, which has no markers."""
    seen = picture()
    markers = extractor().extract(seen.image)
    status = markers.status.copy()
    status[5] = Status.REPAIRED
    reference = parse_layout(small_text("honeycomb", 4))
    drawn = draw_markers(seen.image, reference, replace(markers, status=status))
    strip = drawn[-round(34 * drawn.shape[1] / 1600) :]
    shown = [one for one, color in STATUS_BGR.items() if (strip == color).all(axis=2).any()]
    assert shown == [Status.MEASURED, Status.REPAIRED]


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_conventions_of_a_result(pattern: str) -> None:
    layout, seen = small_layout(pattern, 4), picture(pattern)
    markers = extractor(pattern).extract(seen.image)
    count, edges, virtual = len(layout.marker_xy_mm), len(layout.edges), layout.virtual_per_edge
    assert markers.reason is None and markers.mirrored is False
    assert markers.xy_px.shape == (count, 2) and markers.xy_px.dtype == np.float64
    assert markers.cov_px2.shape == (count, 2, 2) and markers.cov_px2.dtype == np.float64
    assert markers.status.shape == (count,) and markers.status.dtype == np.uint8
    assert markers.virtual_xy_px.shape == (edges, virtual, 2)
    assert markers.virtual_status.shape == (edges, virtual) and markers.virtual_status.dtype == np.uint8
    assert (markers.status == Status.MEASURED).all() and errors_px(markers, seen.truth).max() < 0.5
    np.testing.assert_array_equal(markers.cov_px2, markers.cov_px2.transpose(0, 2, 1))
    assert (np.linalg.eigvalsh(markers.cov_px2) > 0).all()
    assert np.linalg.norm(markers.virtual_xy_px - seen.truth.virtual_xy_px, axis=-1).max() < 0.5


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_the_covariance_is_honest(pattern: str) -> None:
    """Over many noises, squared errors agree with the covariance within a factor of three."""
    errors, claimed = [], []
    for seed in range(6):
        noisy = picture(pattern, noise=0.0)
        rng = np.random.default_rng(seed)
        image = np.clip(np.rint(noisy.image + rng.normal(0, 4, noisy.image.shape)), 0, 255).astype(np.uint8)
        markers = extractor(pattern).extract(image)
        errors.append(markers.xy_px - extractor(pattern).extract(noisy.image).xy_px)
        claimed.append(markers.cov_px2[:, [0, 1], [0, 1]])
    ratio = np.nanmedian(np.mean(np.square(errors), axis=0) / np.mean(claimed, axis=0))
    assert 1 / 3 < ratio < 3


def test_lost_markers_are_nan_and_lost() -> None:
    """A view of a part: markers outside are lost, found markers are correct, and a gridline with a lost end is lost."""
    seen = picture(size=(150, 130))
    markers = extractor().extract(seen.image)
    found = np.isfinite(markers.xy_px).all(axis=1)
    assert 5 < found.sum() < len(found)
    assert ((markers.status != Status.LOST) == found).all()
    assert (np.isfinite(markers.cov_px2).all(axis=(1, 2)) == found).all()
    assert errors_px(markers, seen.truth).max() < 1.0
    both = found[small_layout("honeycomb", 4).edges].all(axis=1)
    assert ((markers.virtual_status == VirtualStatus.LOST) == ~both[:, None]).all()
    assert (np.isfinite(markers.virtual_xy_px).all(axis=-1) == both[:, None]).all()


def test_every_stage_is_timed_in_order() -> None:
    markers = extractor().extract(picture().image)
    names = list(markers.timings_ms)
    assert names == [*STAGES, "repair", "quality"]
    assert all(0 <= ms < 60_000 for ms in markers.timings_ms.values())
    assert set(markers.stages) == set(names)
    nothing = extractor().extract(np.zeros((64, 64, 3), np.uint8))
    assert set(nothing.timings_ms) <= {*names, "grow"} and nothing.timings_ms


def test_results_are_frozen() -> None:
    markers = extractor().extract(picture().image)
    with pytest.raises(FrozenInstanceError):
        markers.reason = None  # type: ignore[misc]
    for mapping in (markers.timings_ms, markers.stages):
        with pytest.raises(TypeError):
            mapping["image"] = 0.0  # type: ignore[index]


def test_the_same_image_gives_the_same_bytes_and_is_left_alone() -> None:
    image = picture().image.copy()
    first, second = extractor().extract(image), extractor().extract(image)
    assert first.xy_px.tobytes() == second.xy_px.tobytes()
    assert first.cov_px2.tobytes() == second.cov_px2.tobytes()
    np.testing.assert_array_equal(image, picture().image)
    image.setflags(write=False)
    assert extractor().extract(image).xy_px.tobytes() == first.xy_px.tobytes()


def with_alpha(image: Image) -> Image:
    alpha = np.random.default_rng(0).integers(0, 256, (*image.shape[:2], 1), np.uint8)
    return np.concatenate([image, alpha], axis=2)


SAME = {
    "alpha": with_alpha,
    "16-bit": lambda image: image.astype(np.uint16) * 257,
    "16-bit, the high byte first": lambda image: (image.astype(np.uint16) * 257).astype(">u2"),
    "16-bit, the low byte first": lambda image: (image.astype(np.uint16) * 257).astype("<u2"),
    "16-bit with alpha": lambda image: with_alpha(image).astype(np.uint16) * 257,
    "Fortran order": np.asfortranarray,
    "every second pixel of a larger one": lambda image: image.repeat(2, axis=0).repeat(2, axis=1)[::2, ::2],
    "reversed channels of RGB": lambda image: np.ascontiguousarray(image[..., ::-1])[..., ::-1],
}


@pytest.mark.parametrize("kind", SAME)
def test_other_ways_to_hold_the_same_picture(kind: str) -> None:
    """The response is stated: without, 16 bits are linear."""
    image, by = picture().image, Extractor(extractor().layout, response="srgb")
    expected = by.extract(image)
    markers = by.extract(SAME[kind](image))
    np.testing.assert_array_equal(markers.xy_px, expected.xy_px)
    np.testing.assert_array_equal(markers.status, expected.status)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grayscale_has_no_color(dtype: type) -> None:
    gray = cv2.cvtColor(picture().image, cv2.COLOR_BGR2GRAY).astype(dtype)
    assert_nothing(extractor().extract(gray), Reason.NO_COLOR)
    assert_nothing(extractor().extract(gray[..., None]), Reason.NO_COLOR)
    thrice = extractor().extract(np.repeat(gray[..., None], 3, axis=2))
    assert_nothing(thrice, Reason.NO_COLOR, Reason.NO_PATTERN)


BAD = {
    "float": (np.zeros((64, 64, 3)), "float64"),
    "float32": (np.zeros((64, 64, 3), np.float32), "float32"),
    "signed": (np.zeros((64, 64, 3), np.int16), "int16"),
    "bool": (np.zeros((64, 64, 3), bool), "bool"),
    "object": (np.full((64, 64, 3), None), "object"),
    "one dimension": (np.zeros(64, np.uint8), r"\(64,\)"),
    "a stack": (np.zeros((2, 64, 64, 3), np.uint8), r"\(2, 64, 64, 3\)"),
    "two channels": (np.zeros((64, 64, 2), np.uint8), r"\(64, 64, 2\)"),
    "channels first": (np.zeros((3, 64, 64), np.uint8), r"\(3, 64, 64\)"),
    "no pixels": (np.zeros((0, 0, 3), np.uint8), "0 x 0 px"),
    "no rows": (np.zeros((0, 64, 3), np.uint8), "64 x 0 px"),
    "one pixel": (np.zeros((1, 1, 3), np.uint8), "1 x 1 px"),
    "one row": (np.zeros((1, 640, 3), np.uint8), "640 x 1 px"),
    "small": (np.zeros((15, 640, 3), np.uint8), "at least 16 px"),
    "None": (None, "NoneType"),
    "a list": ([[[0, 0, 0]]], "list"),
    "a path": ("image.png", "str"),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_is_no_image_is_refused_in_one_line(kind: str) -> None:
    image, words = BAD[kind]
    with pytest.raises(ImageError, match=words) as caught:
        extractor().extract(image)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value) and "give" in str(caught.value)


def test_square_patterns_are_refused() -> None:
    with pytest.raises(LayoutError, match="'square'"):
        Extractor(parse_layout(small_text("square", 2)))


@pytest.mark.parametrize("size", [(16, 16), (17, 640), (64, 48), (321, 243)])
@pytest.mark.parametrize("color", [(0, 0, 0), (255, 255, 255), (20, 20, 220), (127, 127, 127), (0, 255, 255)])
def test_constant_images_hold_nothing(size: tuple[int, int], color: tuple[int, int, int]) -> None:
    image = np.full((*size, 3), color, np.uint8)
    assert_nothing(extractor().extract(image), Reason.NO_COLOR, Reason.NO_PATTERN)


@pytest.mark.parametrize("kind", STRANGE)
@pytest.mark.parametrize("layers", [2, 4])
def test_pictures_of_anything_else_hold_nothing(kind: str, layers: int) -> None:
    for seed in range(12):
        image = STRANGE[kind](np.random.default_rng(seed))
        assert_nothing(
            extractor("honeycomb", layers).extract(image),
            Reason.NO_COLOR, Reason.NO_PATTERN, Reason.REFERENCE_LOST, Reason.AMBIGUOUS, Reason.SEVERAL_PADS,
        )  # fmt: skip


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_without_a_reference_cell_the_outline_settles_the_numbering(pattern: str) -> None:
    layout = small_layout(pattern, 4)
    seen = scene_of(recolored(layout, {int(np.flatnonzero(layout.cell_color == WHITE)[0]): BLACK}))
    markers = extractor(pattern).extract(seen.image)
    assert markers.origin is Origin.OUTLINE
    assert errors_px(markers, seen.truth).max() < 1.0
    assert (markers.status == Status.MEASURED).mean() > 0.9


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_without_reference_cell_and_outline_it_is_lost(pattern: str) -> None:
    """Only a part of the rim is in view: several places fit."""
    layout = small_layout(pattern, 8)
    black = recolored(layout, {int(np.flatnonzero(layout.cell_color == WHITE)[0]): BLACK})
    seen = scene_of(black, pitch_px=40)
    assert_nothing(extractor(pattern, 8).extract(seen.image), Reason.REFERENCE_LOST)


def black_cells_by_distance(layers: int = 4) -> tuple[int, NDArray[np.intp]]:
    """The white cell and the black ones, the nearest first."""
    layout = small_layout("honeycomb", layers)
    white = int(np.flatnonzero(layout.cell_color == WHITE)[0])
    middle = layout.marker_xy_mm[layout.cell_corners].mean(axis=1)
    black = np.flatnonzero(layout.cell_color == BLACK)
    return white, black[np.argsort(np.linalg.norm(middle[black] - middle[white], axis=1), kind="stable")]


@pytest.mark.parametrize("at", [0, 1, 7, 20, -1])
def test_of_two_white_cells_the_one_that_fits_the_outline_counts(at: int) -> None:
    _, black = black_cells_by_distance()
    seen = scene_of(recolored(small_layout("honeycomb", 4), {int(black[at]): WHITE}))
    markers = extractor().extract(seen.image)
    assert errors_px(markers, seen.truth).max() < 1.0
    assert (markers.status == Status.MEASURED).mean() > 0.9


@pytest.mark.parametrize("at", [0, 1, 7])
def test_two_white_cells_without_the_outline_are_several_pads(at: int) -> None:
    _, black = black_cells_by_distance(8)
    seen = scene_of(recolored(small_layout("honeycomb", 8), {int(black[at]): WHITE}), pitch_px=60)
    assert_nothing(extractor("honeycomb", 8).extract(seen.image), Reason.SEVERAL_PADS)


@pytest.mark.parametrize("at", [0, 1, 7, 20, -1])
def test_a_false_reference_cell_is_not_believed(at: int) -> None:
    """The white cell is black and another one is bright, as with a glint: the outline contradicts the bright one."""
    white, black = black_cells_by_distance()
    seen = scene_of(recolored(small_layout("honeycomb", 4), {white: BLACK, int(black[at]): WHITE}))
    markers = extractor().extract(seen.image)
    assert markers.origin is Origin.OUTLINE
    assert errors_px(markers, seen.truth).max() < 1.0


@pytest.mark.parametrize("cell", range(0, 96, 7))
def test_a_cell_of_another_color_makes_no_wrong_id(cell: int) -> None:
    layout = small_layout("honeycomb", 4)
    if layout.cell_color[cell] == WHITE:
        cell += 1
    other = (int(layout.cell_color[cell]) + 1) % 3
    seen = scene_of(recolored(layout, {cell: other}))
    markers = extractor().extract(seen.image)
    error = errors_px(markers, seen.truth)
    assert not len(error) or error.max() < 1.0


@pytest.mark.parametrize("pattern", TRIANGULAR)
@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_quarter_turn_changes_nothing(pattern: str, turns: int) -> None:
    """The same pixels turned by 90 degrees: the same ids, at the turned places."""
    image = picture(pattern).image
    upright = extractor(pattern).extract(image)
    turned = extractor(pattern).extract(np.rot90(image, turns))
    height, width = image.shape[:2]
    expected = upright.xy_px
    for _ in range(turns):  # rot90 takes (x, y) to (y, width - 1 - x)
        expected = np.stack([expected[:, 1], width - 1 - expected[:, 0]], axis=1)
        width, height = height, width
    assert (turned.status == upright.status).all() and turned.mirrored is False
    assert_close(turned.xy_px, expected)


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_a_flipped_image_is_recognised_as_mirrored(pattern: str) -> None:
    image = picture(pattern).image
    upright, flipped = extractor(pattern).extract(image), extractor(pattern).extract(image[:, ::-1])
    assert upright.mirrored is False and flipped.mirrored is True
    assert (flipped.status == upright.status).all()
    expected = upright.xy_px * (-1, 1) + (image.shape[1] - 1, 0)
    assert_close(flipped.xy_px, expected)


@pytest.mark.parametrize(
    "change", [lambda x: x * 0.35, lambda x: x * 0.6 + 40, lambda x: x * (0.6, 1.0, 0.8)]
)
def test_exposure_haze_and_white_balance(change: Callable[[Any], Any]) -> None:
    """They act on light, before the encoding."""
    seen = picture()
    image = np.rint(srgb_values(change(srgb_light(seen.image)))).astype(np.uint8)
    markers = extractor().extract(image)
    assert (markers.status == Status.MEASURED).all()
    assert errors_px(markers, seen.truth).max() < 0.3


def test_an_unknown_preset_names_the_others() -> None:
    """There was a preset "fast"."""
    with pytest.raises(ValueError, match="preset is 'fast'; give one of balanced, accurate"):
        Extractor(parse_layout(small_text("honeycomb", 3)), preset="fast")  # type: ignore[arg-type]
