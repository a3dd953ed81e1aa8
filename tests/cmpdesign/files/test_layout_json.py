"""layout.json as written: the contract's columns, exact numbers, whole files only."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from cmpdesign.design.design import Design
from cmpdesign.errors import OutputError
from cmpdesign.files.atomic import write_file, write_folder
from cmpdesign.files.layout_json import layout_to_json, write_layout
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.colors import COLORS


def layout(pattern: str = "honeycomb", layers: int = 3) -> Layout:
    return build_layout(Design(pattern=pattern, layers=layers, pitch_mm=1.1, rotation_deg=7))


@pytest.mark.parametrize("pattern", list(registered_patterns()))
def test_every_column_reads_back_exactly(pattern: str) -> None:
    built = layout(pattern)
    document = json.loads(layout_to_json(built))
    assert (document["format"], document["version"], document["units"]) == ("cmp-layout", 1, "mm")
    markers, cells = document["markers"], document["cells"]
    np.testing.assert_array_equal(markers["layer"], built.marker_layer)
    np.testing.assert_array_equal(markers["index"], built.marker_index)
    np.testing.assert_array_equal(np.stack([markers["x"], markers["y"]], axis=-1), built.marker_xy_mm)
    np.testing.assert_array_equal(cells["corners"], built.cell_corners)
    assert cells["color"] == [COLORS[color] for color in built.cell_color]
    np.testing.assert_array_equal(document["edges"], built.edges)
    np.testing.assert_array_equal(document["outline"], built.outline_mm)
    assert document["reference"] == {"cell": built.reference_cell, "marker": built.reference_marker}
    assert document["palette"] == dict(built.palette)
    assert list(document["palette"]) == list(COLORS)
    assert {"layers", "pitch_mm", "mirrored", "rotation_deg"} <= set(document["parameters"])
    assert (document["pattern"], document["virtual_per_edge"], document["border_mm"]) == (pattern, 5, 1.0)


def test_the_digest_is_the_stated_one() -> None:
    document = json.loads(layout_to_json(layout()))
    markers, cells = document["markers"], document["cells"]
    color = [COLORS.index(name) for name in cells["color"]]
    digest = hashlib.sha256()
    for column in (markers["layer"], markers["index"], cells["corners"], color, document["edges"]):
        digest.update(np.array(column, dtype="<i4").tobytes())
    for column in (markers["x"], markers["y"]):
        digest.update(np.array(column, dtype="<f8").tobytes())
    assert document["digest"] == digest.hexdigest()


def test_the_text_is_deterministic_and_one_column_a_line() -> None:
    text = layout_to_json(layout())
    assert text == layout_to_json(layout())
    assert text.endswith("}\n")
    # The markers' and the fiducials'.
    assert sum('"x": [' in line and line.rstrip(",").endswith("]") for line in text.splitlines()) == 2
    assert text.count("\n") < 50


def test_a_folder_is_made_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "new" / "layout.json"
    write_layout(layout(), path)
    write_layout(layout(), path)
    assert [p.name for p in path.parent.iterdir()] == ["layout.json"]
    assert path.read_text(encoding="utf-8") == layout_to_json(layout())


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail)


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, full_disk: None) -> None:
    path = tmp_path / "layout.json"
    path.write_text("old")
    with pytest.raises(OutputError, match=r"No space left on device.*nothing was changed"):
        write_layout(layout(), path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["layout.json"]


def test_a_folder_is_replaced_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_folder(tmp_path, {"a": "1", "b": b"2"})
    synced = []

    def fail_at_the_second(descriptor: int) -> None:
        synced.append(descriptor)
        if len(synced) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail_at_the_second)
    with pytest.raises(OutputError, match="No space left"):
        write_folder(tmp_path, {"a": "new", "b": b"new"})
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "1", "b": "2"}


def test_a_folder_takes_sub_folders(tmp_path: Path) -> None:
    paths = write_folder(
        tmp_path / "made", {"job/1.svg": "first", "2.svg": "second", "other/1.svg": b"third"}
    )
    assert [path.relative_to(tmp_path / "made").as_posix() for path in paths] == [
        "job/1.svg",
        "2.svg",
        "other/1.svg",
    ]
    assert [path.read_text() for path in paths] == ["first", "second", "third"]
    assert {path.name for path in (tmp_path / "made").iterdir()} == {"job", "other", "2.svg"}


def test_what_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file" / "layout.json", tmp_path / "folder"):
        with pytest.raises(OutputError, match="cannot be written") as caught:
            write_file(path, "text")
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)
    with pytest.raises(OutputError, match="is a folder"):
        write_folder(tmp_path, {"folder": "text"})
