"""Pads of one design with different codes: a picture says which one it shows."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.pad_codes.families import VIEWS, coded_layout, partial_view, told_apart
from extractor import Extractor, LayoutError, Reason, Reference

LAYERS, CODES = 10, (1, 2, 3, 4)


def reference(code: int, layers: int = LAYERS) -> Reference:
    return coded_layout(layers, code).reference()


@cache
def family() -> Extractor:
    return Extractor([reference(code) for code in CODES])


def test_a_picture_says_which_pad_it_shows() -> None:
    rng = np.random.default_rng(1)
    for code, share in ((1, 1.0), (4, 1.0), (2, 0.5), (3, 0.5)):
        shot = partial_view(coded_layout(LAYERS, code), share, rng)
        markers = family().extract(shot.image)
        assert markers.code == code and family().layout_of(markers).code.id == code
        alone = Extractor(reference(code)).extract(shot.image)
        assert np.array_equal(markers.xy_px, alone.xy_px, equal_nan=True) and alone.code == code


def test_a_pad_of_another_family_is_refused() -> None:
    rng = np.random.default_rng(2)
    markers = family().extract(partial_view(coded_layout(LAYERS, 9), 1.0, rng).image)
    assert not markers.found and markers.reason is Reason.OTHER_CODE and markers.code is None
    half = family().extract(partial_view(coded_layout(LAYERS, 9), 0.5, rng).image)
    assert not half.found and half.reason in (Reason.OTHER_CODE, Reason.AMBIGUOUS)


def test_two_pads_of_a_family_in_one_picture_are_several() -> None:
    rng = np.random.default_rng(3)
    images = [partial_view(coded_layout(LAYERS, code), 1.0, rng).image for code in (1, 2)]
    assert family().extract(np.hstack(images)).reason is Reason.SEVERAL_PADS


def test_a_family_is_pickled() -> None:
    shot = partial_view(coded_layout(LAYERS, 2), 1.0, np.random.default_rng(4))
    copy = pickle.loads(pickle.dumps(family()))
    assert pickle.loads(pickle.dumps(copy.extract(shot.image))).code == 2


def test_layouts_that_are_no_family_are_refused() -> None:
    for others, words in (
        ([], "no layout is given"),
        ([reference(1), reference(2, 9)], "layouts 1 and 2 differ in markers"),
        ([reference(1), reference(1)], "2 of 2 layouts have the code 1"),
        ([reference(1), reference(0)], "1 of 2 layouts have no code"),
        (
            [reference(1), replace(reference(2), palette={**reference(2).palette, "red": "#aa0000"})],
            "palette",
        ),
    ):
        with pytest.raises(LayoutError, match=words):
            Extractor(others)


@pytest.mark.slow
@pytest.mark.parametrize(("pads", "share"), VIEWS)
def test_pads_are_told_apart_and_others_refused(pads: int, share: float) -> None:
    own, foreign = told_apart(LAYERS, pads, share, 64, 77)
    assert own["wrong"] == foreign["wrong"] == foreign["right"] == 0
    assert own["right"] == 64
