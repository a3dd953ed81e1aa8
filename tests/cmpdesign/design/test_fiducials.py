"""Fiducials: their positions, their entries in the layout file, and older files without fiducials."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from cmpdesign.design.design import load_design
from cmpdesign.errors import DesignError
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.reading.read_layout import read_layout
from extractor import LayoutError, parse_layout
from tests.support.layouts import layout_schema, small_document


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("name", ["honeycomb", "elliptical", "square", "digit"])
def test_they_lie_outside_and_tell_the_corners_apart(name: str, count: int) -> None:
    design = load_design(name, {"fiducials.count": str(count), "fiducials.gap_mm": "1.5mm"})
    layout = build_layout(design)
    away = np.abs(layout.fiducials_mm[:, None] - layout.outline_mm[None]).max(axis=2).min(axis=1)
    assert layout.fiducials_mm.shape == (count, 2)
    assert (away >= 1.5).all()
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    outside = ((layout.fiducials_mm + 1 < low) | (layout.fiducials_mm - 1 > high)).any(axis=1)
    assert outside.all()
    # No turn by a half or a quarter brings them onto themselves.
    centred = layout.fiducials_mm - (layout.fiducials_mm.min(axis=0) + layout.fiducials_mm.max(axis=0)) / 2
    for turn in ([[-1, 0], [0, -1]], [[0, -1], [1, 0]], [[0, 1], [-1, 0]]):
        turned = centred @ np.array(turn)
        assert np.hypot(*(turned[:, None] - centred[None]).T).min(axis=0).max() > 0.9


def test_the_layout_file_carries_them(tmp_path: Path) -> None:
    layout = build_layout(load_design("honeycomb", {"fiducials.diameter_mm": "3mm", "layers": "2"}))
    path = tmp_path / "layout.json"
    path.write_text(layout_to_json(layout), encoding="utf-8")
    again = read_layout(path)
    np.testing.assert_array_equal(again.fiducials_mm, layout.fiducials_mm)
    assert again.fiducial_diameter_mm == 3.0
    assert layout_to_json(again) == path.read_text(encoding="utf-8")
    jsonschema.validate(json.loads(path.read_text()), layout_schema())


def test_a_file_without_them_still_reads() -> None:
    document = small_document()
    del document["fiducials"]
    reference = parse_layout(json.dumps(document))
    assert reference.fiducials_mm.shape == (0, 2) and reference.fiducial_diameter_mm == 0
    none = build_layout(load_design("honeycomb", {"fiducials.count": "0"}))
    assert "fiducials" not in json.loads(layout_to_json(none))


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        ([], "fiducials is a list of 0; expected an object"),
        ({"x": [1.0], "y": [1.0]}, "fiducials.diameter_mm is missing"),
        ({"x": [1.0], "y": [1.0, 2.0], "diameter_mm": 1}, "fiducials.y is a list of 2; expected 1 entries"),
        ({"x": 3, "y": [1.0], "diameter_mm": 1}, "fiducials.x is 3; expected a list"),
        ({"x": [1.0], "y": ["a"], "diameter_mm": 1}, "fiducials.y[0] is 'a'"),
        ({"x": [1.0], "y": [1.0], "diameter_mm": -1}, "fiducials.diameter_mm is -1; expected a length"),
    ],
)
def test_a_damaged_column_is_named(damage: Any, expected: str) -> None:
    document = small_document() | {"fiducials": damage}
    with pytest.raises(LayoutError) as caught:
        parse_layout(json.dumps(document))
    assert expected in str(caught.value)


def test_bad_options_are_refused() -> None:
    for name, expected in {"count=2": "0, 3 or 4", "diametr_mm=1": "did you mean diameter_mm?"}.items():
        field, value = name.split("=")
        with pytest.raises(DesignError, match=expected.replace("?", r"\?")):
            load_design("honeycomb", {f"fiducials.{field}": value})
