"""The checklist of a release. The script checks all items that a script can check, and prints the others. Nothing is
published.

    python -m tools.release [--python python3.12 ...] [--skip-tests]

1. Version, changelog and citation agree, the changelog's heading has a date, and nothing is uncommitted.
2. For every Python: a wheel is built in an empty environment, and installed with all extras into another environment.
3. From there, away from the sources, the tutorials and README are run.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OLDEST, NEWEST = 11, 14  # minor versions of Python 3 that are looked for
# Of the extra [dev]: the libraries that run the pages, and the program that opens a recording in a tutorial.
TEST_NEEDS = ("pytest", "hypothesis", "mcap-ros2-support")
# Files of the sources that the pages' tests need, without the packages: these come from the wheel.
TESTED = (
    "tests",
    "docs",
    "benchmarks",
    "tools",
    "examples",
    "Makefile",
    "README.md",
    "CONTRIBUTING.md",
    "pyproject.toml",
)
BY_HAND = """Left to do by hand:
- make test-all, make bench and make figures on this state; look at the figures that changed
- make docs; open build/site/index.html
- python -m tools.wheel for x86_64 and aarch64, and each Python
- a tag v{version} on the commit, the wheels and the changelog's page beside it
"""


def disagreements(root: Path) -> list[str]:
    """Disagreements of version, changelog and citation; one line each."""
    version = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    package = _first(r'^__version__ = "([^"]+)"', root / "cmpdesign" / "__init__.py")
    citation = _first(r"^version: (\S+)", root / "CITATION.cff")
    heading = _first(r"^## (.+)$", root / "CHANGELOG.md")
    found = []
    for name, stated in (("cmpdesign/__init__.py", package), ("CITATION.cff", citation)):
        if stated != version:
            found.append(f"{name} has the version {stated}; pyproject.toml has {version}")
    if not re.fullmatch(rf"{re.escape(version)} \(\d{{4}}-\d\d-\d\d\)", heading):
        found.append(f'CHANGELOG.md begins with "{heading}"; a release has "{version} (year-month-day)"')
    return found


def _first(pattern: str, path: Path) -> str:
    found = re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE)
    return found[1] if found else "none"


def uncommitted(root: Path) -> list[str]:
    """Files that differ from the last commit."""
    done = subprocess.run(
        ["git", "status", "--porcelain"], cwd=root, capture_output=True, text=True, check=True
    )
    return [f"uncommitted: {line[3:]}" for line in done.stdout.splitlines()]


def page_needs(root: Path) -> list[str]:
    """The requirements of ``TEST_NEEDS`` with the versions that pyproject.toml allows."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = {re.split(r"[^\w.-]", line)[0]: line for line in project["optional-dependencies"]["dev"]}
    return [named[name] for name in TEST_NEEDS]


def found_pythons() -> list[str]:
    """The Pythons on the path that run, oldest first."""
    named = [shutil.which(f"python3.{minor}") for minor in range(OLDEST, NEWEST + 1)]
    return [path for path in named if path and _runs(path)]


def _runs(python: str) -> bool:
    return (
        subprocess.run([python, "-c", "import venv, ensurepip"], capture_output=True, check=False).returncode
        == 0
    )


def environment(python: str, folder: Path) -> Path:
    """An empty environment; the path of its interpreter."""
    subprocess.run([python, "-m", "venv", str(folder)], check=True)
    return folder / ("Scripts" if os.name == "nt" else "bin") / "python"


def built_wheel(python: str, folder: Path) -> Path:
    """The wheel of this project for a Python, built from the sources in an environment of its own."""
    builder = environment(python, folder / "builder")
    subprocess.run(
        [builder, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder / "dist", ROOT],
        check=True,
    )
    (wheel,) = (folder / "dist").glob("*.whl")
    return wheel


def run_pages(python: Path, folder: Path) -> int:
    """Run README and the tutorials with an installed package, in a copy of the tests without the packages."""
    for name in TESTED:
        source = ROOT / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, folder / name)
    pages = ["README", *(page.stem for page in sorted((ROOT / "docs" / "tutorials").glob("*.md")))]
    chosen = " or ".join(f"snippet_runs[{page}]" for page in pages)
    command = [
        python,
        "-m",
        "pytest",
        "-m",
        "",
        "tests/docs/test_docs.py",
        "-k",
        chosen,
        "-p",
        "no:cacheprovider",
    ]
    outside = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(command, cwd=folder, env=outside, check=False).returncode


def try_python(python: str) -> bool:
    """Whether the wheel of a Python installs into an empty environment and runs the pages."""
    with tempfile.TemporaryDirectory(prefix="release-") as name:
        folder = Path(name)
        begin = time.monotonic()
        wheel = built_wheel(python, folder)
        built = time.monotonic()
        print(
            f"{python}: {wheel.name}, {wheel.stat().st_size / 1e6:.1f} MB, in {built - begin:.0f} s",
            flush=True,
        )
        installed = environment(python, folder / "installed")
        needs = [f"cmpdesign[all,bench] @ {wheel.as_uri()}", *page_needs(ROOT)]
        subprocess.run([installed, "-m", "pip", "install", "--quiet", *needs], check=True)
        print(f"{python}: installed in {time.monotonic() - built:.0f} s", flush=True)
        (folder / "pages").mkdir()
        return run_pages(installed, folder / "pages") == 0


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tools.release", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--python", nargs="+", default=None, help="the Pythons; else all found Pythons")
    parser.add_argument(
        "--skip-tests", action="store_true", help="check version, changelog and citation only"
    )
    given = parser.parse_args(arguments)
    problems = disagreements(ROOT) + uncommitted(ROOT)
    for python in () if given.skip_tests else (given.python or found_pythons()):
        try:
            works = try_python(python)
        except subprocess.CalledProcessError as error:
            works = False
            print(f"{python}: {error}", file=sys.stderr)
        problems += [] if works else [f"{python}: the wheel does not install, or a page does not run"]
    for problem in problems:
        print(f"- {problem}")
    print(BY_HAND.format(version=_first(r'^version = "([^"]+)"', ROOT / "pyproject.toml")))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
