"""The checklist of a release reports disagreements; the whole checklist runs on this Python, marked slow."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tools import release


def project(root: Path, **changes: str) -> Path:
    files = {
        "pyproject.toml": '[project]\nversion = "1.2.0"\n',
        "cmpdesign/__init__.py": '"""x"""\n__version__ = "1.2.0"\n',
        "CITATION.cff": "cff-version: 1.2.0\nversion: 1.2.0\n",
        "CHANGELOG.md": "# Changelog\n\n## 1.2.0 (2026-12-01)\n",
    }
    (root / "cmpdesign").mkdir()
    for name, text in (files | changes).items():
        (root / name).write_text(text, encoding="utf-8")
    return root


def test_a_project_that_agrees_has_nothing_to_mend(tmp_path: Path) -> None:
    assert release.disagreements(project(tmp_path)) == []


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("cmpdesign/__init__.py", '__version__ = "1.1.0"\n', "1.1.0; pyproject.toml has 1.2.0"),
        ("CITATION.cff", "version: 1.1.9\n", "CITATION.cff has the version 1.1.9"),
        ("CHANGELOG.md", "## 1.2.0 (unreleased)\n", "1.2.0 (unreleased)"),
        ("CHANGELOG.md", "nothing\n", "none"),
    ],
)
def test_what_does_not_agree_is_told(tmp_path: Path, name: str, text: str, told: str) -> None:
    (line,) = release.disagreements(project(tmp_path, **{name: text}))
    assert told in line


def test_uncommitted_files_are_told(tmp_path: Path) -> None:
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    (tmp_path / "a.txt").write_text("a")
    assert release.uncommitted(tmp_path) == ["uncommitted: a.txt"]


def test_what_runs_the_pages_is_declared() -> None:
    needs = release.page_needs(release.ROOT)
    assert [need.split(">")[0] for need in needs] == list(release.TEST_NEEDS)


@pytest.mark.slow
def test_the_wheel_of_this_python_runs_the_pages() -> None:
    assert release.try_python(sys.executable)
