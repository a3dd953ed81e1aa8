"""The pattern's depth below the touched surface, by a rig file."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmpdesign.design.templates import templates_folder
from cmpdesign.errors import CmpDesignError
from cmpdesign.tracking.marker_depth import read_marker_depth_mm


@pytest.mark.parametrize(
    ("text", "depth_mm"),
    [
        ('[[view]]\nname = "a"\n', None),
        ("[elastomer]\nthickness_mm = 5\n", 0.0),
        ('[elastomer]\nmarker_depth_mm = "20mil"\n', 0.508),
        ("[contact.elastomer]\nmarker_depth_mm = 0.7\n", 0.7),
    ],
)
def test_depth_is_what_the_file_says(text: str, depth_mm: float | None, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    found = read_marker_depth_mm(tmp_path / "rig.toml")
    assert found == (depth_mm if depth_mm is None else pytest.approx(depth_mm))


def test_shipped_sensors_say_it() -> None:
    """The pattern's depth is part of a sensor's stack: between the touched surface and the support."""
    for path in sorted((templates_folder() / "sensors").glob("*.toml")):
        assert 0.5 <= (read_marker_depth_mm(path) or 0) <= 1.0, path.name


@pytest.mark.parametrize("value", ["-1", '"deep"', "true", "nan"])
def test_impossible_depths_are_refused(value: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(f"[elastomer]\nmarker_depth_mm = {value}\n", encoding="utf-8")
    with pytest.raises(CmpDesignError, match=r"rig.toml: elastomer.marker_depth_mm"):
        read_marker_depth_mm(tmp_path / "rig.toml")
