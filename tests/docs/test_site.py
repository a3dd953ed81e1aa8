"""The documentation as a site: ``make docs`` refuses a page, link or anchor that leads nowhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tools.site_links import outside_files

ROOT = Path(__file__).parents[2]
LEFT_OUT = shutil.ignore_patterns("images", "figures", "measured", "__pycache__")


def build(config: Path, site: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(config), "-d", str(site)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(command, capture_output=True, text=True, env=environment)


def in_site(path: Path) -> Path:
    """The path of a repository's file in the site."""
    if path.suffix != ".md":
        return path
    return path.with_name("index.html") if path.name == "README.md" else path.with_suffix(".html")


def test_the_site_has_every_page_behind_its_door(tmp_path: Path) -> None:
    done = build(ROOT / "mkdocs.yml", tmp_path / "site")
    assert done.returncode == 0, done.stderr
    pages = [path.relative_to(ROOT / "docs") for path in sorted((ROOT / "docs").rglob("*.md"))]
    start = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    for page in map(in_site, pages):
        assert (tmp_path / "site" / page).is_file()
        assert f'href="{page.as_posix()}"' in start, f"{page} has no place in the navigation"
    for path in outside_files([ROOT / "docs" / page for page in pages]):
        assert (tmp_path / "site" / "project" / in_site(path.relative_to(ROOT))).is_file()


@pytest.mark.slow
@pytest.mark.parametrize("link", ["gone.md", "reference/glossary.md#gone", "../gone.txt"])
def test_a_link_that_leads_nowhere_is_refused(tmp_path: Path, link: str) -> None:
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=LEFT_OUT)
    shutil.copytree(ROOT / "docs" / "images", tmp_path / "docs" / "images")
    for name in ("mkdocs.yml", "tools"):
        source = ROOT / name
        shutil.copytree(source, tmp_path / name) if source.is_dir() else shutil.copy(source, tmp_path / name)
    page = tmp_path / "docs" / "index.md"
    page.write_text(page.read_text(encoding="utf-8") + f"\n[nowhere]({link})\n", encoding="utf-8")
    done = build(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert done.returncode == 1 and "gone" in done.stderr
