"""The packages: each alone, the time of imports, and the wheel in another folder."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from tests.house.source_trees import python_files

ROOT = Path(__file__).parents[2]
SOURCES = [*python_files(ROOT / "cmpdesign"), *python_files(ROOT / "extractor")]
EXTRACTOR_NEEDS = {"numpy", "cv2"}
HEAVY = {"numpy", "cv2", "scipy", "pydantic", "shapely", "matplotlib", "svgwrite", "extractor"}


def python(
    code: str, *arguments: str, executable: str | Path = sys.executable, cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    command = [str(executable), "-c", code, *arguments]
    return subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


# Everything third-party but what the extractor needs is as if it were not installed.
ALONE = """
import sys
from importlib.abc import MetaPathFinder

NEEDS = set(sys.argv[1].split(","))

class Refuse(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        top = name.partition(".")[0]
        if top in NEEDS or top in sys.stdlib_module_names or top.startswith(("_", "sitecustomize")):
            return None
        if top != "extractor":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None

sys.meta_path.insert(0, Refuse())
for blocked in ("cmpdesign", "pydantic", "typer"):
    try:
        __import__(blocked)
    except ModuleNotFoundError:
        continue
    raise SystemExit(f"{blocked} could be imported")

import numpy as np
from extractor import Extractor, load_layout
reference = load_layout(sys.argv[2])
image = np.full((120, 160, 3), 90, np.uint8)
markers = Extractor(reference).extract(image)
assert not np.isfinite(markers.xy_px).any() and markers.reason is not None
print("alone", len(reference.layer))
"""


def test_extractor_works_alone(layout_file: Path) -> None:
    result = python(ALONE, ",".join(EXTRACTOR_NEEDS), str(layout_file))
    assert result.stdout == "alone 19\n", result.stderr


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom cmpdesign.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        "print('loaded', *sorted({name.partition('.')[0] for name in sys.modules}), file=sys.stderr)"
    )
    result = python(code)
    loaded = set(result.stderr.split("loaded ")[-1].split())
    assert "verify" in result.stdout and "typer" in loaded
    assert not loaded & HEAVY


def test_importing_the_packages_is_cheap() -> None:
    result = python("import sys, cmpdesign; print(*sorted(sys.modules))")
    assert not set(result.stdout.split()) & HEAVY


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the checkout by the declared backend; it takes the native modules of the checkout.

    test_wheels.py tests wheels that are compiled separately.
    """
    folder = tmp_path_factory.mktemp("wheel")
    options = [
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        f"--config-settings=build-dir={folder / 'tree'}",
        f"--config-settings=cmake.define.CMP_PREBUILT={ROOT}",
    ]
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        *options,
        "--wheel-dir",
        str(folder),
        str(ROOT),
    ]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        command, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=600, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    (made,) = folder.glob("*.whl")
    return made


def test_wheel_holds_what_is_shipped(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    shipped = {"extractor/layout.schema.json", "extractor/py.typed", "cmpdesign/py.typed"}
    shipped |= {f"cmpdesign/{path.relative_to(ROOT)}" for path in (ROOT / "templates").rglob("*.toml")}
    shipped |= {str(path.relative_to(ROOT)) for path in SOURCES}
    assert shipped <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not any(name.startswith("tests") for name in names)
    for package in ("cmpdesign", "extractor"):
        assert any(re.fullmatch(rf"{package}/_native\..*(so|pyd)", name) for name in names)
    assert not any(name.endswith((".cpp", ".hpp")) for name in names)


@pytest.fixture(scope="module")
def elsewhere(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean environment that has the wheel, and the dependencies of this one through a path file."""
    folder = tmp_path_factory.mktemp("elsewhere")
    venv.create(folder, with_pip=False, symlinks=True)
    site = Path(sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)}))
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    zipfile.ZipFile(wheel).extractall(site)
    return folder


def test_wheel_works_elsewhere(elsewhere: Path, tmp_path: Path) -> None:
    interpreter = elsewhere / "bin" / "python"
    where = python(
        "import cmpdesign, extractor; print(cmpdesign.__file__, extractor.__file__)",
        executable=interpreter,
        cwd=tmp_path,
    )
    assert all(name.startswith(str(elsewhere)) for name in where.stdout.split()), where.stdout + where.stderr

    def cmpdesign(*arguments: str) -> str:
        code = "from cmpdesign.cli import main; main()"
        result = python(code, *arguments, executable=interpreter, cwd=tmp_path)
        assert result.returncode == 0, result.stderr
        return result.stdout

    assert "tac3d" in cmpdesign("templates")
    cmpdesign("build", "honeycomb", "-o", "made", "--set", "layers=4")
    cmpdesign(
        "render", "made/layout.json", "-o", "view.png", "--pitch", "30", "--rotation", "20", "--noise", "1"
    )
    verdict = json.loads(cmpdesign("verify", "made/layout.json", "view.png", "--json"))
    assert verdict["verified"] is True
    assert verdict["images"][0]["measured"] == 61


MAX_BASE_MB = 370  # of 1e6 bytes, with the rest of the last blocks, as du --block-size=MB counts


@pytest.mark.slow
def test_a_base_installation_is_small_and_names_what_it_lacks(wheel: Path, tmp_path: Path) -> None:
    """As ``pip install .`` leaves it, pip included; the libraries come from the package index."""
    venv.create(tmp_path / "base", with_pip=True)
    interpreter = tmp_path / "base" / "bin" / "python"
    options = ["--quiet", "--disable-pip-version-check", "--constraint", str(ROOT / "requirements.lock")]
    subprocess.run([interpreter, "-m", "pip", "install", *options, wheel], check=True, timeout=600)
    files = [path.lstat() for path in (tmp_path / "base").rglob("*")]
    assert sum(512 * file.st_blocks for file in files) / 1e6 < MAX_BASE_MB
    code = "from cmpdesign.cli import main; main()"
    for words in (
        "build elliptical -o made --set layers=4",
        "render made/layout.json -o seen.png --pitch 30 --noise 1",
        "verify made/layout.json seen.png",
    ):
        result = python(code, *words.split(), executable=interpreter, cwd=tmp_path)
        assert result.returncode == 0, result.stderr
    for product, extra in (("laser", "laser"), ("mold", "cad"), ("mesh", "cad"), ("print", "print")):
        words = ["build", "honeycomb", "-o", "pad", "--set", "layers=2", "--only", product]
        result = python(code, *words, executable=interpreter, cwd=tmp_path)
        assert result.returncode == 2 and f"of the extra [{extra}]" in result.stderr
        assert f"{wheel}[{extra}]" in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "pad").exists()
