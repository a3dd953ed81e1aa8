"""Layouts beyond the capacity of the reader's tables are refused, with the limits; other layouts can be read."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cmpdesign.design.design import load_design
from cmpdesign.errors import DesignError
from cmpdesign.layout.build import build_layout
from extractor import Extractor, LayoutError, parse_layout
from tests.support.layouts import PATTERNS, small_document

BLANK = np.full((64, 64, 3), 90, np.uint8)
COLORS = ("red", "green", "blue", "black", "white")


def signed(document: dict[str, Any]) -> str:
    """The text with the digest that its geometry has, so that only the geometry can be refused."""
    digest, markers, cells = hashlib.sha256(), document["markers"], document["cells"]
    colors = [COLORS.index(color) for color in cells["color"]]
    for column in (markers["layer"], markers["index"], cells["corners"], colors, document["edges"]):
        digest.update(np.array(column).astype("<i4").tobytes())
    for axis in ("x", "y"):
        digest.update(np.array(markers[axis]).astype("<f8").tobytes())
    return json.dumps({**document, "digest": digest.hexdigest()})


def refused(document: dict[str, Any]) -> str:
    with pytest.raises(LayoutError) as caught:
        parse_layout(signed(document))
    return str(caught.value)


def with_edges(document: dict[str, Any], *more: tuple[int, int]) -> dict[str, Any]:
    return {**document, "edges": sorted([*document["edges"], *map(list, more)])}


@pytest.mark.parametrize("pattern", PATTERNS)
def test_signing_changes_nothing(pattern: str) -> None:
    assert json.loads(signed(small_document(pattern)))["digest"] == small_document(pattern)["digest"]


def test_seven_edges_at_a_marker_are_refused() -> None:
    message = refused(with_edges(small_document(), (0, 7)))
    assert "edges[6] is [0, 7]; expected two neighbouring markers" in message


@pytest.mark.parametrize("pattern", PATTERNS)
def test_an_edge_across_is_refused(pattern: str) -> None:
    count = len(small_document(pattern)["markers"]["x"])
    assert "two neighbouring markers" in refused(with_edges(small_document(pattern), (0, count - 1)))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_cell_across_is_refused(pattern: str) -> None:
    """Its edges, its orientation and its color are right, but its corners lie at the rim."""
    document = small_document(pattern, 3)
    cells, xy = document["cells"], np.column_stack([document["markers"]["x"], document["markers"]["y"]])
    black = [cell for cell, color in enumerate(cells["color"]) if color == "black"]
    cell = next(cell for cell in black if cell != document["reference"]["cell"])
    count = len(cells["corners"][cell])
    turns = np.radians(45 + np.arange(count) * 360 / count)
    far = [int((xy @ (np.cos(turn), np.sin(turn))).argmax()) for turn in turns]
    cells["corners"][cell] = far
    ends = {(min(pair), max(pair)) for pair in zip(far, [*far[1:], far[0]], strict=True)}
    known = {tuple(edge) for edge in document["edges"]}
    message = refused(with_edges(document, *sorted(ends - known)))
    assert f"cells.corners[{cell}]" in message and "neighbours" in message


@settings(max_examples=150, deadline=None)
@given(data=st.data(), pattern=st.sampled_from(PATTERNS[:3]))
def test_what_is_loaded_can_be_used(data: st.DataObject, pattern: str) -> None:
    """Any change of cells, edges or places, with the right digest."""
    document = small_document(pattern)
    count = len(document["markers"]["x"])
    marker = st.integers(0, count - 1)
    for _ in range(data.draw(st.integers(1, 3))):
        match data.draw(st.sampled_from(["corner", "drop cell", "edge", "drop edge", "move", "color"])):
            case "corner":
                cell = data.draw(st.sampled_from(document["cells"]["corners"]))
                cell[data.draw(st.integers(0, 2))] = data.draw(marker)
            case "drop cell":
                place = data.draw(st.integers(1, len(document["cells"]["corners"]) - 1))
                del document["cells"]["corners"][place], document["cells"]["color"][place]
            case "edge":
                # type: ignore[arg-type]
                document = with_edges(document, tuple(sorted((data.draw(marker), data.draw(marker)))))
            case "drop edge":
                del document["edges"][data.draw(st.integers(0, len(document["edges"]) - 1))]
            case "move":
                far = st.floats(-1e6, 1e6) | st.sampled_from([0.0, 1e-300, -1e6, 1e6])
                document["markers"][data.draw(st.sampled_from("xy"))][data.draw(marker)] = data.draw(far)
            case "color":
                place = data.draw(st.integers(0, len(document["cells"]["color"]) - 1))
                document["cells"]["color"][place] = data.draw(st.sampled_from(COLORS))
    try:
        reference = parse_layout(signed(document))
    except LayoutError as error:
        assert str(error).isprintable()
        return
    assert not np.isfinite(Extractor(reference).extract(BLANK).xy_px).any()


@pytest.mark.parametrize("size", [1e-5, 1e-3, 1.0, 1e4])
def test_a_layout_of_any_size_can_be_used(size: float) -> None:
    document = small_document()
    for axis in "xy":
        document["markers"][axis] = [size * value for value in document["markers"][axis]]
    document["outline"] = [[size * x, size * y] for x, y in document["outline"]]
    assert Extractor(parse_layout(signed(document))).extract(BLANK).reason is not None


def test_virtual_markers_have_a_limit_on_both_sides() -> None:
    document = small_document("honeycomb", 60)
    document["virtual_per_edge"] = 1000
    assert "at most 4000000 virtual markers, 122 an edge" in refused(document)
    document["virtual_per_edge"] = 122
    parse_layout(signed(document))
    with pytest.raises(DesignError, match="at most 11"):
        build_layout(load_design("honeycomb", {"layers": "200", "pitch_mm": "1", "virtual_per_edge": "12"}))


CODE = """
import sys
from pathlib import Path
from extractor import LayoutError, load_layout
try:
    load_layout(sys.argv[1])
except LayoutError as error:
    print(error)
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
print(status["VmHWM"].split()[0])
"""
MANY = {
    "lists": b"[" + b"[]," * 20_000_000 + b"[]]",
    "deep lists": b"[" * 20_000_000,
    "numbers": b"[" + b"1.5," * 15_000_000 + b"1]",
    "objects": b"[" + b'{"a":1},' * 7_000_000 + b"1]",
}


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs the memory of a process")
@pytest.mark.parametrize("kind", MANY)
def test_60_mb_of_brackets_take_little_memory(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "many.json"
    path.write_bytes(MANY[kind][: 1 << 26])
    result = subprocess.run(
        [sys.executable, "-c", CODE, str(path)], capture_output=True, text=True, timeout=60, check=True
    )
    message, memory_kb = result.stdout.splitlines()
    assert "holds more than" in message or "larger than" in message
    assert int(memory_kb) < 600_000
