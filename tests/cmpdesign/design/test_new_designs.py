"""Design files that go on from others, and new files with every field explained."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from pydantic import BaseModel

from cmpdesign import Design, DesignError, build_layout, load
from cmpdesign.design.commented_toml import STARTING_VALUES, commented_toml
from cmpdesign.design.templates import find_template, template_kinds, template_words, templates_folder
from tests.support.command import refused, run

SCHEMA = json.loads((templates_folder() / "design.schema.json").read_text(encoding="utf-8"))
COMMENTED_FIELD = re.compile(r"^# (\w+) = (.*)$", re.MULTILINE)


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def every_field(model: type[BaseModel], table: str = "") -> dict[str, Any]:
    """Field -> default, of tables, too, as "laser.kerf_mm"."""
    fields: dict[str, Any] = {}
    for name, info in model.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            fields |= every_field(inner, f"{name}.")
        else:
            fields[table + name] = info.get_default()
    return fields


def flat(document: dict[str, Any], table: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in document.items():
        found |= flat(value, f"{name}.") if isinstance(value, dict) else {table + name: value}
    return found


# -- extends


def test_a_chain_of_designs_equals_the_design_written_out(tmp_path: Path) -> None:
    """Over a template, through a file in another folder; the digest is that of the whole design."""
    written(
        tmp_path / "base" / "small.toml",
        'extends = "tac3d"\nlayers = 4\n[laser]\nkerf_mm = 0.2\npasses = 3\n',
    )
    chained = written(
        tmp_path / "mine.toml", 'extends = "base/small.toml"\npitch_mm = "60mil"\n[laser]\npasses = 2\n'
    )
    whole = written(
        tmp_path / "whole" / "mine.toml",
        'pattern = "honeycomb"\nlayers = 4\npitch_mm = "60mil"\nvirtual_per_edge = 5\nborder_mm = 1\n'
        "mirrored = true\n[laser]\nkerf_mm = 0.2\npasses = 2\n",
    )
    assert load(chained) == load(whole)
    assert build_layout(load(chained)).digest == build_layout(load(whole)).digest
    written(tmp_path / "base" / "small.toml", 'extends = "tac3d"\nlayers = 5\n')
    assert build_layout(load(chained)).digest != build_layout(load(whole)).digest


def test_none_takes_away_and_what_tells_of_a_file_stays_there(tmp_path: Path) -> None:
    wide = written(tmp_path / "wide.toml", 'extends = "tac3d"\nlayers = "none"\nwidth_mm = 20\n')
    design = load(wide, {"height_mm": "18"})
    assert (design.layers, design.width_mm, design.height_mm, design.mirrored) == (None, 20, 18, True)
    assert (design.name, design.description, design.source) == ("wide", "", "")


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"a": 'extends = "a.toml"'}, "leads in a circle"),
        ({"a": 'extends = "b.toml"', "b": 'extends = "c/../a.toml"', "c/d": ""}, "leads in a circle"),
        ({"a": 'extends = "nosuch"'}, "is no template and no file beside it"),
        ({"a": "extends = 3"}, "must be a name or a path"),
        ({"a": 'extends = ""'}, "must be a name or a path"),
        ({"a": 'extends = "."'}, "cannot be read"),
        ({"a": 'extends = "b.toml"', "b": "layers = ="}, "b.toml is no valid TOML: "),
        ({"a": 'extends = "b.toml"', "b": 'pattern = "round"\nlayer = 3'}, "layer is unknown"),
        ({"a": 'extends = "tac3d"\nlaser = 3'}, "laser = 3 must be"),
        (
            {"a": 'extends = "a1.toml"', **{f"a{k}": f'extends = "a{k + 1}.toml"' for k in range(1, 40)}},
            "more than",
        ),
    ],
)
def test_what_cannot_be_extended_is_refused(files: dict[str, str], said: str, tmp_path: Path) -> None:
    for name, text in files.items():
        written(tmp_path / f"{name}.toml", text)
    with pytest.raises(DesignError, match=re.escape(said)):
        load(tmp_path / "a.toml")
    assert said in refused("build", tmp_path / "a.toml", "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_editors_know_what_is_extended() -> None:
    jsonschema.validate({"extends": "tac3d", "layers": 3}, SCHEMA)
    jsonschema.validate({"pattern": "round", "layers": 3, "pitch_mm": 1}, SCHEMA)
    for wrong in ({"layers": 3}, {"extends": 3}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, SCHEMA)


# -- init


def test_a_new_design_is_built(tmp_path: Path) -> None:
    assert run("init", tmp_path / "mine").exit_code == 0
    path = tmp_path / "mine.toml"
    assert load(path) == Design(name="mine", **STARTING_VALUES)
    assert run("init", tmp_path / "wider.toml", "--extends", "tac3d").exit_code == 0
    assert load(tmp_path / "wider.toml").model_dump(exclude={"name", "source", "description"}) == load(
        "tac3d"
    ).model_dump(exclude={"name", "source", "description"})
    assert run("init", tmp_path / "more", "--extends", "wider.toml").exit_code == 0
    assert run("build", tmp_path / "more.toml", "--only", "layout", "-o", tmp_path).exit_code == 0


def test_every_field_stands_in_a_new_design_with_its_description_and_default() -> None:
    text, fields = commented_toml(), every_field(Design)
    given = flat(tomllib.loads(text))
    uncommented = flat(tomllib.loads(COMMENTED_FIELD.sub(r"\1 = \2", text)))
    assert uncommented.keys() == fields.keys() and given == STARTING_VALUES
    for name, default in fields.items():
        if default is not None and name not in STARTING_VALUES:
            assert uncommented[name] == default, name
    words = " ".join(line.removeprefix("# ") for line in text.splitlines())
    for model in (Design, *(info.annotation for info in Design.model_fields.values())):
        if isinstance(model, type) and issubclass(model, BaseModel):
            assert all(
                info.description or model.__name__ == "Palette" for info in model.model_fields.values()
            )
            assert all((info.description or "") in words for info in model.model_fields.values())


def test_ranges_and_units_are_those_of_the_model() -> None:
    """A value beyond a stated range is refused, the limits themselves are not."""
    limits = re.findall(r"\[([^\]]*)\]\n(?:# )?(\w+) = ", commented_toml())
    stated = {name: facts.replace("\n# ", " ") for facts, name in limits}
    assert (
        "mm; above 0 to 10000" in stated["pitch_mm"] and "degrees; from -360 to 360" in stated["rotation_deg"]
    )
    assert '"none" | "rectangle" | "circle"' in stated["clip"] and "mm/s" in stated["speed_mm_s"]
    lowest, highest = map(int, re.findall(r"from (\d+) to (\d+)", stated["layers"])[0])
    for layers in (lowest, highest):
        Design(**{**STARTING_VALUES, "layers": layers})
    for layers in (lowest - 1, highest + 1):
        with pytest.raises(DesignError):
            Design(**{**STARTING_VALUES, "layers": layers})


def test_init_keeps_what_is_there(tmp_path: Path) -> None:
    path = written(tmp_path / "mine.toml", "# by hand\n")
    assert "exists already" in refused("init", path)
    assert "no template" in refused("init", tmp_path / "other", "--extends", "nosuch")
    assert "extends itself" in refused("init", path, "--extends", "mine.toml", "--force")
    assert path.read_text(encoding="utf-8") == "# by hand\n" and list(tmp_path.iterdir()) == [path]
    assert run("init", path, "--force").exit_code == 0 and load(path).layers == 10


# -- templates


def test_every_template_is_listed_and_shown() -> None:
    listed = json.loads(run("templates", "--json").stdout)["templates"]
    found = {(kind, name) for kind, names in template_kinds().items() for name in names}
    assert {(each["kind"], each["name"]) for each in listed} == found and len(listed) == len(found)
    assert all(each["description"] for each in listed)
    for kind, name in found:
        path = find_template(f"{kind}/{name}")[1]
        shown = run("templates", "--show", name, "--kind", kind)
        assert shown.stdout == path.read_text(encoding="utf-8")
        assert template_words(path).description
    assert "pattern = " in run("templates", "--show", "tac3d").stdout  # the design, not the sensor
    assert "did you mean honeycomb?" in refused("templates", "--show", "honeycom")
    only = run("templates", "--kind", "scenes").stdout
    assert "pressed-ball" in only and "co2-40w" not in only
