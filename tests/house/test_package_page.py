"""The package's page: every link and picture of README is whole there, and one setting names the project's address."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

from cmpdesign.libraries import EXTRAS
from tools.package_page import ROOT, absolute_links, dynamic_metadata, project_address

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_links_and_pictures_of_the_page_are_whole() -> None:
    readme = dynamic_metadata("readme", {})
    targets = re.findall(r"\]\(([^)\s]+)\)", readme["text"])
    assert readme["content-type"] == "text/markdown" and targets
    assert [target for target in targets if not target.startswith(("https://", "#"))] == []
    for target in targets:
        found = re.fullmatch(rf"{re.escape(project_address())}/(raw|blob)/main/([^#]+)(#.*)?", target)
        if found:
            assert (ROOT / found[2]).exists(), target
            assert (found[1] == "raw") == found[2].endswith((".png", ".jpg", ".svg")), target


def test_kinds_of_links() -> None:
    text = "![a b](docs/a.png) [c](docs/c.md#d) [![e](e.svg)](f.md) [g](#h) [i](https://j.k/l) a[0](x y)"
    assert absolute_links(text, "https://m.n/o") == (
        "![a b](https://m.n/o/raw/main/docs/a.png) [c](https://m.n/o/blob/main/docs/c.md#d) "
        "[![e](https://m.n/o/raw/main/e.svg)](https://m.n/o/blob/main/f.md) [g](#h) [i](https://j.k/l) a[0](x y)"
    )


def test_the_address_stands_in_one_place() -> None:
    address = project_address()
    assert all(url.startswith(address) for url in dynamic_metadata("urls", {}).values())
    command = ["git", "grep", "--untracked", "-lF", address.partition("://")[2]]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.stdout.split() in ([], ["pyproject.toml"])  # nothing where no git is


def test_the_source_archive_can_make_the_page(tmp_path: Path) -> None:
    """From a copy without what is installed and made, which the builder would walk through."""
    made = shutil.ignore_patterns(
        ".venv", ".git", "build", "dist", "out", "__pycache__", "docs", "benchmarks"
    )
    shutil.copytree(ROOT, tmp_path / "copy", ignore=made)
    code = "from scikit_build_core.build import build_sdist; build_sdist('..')"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path / "copy", capture_output=True, check=True)
    (path,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
        described = archive.extractfile(f"{path.name.removesuffix('.tar.gz')}/PKG-INFO")
        assert described is not None and f"]({project_address()}/raw/main/".encode() in described.read()
    assert {"README.md", "pyproject.toml", "tools/package_page.py"} <= names


def test_every_python_version_that_is_tested_is_told() -> None:
    told = {line.rpartition(" ")[2] for line in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", line)}
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert told == set(re.findall(r'"(3\.\d+)"', workflow)) == {"3.11", "3.12", "3.13"}


def test_extras_are_those_that_messages_name() -> None:
    extras = PROJECT["optional-dependencies"]
    assert set(EXTRAS) == set(extras) - {"all", "bench", "dev"}
    named = set(re.findall(r"\w+", " ".join([*extras["all"], *extras["dask"]])))
    assert set(EXTRAS) - named == {"rerun"}
    assert any(line.startswith("cmpdesign[all") for line in extras["dev"])


def test_nothing_says_how_to_install_what_is_not_published() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "cmpdesign").rglob("*.py")]
    pages += [*(ROOT / "examples").glob("*")]
    told = re.compile(r"""pip install ["']?cmpdesign""")
    assert [path for path in pages if path.is_file() and told.search(path.read_text(encoding="utf-8"))] == []
