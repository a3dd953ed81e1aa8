"""Markers of four pictures against stored results: the test notices a change of the code that moves a marker.

The files hold the picture, and for each preset the markers, their covariances, statuses and virtual markers. A change
that moves markers on purpose writes the files anew, and says by how much the accuracy of the suites changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor import Extractor, parse_layout
from tests.support.layouts import small_text

FOLDER = Path(__file__).parent / "golden"
FILES = sorted(path.stem for path in FOLDER.glob("*.npz"))
LAYERS = 4
Arrays = Mapping[str, NDArray[Any]]


def differences(found: Arrays, expected: Arrays) -> list[str]:
    """The differences above the rounding of another processor in single precision, a hundredth of the noise."""
    limits = {"xy_px": 2e-3, "virtual_xy_px": 2e-3, "cov_px2": 0.02 * float(np.nanmax(expected["cov_px2"]))}
    said = [] if np.array_equal(found["status"], expected["status"]) else ["status"]
    for name, limit in limits.items():
        if not np.allclose(found[name], expected[name], rtol=0, atol=limit, equal_nan=True):
            said.append(name)
    return said


def read(name: str, preset: Any) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """The markers as they are read now, and as they were."""
    with np.load(FOLDER / f"{name}.npz") as file:
        layout = parse_layout(small_text(name.partition("-")[0], LAYERS))
        markers = Extractor(layout, preset, side="either").extract(file["image"])
        names = ("xy_px", "cov_px2", "status", "virtual_xy_px")
        expected = {each: file[f"{preset}_{each}"] for each in names}
    return {each: getattr(markers, each) for each in names}, expected


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("name", FILES)
def test_markers_are_where_they_were(name: str, preset: str) -> None:
    found, expected = read(name, preset)
    assert np.isfinite(expected["xy_px"]).all(axis=1).sum() > 50
    assert not differences(found, expected)


@pytest.mark.parametrize("what", ["xy_px", "cov_px2", "status", "virtual_xy_px"])
def test_a_changed_marker_is_noticed(what: str) -> None:
    found, expected = read("honeycomb-bent", "balanced")
    found[what] = found[what].copy()
    known = np.flatnonzero(np.isfinite(found[what].ravel()))
    found[what].flat[known[7]] += 1 if what == "status" else 0.004
    assert differences(found, expected) == [what]
