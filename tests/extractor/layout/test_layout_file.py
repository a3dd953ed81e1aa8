"""The reader of layout.json: written files are read, and every fault gives one clear line."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.reading.read_layout import layout_from_reference
from extractor import LayoutError, Reference, load_layout, parse_layout
from tests.support.layouts import PATTERNS, layout_schema, small_document, small_layout, small_text

SCHEMA = layout_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)

Damage = Callable[[dict[str, Any]], object]


def refused(text: str) -> str:
    """The message that the text is refused with."""
    with pytest.raises(LayoutError) as caught:
        parse_layout(text, "some.json")
    message = str(caught.value)
    assert message.startswith("some.json: ")
    assert message.isprintable() and len(message) < 300
    return message


@pytest.mark.parametrize("pattern", PATTERNS)
def test_reads_back_what_was_written(pattern: str) -> None:
    layout, reference = small_layout(pattern), parse_layout(small_text(pattern))
    for name, column in (
        ("layer", layout.marker_layer),
        ("index", layout.marker_index),
        ("xy_mm", layout.marker_xy_mm),
        ("cell_corners", layout.cell_corners),
        ("cell_color", layout.cell_color),
        ("edges", layout.edges),
        ("outline_mm", layout.outline_mm),
        ("present", layout.present),
    ):
        read = getattr(reference, name)
        np.testing.assert_array_equal(read, column)
        assert read.dtype == column.dtype
        assert not read.flags.writeable
    for name in ("pattern", "parameters", "virtual_per_edge", "reference_cell", "reference_marker"):
        assert getattr(reference, name) == getattr(layout, name)
    for name in ("palette", "border_mm", "digest", "mirrored"):
        assert getattr(reference, name) == getattr(layout, name)


def test_layers_and_mirrored() -> None:
    text = layout_to_json(build_layout(load_design("round", {"layers": "4", "mirrored": "true"})))
    reference = parse_layout(text)
    assert reference.layers == 4 and reference.mirrored
    with pytest.raises(TypeError):
        reference.palette["red"] = "#000000"  # type: ignore[index]


def test_a_clipped_layout_keeps_its_ids() -> None:
    clipped = {"layers": "5", "clip": "circle", "clip_diameter_mm": "12"}
    layout = build_layout(load_design("honeycomb", clipped))
    reference = parse_layout(layout_to_json(layout))
    assert len(reference.layer) == 91
    assert 0 < reference.present.sum() < 91
    np.testing.assert_array_equal(reference.present, layout.present)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_writer_keeps_the_schema(pattern: str) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    VALIDATOR.validate(small_document(pattern))


def test_200_layers_are_read() -> None:
    text = layout_to_json(build_layout(load_design("honeycomb", {"layers": "200", "pitch_mm": "0.5"})))
    reference = parse_layout(text)
    assert len(reference.layer) == 120_601


def put(*path: str | int, to: object) -> Damage:
    def damage(document: dict[str, Any]) -> None:
        holder: Any = document
        for key in path[:-1]:
            holder = holder[key]
        holder[path[-1]] = to

    return damage


def drop(*path: str | int) -> Damage:
    def damage(document: dict[str, Any]) -> None:
        holder: Any = document
        for key in path[:-1]:
            holder = holder[key]
        del holder[path[-1]]

    return damage


def swap_edges(document: dict[str, Any]) -> None:
    document["edges"][3:5] = document["edges"][4:2:-1]


def swap_red_and_green(document: dict[str, Any]) -> None:
    other = {"red": "green", "green": "red"}
    document["cells"]["color"] = [other.get(color, color) for color in document["cells"]["color"]]


def second_white(document: dict[str, Any]) -> None:
    color = document["cells"]["color"]
    color[len(color) - 1 - color[::-1].index("black")] = "white"


def move_a_marker(document: dict[str, Any]) -> None:
    document["markers"]["x"][18] += 1e-6


WRONG: dict[str, tuple[Damage, str]] = {
    "other format": (put("format", to="svg"), "format is 'svg'; expected 'cmp-layout'"),
    "other version": (put("version", to=3), "version is 3; expected 1 or 2"),
    "version as truth": (put("version", to=True), "version is true; expected 1 or 2"),
    "version as float": (put("version", to=1.0), "version is 1.0; expected 1 or 2"),
    "other units": (put("units", to="inch"), "units is 'inch'; expected 'mm'"),
    "no version": (drop("version"), "version is missing; expected 1 or 2"),
    "no markers": (drop("markers"), "markers is missing"),
    "no column": (drop("markers", "x"), "markers.x is missing"),
    "unknown field": (put("color", to=1), "'color' is unknown"),
    "unknown column": (put("cells", "hue", to=[]), "cells.'hue' is unknown"),
    "markers a list": (put("markers", to=[1]), "markers is a list of 1; expected an object"),
    "column a text": (put("markers", "x", to="1"), "markers.x is '1'; expected a list"),
    "column empty": (put("markers", "layer", to=[]), "markers.layer is empty"),
    "column short": (drop("markers", "y", 3), "markers.y is a list of 18; expected 19 entries"),
    "text in column": (put("markers", "x", 4, to="far"), "markers.x[4] is 'far'; expected a number"),
    "truth in column": (put("markers", "x", 4, to=True), "markers.x[4] is true"),
    "truth as layer": (put("markers", "layer", 1, to=True), "markers.layer[1] is true"),
    "float as layer": (put("markers", "layer", 1, to=1.0), "markers.layer[1] is 1.0"),
    "null in column": (put("markers", "y", 0, to=None), "markers.y[0] is null"),
    "huge length": (put("markers", "x", 4, to=1e300), "markers.x[4] is 1e+300"),
    "giant integer": (put("markers", "x", 4, to=10**1000), "markers.x[4] is an integer of 3322 bits"),
    "giant id": (put("edges", 0, 1, to=10**50), "edges[0][1] is an integer of 167 bits"),
    "negative id": (put("cells", "corners", 2, 1, to=-1), "cells.corners[2][1] is -1"),
    "id out of range": (put("cells", "corners", 2, 1, to=19), "19; expected an integer from 0 to 18"),
    "corners of four": (put("cells", "corners", 2, to=[0, 1, 2, 3]), "cells.corners[2] is a list of 4"),
    "corners no list": (put("cells", "corners", 0, to=7), "cells.corners[0] is 7"),
    "corner twice": (put("cells", "corners", 2, 1, to=0), "expected different markers"),
    "unknown color": (put("cells", "color", 5, to="pink"), "cells.color[5] is 'pink'; expected one of red"),
    "color a list": (put("cells", "color", 5, to=["red"]), "cells.color[5] is a list of 1"),
    "two of a color": (swap_red_and_green, "cells.color is counter-clockwise around marker 0"),
    "two white": (second_white, "reference.cell is"),
    "edge order": (swap_edges, "edges in ascending order"),
    "edge turned": (put("edges", 0, to=[1, 0]), "edges[0] is [1, 0]; expected the smaller id first"),
    "edge missing": (drop("edges", 0), "expected every side of cell"),
    "layer wrong": (put("markers", "layer", 7, to=1), "markers.layer[7] is 1; expected 2"),
    "marker twice": (put("markers", "index", 7, to=1), "markers.index[7] is 1; expected 0"),
    "reference.cell": (put("reference", "cell", to=1), "reference."),
    "reference.marker": (put("reference", "marker", to=18), "reference.marker is 18; expected a corner"),
    "no ink": (drop("palette", "red"), "palette.red is missing"),
    "bad ink": (put("palette", "red", to="#12345g"), "palette.red is '#12345g'"),
    "ink and newline": (put("palette", "red", to="#123456\n"), "palette.red is"),
    "negative border": (put("border_mm", to=-1), "border_mm is -1"),
    "border as truth": (put("border_mm", to=False), "border_mm is false"),
    "outline of two": (put("outline", to=[[0, 0], [1, 1]]), "outline is a polygon of 2 points"),
    "outline flat": (put("outline", to=[[0, 0], [1, 1], [2, 2]]), "counter-clockwise"),
    "outline of threes": (put("outline", 0, to=[1, 2, 3]), "outline[0] is a list of 3"),
    "virtual": (put("virtual_per_edge", to=-1), "virtual_per_edge is -1"),
    "mirrored": (put("parameters", "mirrored", to=1), "parameters.mirrored is 1; expected true or false"),
    "pattern": (put("pattern", to="a\nb"), "pattern is 'a\\nb'"),
    "lone surrogate": (put("pattern", to="\ud800"), "pattern is '\\ud800'"),
    "digest": (put("digest", to="0" * 64), "the geometry was changed"),
    "moved marker": (move_a_marker, "the geometry was changed"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_fields(case: str) -> None:
    damage, expected = WRONG[case]
    document = small_document()
    damage(document)
    assert expected in refused(json.dumps(document))


def test_clockwise_cell() -> None:
    document = small_document()
    document["cells"]["corners"][0].reverse()
    assert "cells.corners[0]" in refused(json.dumps(document))


def test_cell_given_twice() -> None:
    document = small_document()
    corners = document["cells"]["corners"]
    corners[1] = corners[0][1:] + corners[0][:1]
    assert "cells.corners[1]" in refused(json.dumps(document))


def test_square_rows() -> None:
    document = small_document("square")
    document["markers"]["layer"][6] = 0
    assert "markers.layer[6] is 0; expected 1" in refused(json.dumps(document))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "not JSON, or truncated"),
        ("svg", "not JSON, or truncated"),
        (small_text()[:-200], "not JSON, or truncated"),
        ("[]", "the document is a list of 0; expected an object"),
        ("null", "the document is null"),
        ("[" * 100_000, "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
        (small_text().replace("-1.5", "NaN"), "holds the value NaN"),
        (small_text().replace("-1.5", "-Infinity"), "holds the value -Infinity"),
        (small_text().replace("-1.5", "1e999"), "is inf; expected a number"),
        (small_text().replace("-1.5", "9" * 5000), "thousands of digits"),
        (small_text().replace('"units"', '"version"'), "the field 'version' is given more than once"),
        ("\0" + small_text(), "not JSON, or truncated"),
        ("\ufeff" + small_text(), "not JSON, or truncated"),
    ],
)
def test_wrong_texts(text: str, expected: str) -> None:
    assert expected in refused(text)


def test_wrong_files(tmp_path: Path) -> None:
    binary = tmp_path / "binary.json"
    binary.write_bytes(b'{"format": "\xff\xfe"}')
    picture = tmp_path / "picture.png"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n")
    loop = tmp_path / "loop.json"
    loop.symlink_to(loop)
    cases = {
        tmp_path / "none.json": "No such file",
        tmp_path: "it is a folder; expected a layout, a text in UTF-8; it comes first, then the pictures",
        binary: "byte 12 is not UTF-8",
        picture: "picture.png: is a PNG picture; expected a layout",
        loop: "cannot be read",
        tmp_path / "nul\0.json": "cannot be read",
        Path("/dev/zero"): "it is a device; expected a layout",
    }
    for path, expected in cases.items():
        with pytest.raises(LayoutError, match=expected) as caught:
            load_layout(path)
        assert str(caught.value).isprintable()


@pytest.mark.parametrize(("levels", "is_read"), [(38, True), (41, False), (900, False)])
def test_deep_parameters(levels: int, is_read: bool) -> None:
    deep = '"parameters": {"deep": ' + "[" * levels + "]" * levels + ", "
    text = json.dumps(small_document()).replace('"parameters": {', deep)
    if is_read:
        assert isinstance(parse_layout(text), Reference)
    else:
        assert "nested too deeply" in refused(text)


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from([0, 1, 2, -1, 18, 19, 1e308, 2**31, 10**400, "red", "white", "#ffffff", "cmp-layout"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


def paths(value: Any, here: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """The path of every value in a document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [here, *(path for key, item in items for path in paths(item, (*here, key)))]


PATHS = {pattern: paths(small_document(pattern)) for pattern in ("honeycomb", "square")}


def read_or_refused(text: str) -> None:
    """Every document is read or refused; a document that the schema forbids is never read."""
    try:
        reference = parse_layout(text)
    except LayoutError as error:
        assert str(error).isprintable()
        return
    assert isinstance(reference, Reference)
    VALIDATOR.validate(json.loads(text))


def mutate(document: Any, path: tuple[str | int, ...], action: str, value: object) -> Any:
    if not path:
        return value
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    key = path[-1]
    if action == "delete":
        del holder[key]
    elif action == "insert" and isinstance(holder, list):
        holder.insert(key, value)
    elif action == "insert":
        holder[f"{key}_"] = value
    elif action == "repeat" and isinstance(holder, list):
        holder.insert(key, copy.deepcopy(holder[key]))
    else:
        holder[key] = value
    return document


@settings(max_examples=400, deadline=None)
@given(data=st.data(), pattern=st.sampled_from(sorted(PATHS)))
def test_fuzz_any_field(data: st.DataObject, pattern: str) -> None:
    document: Any = small_document(pattern)
    path = data.draw(st.sampled_from(PATHS[pattern]))
    action = data.draw(st.sampled_from(["delete", "replace", "insert", "repeat"]))
    document = mutate(document, path, action, data.draw(JSON))
    read_or_refused(json.dumps(document))


@settings(max_examples=300, deadline=None)
@given(
    at=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=4),
    length=st.integers(0, 10**4),
    cut=st.booleans(),
)
def test_fuzz_bytes(
    tmp_path_factory: pytest.TempPathFactory, at: list[tuple[int, int]], length: int, cut: bool
) -> None:
    data = bytearray(small_text().encode())
    for place, byte in at:
        data[place % len(data)] = byte
    path = tmp_path_factory.getbasetemp() / "fuzz.json"
    path.write_bytes(data[:length] if cut else data)
    try:
        assert isinstance(load_layout(path), Reference)
    except LayoutError as error:
        assert str(error).isprintable()


def covariances(count: int = 19, **changes: object) -> dict[str, Any]:
    """Unit covariances of all markers, but for some entries of the first."""
    columns: dict[str, list[object]] = {"xx": [1.0] * count, "xy": [0.0] * count, "yy": [1.0] * count}
    for name, value in changes.items():
        columns[name][0] = value
    return {"covariance_mm2": columns}


def made_document() -> dict[str, Any]:
    """A pad as made whose cells look as designed."""
    document = small_document()
    markers, cells = document["markers"], document["cells"]
    places = list(zip(markers["x"], markers["y"], strict=True))
    colored = [c for c, color in zip(cells["corners"], cells["color"], strict=True) if color != "black"]
    outlines = [[list(places[marker]) for marker in corners] for corners in colored]
    made = {"of": document["digest"], "product": "mold", "side": "back", "outlines": outlines}
    columns = {"xx": [1e-4] * 19, "xy": [-5e-5] * 19, "yy": [2e-4] * 19}
    for column in columns.values():
        column[3] = None  # was not measured
    return document | {"as_made": made | {"covariance_mm2": columns}}


def test_a_pad_as_made_is_read() -> None:
    document = made_document()
    VALIDATOR.validate(document)
    made = parse_layout(json.dumps(document)).as_made
    assert made is not None
    assert (made.of, made.product, made.side) == (document["digest"], "mold", "back")
    expected = np.tile([[1e-4, -5e-5], [-5e-5, 2e-4]], (19, 1, 1))
    expected[3] = np.nan
    assert made.covariance_mm2 is not None and not made.covariance_mm2.flags.writeable
    np.testing.assert_array_equal(made.covariance_mm2, expected)
    assert made.outlines_mm is not None
    assert [ring.tolist() for ring in made.outlines_mm] == document["as_made"]["outlines"]


@pytest.mark.parametrize("left_out", [(), ("outlines",), ("covariance_mm2",), ("outlines", "covariance_mm2")])
def test_what_is_known_of_a_pad_as_made_is_written_as_it_is_read(left_out: tuple[str, ...]) -> None:
    document = made_document()
    for name in left_out:
        del document["as_made"][name]
    VALIDATOR.validate(document)
    layout = layout_from_reference(parse_layout(json.dumps(document)))
    assert json.loads(layout_to_json(layout)) == document
    cells = len(layout.colored_cells)
    assert layout.colored_outlines_mm.shape == (cells, 3, 2)


@pytest.mark.parametrize("height_mm", [-0.25, 0.1])
def test_relief_is_version_2(height_mm: float) -> None:
    """A file with cells of a height is written as it is read, and no file of version 1 has such cells."""
    document = made_document()
    document["as_made"]["cell_height_mm"] = height_mm
    document["version"] = 2
    VALIDATOR.validate(document)
    reference = parse_layout(json.dumps(document))
    assert reference.as_made is not None and reference.as_made.cell_height_mm == height_mm
    assert json.loads(layout_to_json(layout_from_reference(reference))) == document
    document["version"] = 1
    assert not VALIDATOR.is_valid(document)
    assert re.search(
        "as_made.cell_height_mm is given in a file of version 1; expected version 2",
        refused(json.dumps(document)),
    )


@pytest.mark.parametrize("height_mm", [10.5, "0.1", True, None, [0.1]])
def test_a_wrong_height_of_cells_is_one_clear_line(height_mm: object) -> None:
    document = made_document() | {"version": 2}
    document["as_made"]["cell_height_mm"] = height_mm
    assert not VALIDATOR.is_valid(document)
    assert re.search(
        "as_made.cell_height_mm is .*; expected a number from -10 to 10 mm", refused(json.dumps(document))
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"of": "abc"}, "as_made.of is 'abc'; expected the digest"),
        ({"side": "left"}, "as_made.side is 'left'; expected one of front, back"),
        ({"side": ["front"]}, "as_made.side is a list of 1"),
        ({"outlines": []}, "as_made.outlines is a list of 0; expected 13 outlines"),
        ({"outlines": [[[0, 0], [1, 0]]] * 13}, r"as_made.outlines\[0\] is a list of 2; expected at least 3"),
        ({"outlines": [[[0, 0], [1, 0], [1, "a"]]] * 13}, r"as_made.outlines\[0\]\[2\]\[1\] is 'a'"),
        ({"covariance_mm2": [1.0, 2.0, 1.0]}, "as_made.covariance_mm2 is a list of 3; expected an object"),
        ({"covariance_mm2": {"xx": [1.0] * 19}}, "as_made.covariance_mm2.xy is missing"),
        (covariances(18), "as_made.covariance_mm2.xx is a list of 18; expected 19 entries"),
        (covariances(xy=2.0), r"of marker 0 is \[1, 2, 1\]; expected xx, xy, yy of a covariance"),
        (covariances(xx=-1.0), r"of marker 0 is \[-1, 0, 1\]; expected xx, xy, yy of a covariance"),
        (covariances(yy=None), r"of marker 0 is \[1, 0, null\]; expected xx, xy, yy of a covariance"),
        (covariances(xx="1"), r"as_made.covariance_mm2.xx\[0\] is '1'"),
        ({"note": "mine"}, "as_made.'note' is unknown"),
    ],
)
def test_a_wrong_pad_as_made_is_one_clear_line(changes: dict[str, Any], message: str) -> None:
    document = made_document()
    document["as_made"] |= changes
    assert re.search(message, refused(json.dumps(document)))


def coded_document() -> dict[str, Any]:
    layout = build_layout(load_design("honeycomb", {"layers": 4, "code": 3}))
    document: dict[str, Any] = json.loads(layout_to_json(layout))
    return document


def white_ink(document: dict[str, Any]) -> None:
    document["cells"]["color"][document["cells"]["color"].index("green")] = "white"


def plain_colors(document: dict[str, Any]) -> None:
    cell, colors = document["reference"]["cell"], document["cells"]["color"]
    for i, color in enumerate(colors):
        if color == "white" and i != cell:
            colors[i] = "black"


def test_a_coded_pad_is_version_2() -> None:
    """A coded pad is written as it is read; a plain pad stays version 1."""
    document = coded_document()
    VALIDATOR.validate(document)
    assert document["version"] == 2 and document["code"] == {"id": 3, "share": 0.12}
    reference = parse_layout(json.dumps(document))
    assert reference.code is not None and (reference.code.id, reference.code.share) == (3, 0.12)
    assert (reference.cell_color == 4).sum() == 6
    assert json.loads(layout_to_json(layout_from_reference(reference))) == document
    plain = json.loads(layout_to_json(build_layout(load_design("honeycomb", {"layers": 4}))))
    assert plain["version"] == 1 and "code" not in plain


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (put("version", to=1), "code is given in a file of version 1; expected version 2"),
        (put("code", to=3), "code is 3; expected an object"),
        (put("code", "id", to=0), "code.id is 0; expected an integer from 1 to 255"),
        (put("code", "id", to=256), "code.id is 256; expected an integer from 1 to 255"),
        (put("code", "id", to=True), "code.id is true; expected an integer"),
        (put("code", "share", to=1.0), "code.share is 1.0; expected a number between 0 and 1"),
        (put("code", "share", to="12%"), "code.share is '12%'; expected a number between 0 and 1"),
        (drop("code", "share"), "code.share is missing"),
        (put("code", "name", to="a"), "code.name|'name' is unknown"),
        (drop("code"), "reference.cell is .*; expected the only white cell"),
        (plain_colors, "reference.cell is .*; expected one of several white cells of a code"),
        (white_ink, r"cells.color\[.*\] is white; expected the ink of its place"),
    ],
)  # fmt: skip
def test_a_wrong_code_is_one_clear_line(damage: Damage, message: str) -> None:
    document = coded_document()
    damage(document)
    assert re.search(message, refused(json.dumps(document)))
