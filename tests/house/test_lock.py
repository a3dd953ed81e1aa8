"""requirements.lock names a version of everything that is declared, and the tests run with these versions."""

from __future__ import annotations

import tomllib
from importlib.metadata import PackageNotFoundError, metadata, version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DECLARED = [
    Requirement(text)
    for texts in (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values())
    for text in texts
    if not text.startswith("cmpdesign[")  # an extra that takes others
]
LOCKED = {
    canonicalize_name(name): locked
    for line in (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
    for name, _, locked in [line.partition("==")]
}


@pytest.mark.parametrize("requirement", DECLARED, ids=str)
def test_what_is_declared_is_locked(requirement: Requirement) -> None:
    assert requirement.specifier.contains(LOCKED[canonicalize_name(requirement.name)])


def test_the_lock_is_what_runs_here() -> None:
    """A package for another platform may be absent."""
    others = {}
    for name, locked in LOCKED.items():
        try:
            others |= {name: version(name)} if version(name) != locked else {}
        except PackageNotFoundError:
            continue
    assert others == {}, "make setup installs the locked versions; make lock writes the installed ones"


def test_the_locked_versions_install_on_debian_12() -> None:
    refused = {}
    for name in LOCKED:
        try:
            needed = metadata(name)["Requires-Python"]
        except PackageNotFoundError:
            continue
        if needed and not SpecifierSet(needed).contains("3.11.2"):
            refused[name] = needed
    assert refused == {}


def test_setup_and_ci_use_the_lock() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "LOCK ?= requirements.lock" in makefile and makefile.count('--lock "$(LOCK)"') == 2
    assert "make setup LOCK=requirements.lock" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
