"""Every shipped template builds without findings, and names the source of its numbers."""

from __future__ import annotations

import tomllib
from pathlib import Path

import jsonschema
import pytest

from cmpdesign.design.design import design_schema, load_design
from cmpdesign.design.templates import find_design, templates
from cmpdesign.errors import DesignError
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.checks import check_design
from cmpdesign.layout.report import design_report
from cmpdesign.patterns import registered_patterns

NAMES = list(templates())


def test_every_pattern_and_three_sensors_have_a_template() -> None:
    assert set(registered_patterns()) | {"tac3d", "gelsight-mini", "digit"} <= set(NAMES)
    for name in registered_patterns():
        assert load_design(name).pattern == name


@pytest.mark.parametrize("name", NAMES)
def test_a_template_builds_without_a_finding_and_names_its_source(name: str) -> None:
    design = load_design(name)
    assert design.description
    assert "assumed" in design.source
    subjects = [finding.subject for finding in check_design(design, build_layout(design))]
    # The baseline is not read by the extractor.
    assert subjects == (["the extractor reads cells with three corners only"] if name == "square" else [])


@pytest.mark.parametrize("name", NAMES)
def test_a_template_follows_the_schema_it_names(name: str) -> None:
    path = templates()[name]
    jsonschema.Draft202012Validator(design_schema()).validate(tomllib.loads(path.read_text(encoding="utf-8")))
    schema = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("#:schema ")
    assert (path.parent / schema).is_file()


def test_tac3d_has_the_article_s_figures() -> None:
    figures = design_report(load_design("tac3d"), build_layout(load_design("tac3d")))
    assert (figures.markers, figures.virtual_markers, figures.points) == (331, 4650, 4981)
    assert figures.shortest_edge_mm == pytest.approx(1.5, abs=1e-6)


@pytest.mark.parametrize(("name", "size_mm"), [("gelsight-mini", (18.6, 14.3)), ("digit", (19.0, 16.0))])
def test_sensors_have_their_published_size(name: str, size_mm: tuple[float, float]) -> None:
    assert build_layout(load_design(name)).size_mm == pytest.approx(size_mm, abs=1e-8)


def test_names_paths_and_neither(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text("")
    assert find_design("tac3d") == templates()["tac3d"]
    assert find_design("mine.toml") == Path("mine.toml")
    with pytest.raises(DesignError, match=r"no such template \(did you mean tac3d\?\)"):
        find_design("tac3")
    with pytest.raises(DesignError, match="no such file"):
        find_design("folder/mine.toml")
