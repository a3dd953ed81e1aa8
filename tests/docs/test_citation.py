"""CITATION.cff states the version that the package has, and the article by its title."""

from __future__ import annotations

from pathlib import Path

import yaml

import cmpdesign

ROOT = Path(__file__).parents[2]


def test_the_citation_is_of_this_version_and_names_the_article() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split()).lower()
    assert citation["version"] == cmpdesign.__version__
    assert citation["license"] == "Apache-2.0"
    assert citation["preferred-citation"]["title"].lower() in readme
    assert all(author["family-names"] for author in citation["preferred-citation"]["authors"])
