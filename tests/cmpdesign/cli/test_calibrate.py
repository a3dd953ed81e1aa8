"""``cmpdesign calibrate pattern``: from pictures of one pad at rest to its layout as made."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cmpdesign.files.layout_json import write_layout
from cmpdesign.scene import standard_layout
from extractor import load_layout
from tests.support.command import refused, run
from tests.support.made.rest_pictures import LAYERS, learnt, nominal_layout, write_rest_images


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("calibrate")
    write_rest_images(made / "rest")
    write_layout(nominal_layout(), made / "layout.json")
    return made


def test_the_layout_as_made_is_written(folder: Path, tmp_path: Path) -> None:
    """A second run writes the same bytes, and the library learns the same positions from the same pictures."""
    result = run(
        "calibrate", "pattern", folder / "layout.json", folder / "rest", "-o", tmp_path / "made.json"
    )
    assert result.exit_code == 0 and result.stderr == "", result.output
    rows = dict(re.split(r"  +", line, maxsplit=1) for line in result.stdout.splitlines()[1:])
    assert (rows["pictures"].strip(), rows["side"].strip(), rows["measured"].strip()) == (
        "10",
        "front",
        "127",
    )
    assert result.stdout.startswith(f"wrote {tmp_path / 'made.json'}\n")
    made = load_layout(tmp_path / "made.json")
    np.testing.assert_array_equal(made.xy_mm, learnt().layout.xy_mm)
    images = sorted((folder / "rest").iterdir())
    run("calibrate", "pattern", folder / "layout.json", *images, "-o", tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "made.json").read_bytes()
    assert run("verify", tmp_path / "made.json", folder / "rest").exit_code == 0


def test_the_layout_of_another_pattern_is_warned_of(folder: Path, tmp_path: Path) -> None:
    write_layout(standard_layout("round", LAYERS), tmp_path / "round.json")
    result = run(
        "calibrate", "pattern", tmp_path / "round.json", folder / "rest", "-o", tmp_path / "made.json"
    )
    assert result.exit_code == 0
    far = "warning: the markers lie " in result.stderr and "limit 0.1; check that" in result.stderr
    assert far or "markers are measured in no picture and stay at their nominal places" in result.stderr


def test_bad_input_is_one_line_and_writes_nothing(folder: Path, tmp_path: Path) -> None:
    layout, rest, made = folder / "layout.json", folder / "rest", tmp_path / "made.json"
    images = sorted(rest.iterdir())
    words = ("calibrate", "pattern", layout)
    assert "9 pictures of the pad at rest; give 10 or more" in refused(*words, *images[1:], "-o", made)
    assert "is the nominal layout itself" in refused(*words, rest, "-o", layout)
    assert "unknown ending; expected .json" in refused(*words, rest, "-o", tmp_path / "made.npz")
    assert f"{layout}: " in refused(*words, *images, layout, "-o", made)
    assert list(tmp_path.iterdir()) == []
