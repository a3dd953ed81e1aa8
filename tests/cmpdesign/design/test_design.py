"""Designs: accepted values, refused values with their messages, and the schema for editors."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cmpdesign.design.design import Design, design_schema, design_schema_text, load_design
from cmpdesign.design.templates import templates_folder
from cmpdesign.errors import DesignError
from cmpdesign.layout.build import build_layout
from cmpdesign.patterns import registered_patterns


def refusal(**fields: object) -> str:
    with pytest.raises(DesignError) as caught:
        Design(**({"pattern": "honeycomb"} | fields))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def sized(**fields: object) -> str:
    return refusal(layers=3, pitch_mm=1, **fields)


def test_units_become_millimetres_and_degrees() -> None:
    design = Design(pattern="round", layers=3, pitch_mm="60mil", border_mm="0.1cm", rotation_deg="0.25turn")
    assert (design.pitch_mm, design.border_mm, design.rotation_deg) == (1.524, 1.0, 90.0)


def test_a_design_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Design(pattern="round", layers=3, pitch_mm=1).layers = 4  # type: ignore[misc]


def test_unknown_keys_are_refused_with_the_nearest_known_one() -> None:
    assert "pich_mm is unknown (did you mean pitch_mm?)" in sized(pich_mm=1)
    assert "palette.wihte is unknown (did you mean white?)" in sized(palette={"wihte": "#ffffff"})
    assert "did you mean honeycomb?" in sized(pattern="honycomb")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"layers": 0, "pitch_mm": 1}, ["layers = 0", "1"]),
        ({"layers": 201, "pitch_mm": 1}, ["layers = 201", "200"]),
        ({"layers": 2.5, "pitch_mm": 1}, ["layers = 2.5", "integer"]),
        ({"layers": 3, "pitch_mm": -1}, ["pitch_mm = -1.0", "greater than 0 mm"]),
        ({"layers": 3, "pitch_mm": 0}, ["pitch_mm", "greater than 0 mm"]),
        ({"layers": 3, "pitch_mm": 1e-6}, ["pitch_mm = 1e-06 mm", "0.001 mm", "unit"]),
        ({"layers": 3, "pitch_mm": "1kg"}, ["pitch_mm", "'kg'", "um, mm, cm"]),
        ({"layers": 3, "pitch_mm": 1, "rotation_deg": "3mm"}, ["rotation_deg", "'mm'", "deg, mrad"]),
        ({"layers": 3, "pitch_mm": 1, "palette": {"red": "red"}}, ["palette.red = 'red'", "#c8322d"]),
        ({"layers": 3, "pitch_mm": 1, "mirrored": "yes"}, ["mirrored = 'yes'", "boolean"]),
        ({"layers": 3, "pitch_mm": 1, "virtual_per_edge": -1}, ["virtual_per_edge = -1"]),
        ({"layers": 3, "pitch_mm": 1, "aspect": 0.5}, ["aspect", "elliptical", "honeycomb"]),
        ({"layers": 3, "pitch_mm": 1, "spacing": "arc"}, ["spacing", "elliptical"]),
        ({"pattern": "elliptical", "layers": 3, "pitch_mm": 1, "aspect": 0.2}, ["aspect = 0.2", "0.25"]),
        ({"layers": 3, "pitch_mm": 1, "name": "two\nlines"}, ["name", "one line"]),
        ({"layers": 3, "pitch_mm": 1, "border_mm": -0.1}, ["border_mm = -0.1", "0 mm"]),
    ],
)
def test_values_out_of_range_name_value_limit_and_unit(fields: dict[str, object], words: list[str]) -> None:
    message = refusal(**fields)
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "add pitch_mm and layers"),
        ({"layers": 3}, "add pitch_mm or width_mm"),
        ({"pitch_mm": 1}, "add layers"),
        ({"width_mm": 30}, "add layers or pitch_mm"),
        ({"height_mm": 30}, "add layers or pitch_mm"),
        ({"layers": 3, "pitch_mm": 1, "width_mm": 30}, "leave one of the three out"),
        ({"clip": "circle", "layers": 3, "pitch_mm": 1}, "needs clip_diameter_mm"),
        ({"clip": "rectangle", "layers": 3, "pitch_mm": 1, "clip_width_mm": 9}, "needs clip_height_mm"),
        ({"layers": 3, "pitch_mm": 1, "clip_width_mm": 9}, 'needs clip = "rectangle"'),
        ({"layers": 3, "pitch_mm": 1, "clip": "circle", "clip_diameter_mm": 2}, "no area inside a border"),
    ],
)
def test_under_and_over_determined_sizes_say_how_to_mend(fields: dict[str, object], words: str) -> None:
    assert words in refusal(**fields)


def test_overrides_reach_every_field() -> None:
    overrides = {
        "layers": "4",
        "pitch_mm": "60mil",
        "mirrored": "true",
        "palette.red": "#FF0000",
        "clip": "circle",
        "clip_diameter_mm": "11",
        "description": "my own",
    }
    design = load_design("tac3d", overrides)
    assert (design.layers, design.pitch_mm, design.mirrored) == (4, 1.524, True)
    assert (design.palette.red, design.palette.green) == ("#ff0000", "#28963c")
    assert (design.clip, design.clip_diameter_mm, design.description) == ("circle", 11.0, "my own")
    assert design.name == "tac3d"


def test_none_takes_a_field_out() -> None:
    design = load_design("honeycomb", {"layers": "none", "width_mm": "30"})
    assert (design.layers, design.width_mm) == (None, 30.0)


@pytest.mark.parametrize(
    "overrides", [{"pich": "1"}, {"palette": "3"}, {"pitch_mm.x": "1"}, {"": "1"}, {"a.b.c": "1"}]
)
def test_bad_overrides_are_one_line(overrides: dict[str, str]) -> None:
    with pytest.raises(DesignError) as caught:
        load_design("honeycomb", overrides)
    assert str(caught.value).startswith("honeycomb: ")
    assert "\n" not in str(caught.value)


@given(st.dictionaries(st.sampled_from([*Design.model_fields, "palette.red"]), st.text(), max_size=4))
@settings(max_examples=150, deadline=None)
def test_any_override_gives_a_design_or_one_line(overrides: dict[str, str]) -> None:
    try:
        load_design("honeycomb", overrides)
    except DesignError as error:
        assert str(error).isprintable()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"pattern = ", "no valid TOML"),
        (b"\xff\xfe", "no UTF-8"),
        (b"layers = 3\npitch_mm = 1", "pattern is missing"),
        (b"pattern = 3\nlayers = 3\npitch_mm = 1", "pattern = 3"),
    ],
)
def test_bad_files_are_one_line(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    with pytest.raises(DesignError) as caught:
        load_design(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_design_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('pattern = "square"\nlayers = 2\npitch_mm = "2mm"\n[palette]\nred = "#ff0000"\n')
    design = load_design(path)
    assert (design.name, design.pattern, design.palette.red) == ("mine", "square", "#ff0000")
    assert len(build_layout(design).cell_corners) == 25


def test_the_shipped_schema_is_current() -> None:
    shipped = templates_folder() / "design.schema.json"
    assert shipped.read_text(encoding="utf-8") == design_schema_text()


def test_the_schema_is_valid_and_knows_the_patterns() -> None:
    schema = design_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["properties"]["pattern"]["enum"] == list(registered_patterns())
    assert json.loads(design_schema_text()) == schema


@pytest.mark.parametrize(
    ("fields", "valid"),
    [
        ({"layers": 3, "pitch_mm": "60mil", "rotation_deg": "-30deg"}, True),
        ({"layers": 3, "pitch_mm": 1.5, "palette": {"red": "#FF0000"}}, True),
        ({"layers": 3, "pitch_mm": "1kg"}, False),
        ({"layers": 0, "pitch_mm": 1}, False),
        ({"layers": 3, "pitch_mm": -1}, False),
        ({"layers": 3, "pitch_mm": 1, "pich_mm": 1}, False),
        ({"layers": 3, "pitch_mm": 1, "pattern": "honycomb"}, False),
        ({"layers": 3, "pitch_mm": 1, "palette": {"red": "red"}}, False),
    ],
)
def test_schema_and_design_agree(fields: dict[str, object], valid: bool) -> None:
    document = {"pattern": "honeycomb"} | fields
    assert jsonschema.Draft202012Validator(design_schema()).is_valid(document) is valid
    if valid:
        Design(**document)
    else:
        refusal(**document)
