"""Why pictures of the suites are not read: the reason agrees with what the picture shows."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from benchmarks.suites.ablation.pictures import KeptPicture, keep_pictures
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import standard_layout
from extractor import Extractor, Markers, Reason, parse_layout

SUITES = ("provoking", "damage", "stress", "camera", "views")
PICTURES = 40  # of each suite
# where a pattern is seen; of a pale one that is numbered, no marker may be sure enough
OWN_PATTERN = {Reason.REFERENCE_LOST, Reason.AMBIGUOUS, Reason.MIRRORED, Reason.FEW_MARKERS}


def read_kept(picture: KeptPicture) -> Markers:
    with np.load(picture.path) as file:
        return Extractor(parse_layout(str(file["layout"]))).extract(file["image"])


def is_right(picture: KeptPicture, markers: Markers) -> bool:
    """Whether the truth agrees with the reason; a pattern that is not seen at all needs a hint."""
    if len(picture.truths) == 0:
        return markers.reason == Reason.NO_PATTERN
    if len(picture.truths) > 1:
        return markers.reason == Reason.SEVERAL_PADS
    if markers.reason == Reason.NO_PATTERN:
        return markers.quality is not None and len(markers.quality.hints) > 0
    return markers.reason in OWN_PATTERN


@pytest.mark.slow
@pytest.mark.parametrize("suite", SUITES)
def test_each_picture_that_is_not_read_has_the_right_reason(suite: str, tmp_path: Path) -> None:
    wrong = []
    for picture in islice(keep_pictures(suite, PICTURES, 20261, tmp_path), PICTURES):
        markers = read_kept(picture)
        if not markers.status.any() and not is_right(picture, markers):
            wrong.append((picture.path.name, picture.kind, markers.reason))
    assert wrong == []


def test_what_noise_hides_is_called_noisy() -> None:
    """In noise no cell is seen; a dark picture of it is no pattern, and the hint names the noise."""
    noisy = np.random.default_rng(3).normal(0, 40, (240, 320, 3)).clip(0, 255).astype(np.uint8)
    markers = Extractor(parse_layout(layout_to_json(standard_layout()))).extract(noisy)
    assert markers.reason == Reason.NO_PATTERN
    assert markers.quality is not None and any("noisy" in hint for hint in markers.quality.hints)
