"""The verdict: right pictures pass under every light; each way of being wrong is found out by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.reading.verify import judge_markers, verify
from cmpdesign.scene import Camera, Scene, render
from extractor import Extractor, Reason, parse_layout
from tests.support.layouts import small_layout, small_text
from tests.support.verdicts import LAYERS, markers_at, picture, reference


def turned(sixths: int) -> NDArray[np.int64]:
    """Ids of the markers at the positions of a numbering that is turned by some sixths."""
    layer, index = reference().layer.astype(np.int64), reference().index.astype(np.int64)
    return np.where(
        layer > 0, 3 * layer * (layer - 1) + 1 + (index + sixths * layer) % np.maximum(6 * layer, 1), 0
    )


@pytest.mark.parametrize("light", ["none", "warm", "leds"])
@pytest.mark.parametrize("noise", [0, 8])
@pytest.mark.parametrize("pitch_px", [12, 24])
def test_the_truth_is_verified(pitch_px: float, noise: float, light: str) -> None:
    rendered = picture(pitch_px, light, noise)
    verdict = judge_markers(reference(), rendered.image, markers_at(rendered.truth.marker_xy_px))
    assert verdict.verified and verdict.reason is None and verdict.contradictions == ()
    assert (verdict.present, verdict.measured, verdict.share) == (61, 61, 1.0)


def test_what_the_extractor_finds_is_verified() -> None:
    verdict = verify(Extractor(reference()), picture().image)
    assert verdict.verified and verdict.measured == 61
    assert verdict.to_json()["timings_ms"].keys() == verdict.markers.timings_ms.keys()


@pytest.mark.parametrize("sixths", [1, 2, 3, 4, 5])
def test_a_turned_numbering_is_found_out(sixths: int) -> None:
    rendered = picture()
    verdict = judge_markers(
        reference(), rendered.image, markers_at(rendered.truth.marker_xy_px[turned(sixths)])
    )
    assert not verdict.verified
    assert str(verdict.reason).startswith("colors contradict the layout: cell ")


def test_a_shifted_layer_is_found_out() -> None:
    xy_px = picture().truth.marker_xy_px.copy()
    outer = np.flatnonzero(reference().layer == LAYERS)
    xy_px[outer] = np.roll(xy_px[outer], 1, axis=0)
    verdict = judge_markers(reference(), picture().image, markers_at(xy_px))
    assert "colors contradict the layout" in str(verdict.reason)


def test_one_cell_of_another_color_is_found_out() -> None:
    """Repaint one red cell blue in the picture: that cell and no other is named."""
    red = int(np.flatnonzero(reference().cell_color == 0)[5])
    rendered = picture(noise=0)
    image = rendered.image.copy()
    middle = rendered.truth.marker_xy_px[reference().cell_corners[red]].mean(axis=0).round().astype(int)
    patch = image[middle[1] - 4 : middle[1] + 5, middle[0] - 4 : middle[0] + 5]
    patch[:] = patch[..., ::-1]
    verdict = judge_markers(reference(), image, markers_at(rendered.truth.marker_xy_px))
    assert verdict.contradictions == (red,)
    assert verdict.reason == f"colors contradict the layout: cell {red}, which should be red"


def test_the_other_side_is_found_out() -> None:
    image = picture(mirrored=True).image
    either = Extractor(reference(), side="either")
    seen = "the pattern is seen from the back, but designed to be seen from the front"
    assert verify(either, image).reason == (
        f"{seen}: a mirrored camera or the pad's other face, by the colors of the inks"
    )
    assert "red and blue are swapped" in str(verify(either, image[:, ::-1, ::-1]).reason)


@pytest.mark.parametrize(("lost", "verified"), [(6, True), (7, False)])
def test_too_few_markers(lost: int, verified: bool) -> None:
    xy_px = picture().truth.marker_xy_px.copy()
    xy_px[-lost:] = np.nan
    verdict = judge_markers(reference(), picture().image, markers_at(xy_px), min_share=55 / 61)
    assert verdict.verified is verified and verdict.lost == lost
    if not verified:
        assert verdict.reason == "54 of 61 markers measured (88.5%), expected at least 90.2%"


def test_repaired_markers_do_not_count_as_measured() -> None:
    markers = markers_at(picture().truth.marker_xy_px)
    status = markers.status.copy()
    status[:10], status[10:15] = 2, 3
    verdict = judge_markers(reference(), picture().image, replace(markers, status=status))
    assert (verdict.measured, verdict.repaired, verdict.fitted, verdict.lost) == (46, 10, 5, 0)
    assert not verdict.verified


@pytest.mark.parametrize("reason", [None, *Reason])
def test_nothing_found_has_a_sentence(reason: Reason | None) -> None:
    nothing = markers_at(np.full((61, 2), np.nan), mirrored=None, reason=reason)
    verdict = judge_markers(reference(), picture().image, nothing, min_share=0)
    assert not verdict.verified and verdict.lost == 61 and verdict.mirrored is None
    assert verdict.reason and "_" not in verdict.reason


@pytest.mark.parametrize("make", [np.zeros_like, lambda image: image[::-1, ::-1] * 0 + 127])
def test_pictures_without_a_pattern(make: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> None:
    verdict = verify(Extractor(reference()), make(picture().image))
    assert not verdict.verified and verdict.share == 0


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_is_a_share(share: float) -> None:
    with pytest.raises(CmpDesignError, match="min_share"):
        verify(Extractor(reference()), picture().image, min_share=share)


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
@pytest.mark.parametrize(("seen", "given"), [(5, 3), (3, 5)])
def test_a_pattern_of_other_layers_is_named(pattern: str, seen: int, given: int) -> None:
    """The reason is not a lost white cell: with more layers the search does not find the cell, with fewer the rim is
    unseen.
    """
    image = render(Scene(layout=small_layout(pattern, seen), camera=Camera(30, 7)), size=(480, 400)).image
    layout = parse_layout(small_text("honeycomb", given))
    verdict = verify(Extractor(layout), image)
    assert not verdict.verified
    assert f"does not fit the layout: it has {seen} layers, the layout {given};" in str(verdict.reason)


def test_a_part_of_the_pattern_is_not_taken_for_another() -> None:
    """The picture ends before the pattern does, so its layers cannot be counted."""
    image = render(Scene(layout=small_layout("honeycomb", 5), camera=Camera(30, 7)), size=(320, 240)).image
    layout = parse_layout(small_text("honeycomb", 5))
    assert "markers measured" in str(verify(Extractor(layout), image).reason)
