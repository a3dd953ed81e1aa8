"""The examples that need nothing from outside, and the notebooks: all run in a folder of their own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
# What an example prints, in part, and files that it leaves.
RUN = {
    "read_one_picture": (
        "331 of 331 markers, 331 of them measured",
        ["example/layout.json", "example/seen.png"],
    ),
    "follow_a_video": ("0.133 s: marker", ["example/layout.json", "example/frames/4.png"]),
    "compare_designs": ("honeycomb       9      271     1.205", []),
    "size_for_my_camera": ("honeycomb, 19 layers", ["sized/layout.json"]),
    "make_a_laser_job": ("1-red.gcode", ["pad/laser/job.lbrn2", "pad/as-made/laser.json"]),
    "plot_a_recording": ("6 frames: plotted/history.png", ["plotted/displacement.png", "plotted/run.npz"]),
}
# tested beside this file, with the molds, and below
OTHERS = {"lerobot_camera", "my_own_pattern", "ros2_node", "sensor_housing", "torch_frames"}
NOTEBOOKS = ("explore_a_design", "plot_a_recording", "compare_designs")
MAX_LINES = 45


def run_python(words: Sequence[str | Path], folder: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg", "PYTHONWARNINGS": "error"}
    result = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_every_example_is_run_and_short() -> None:
    files = {path.stem: len(path.read_text(encoding="utf-8").splitlines()) for path in EXAMPLES.glob("*.py")}
    assert files.keys() == RUN.keys() | OTHERS and len(files) == 11
    assert {path.stem for path in EXAMPLES.glob("*.ipynb")} == set(NOTEBOOKS)
    assert {name: lines for name, lines in files.items() if lines > MAX_LINES and name in RUN} == {}


@pytest.mark.parametrize("name", RUN)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    said, files = RUN[name]
    assert said in run_python([EXAMPLES / f"{name}.py"], tmp_path)
    assert [file for file in files if not (tmp_path / file).stat().st_size] == []


def test_an_example_takes_files(tmp_path: Path) -> None:
    run_python([EXAMPLES / "read_one_picture.py"], tmp_path)
    (tmp_path / "other").mkdir()
    printed = run_python(
        [EXAMPLES / "read_one_picture.py", "../example/layout.json", "../example/seen.png"],
        tmp_path / "other",
    )
    assert "331 of 331" in printed and list((tmp_path / "other").iterdir()) == []


@pytest.mark.parametrize("name", [name for name, (_, files) in RUN.items() if files])
def test_an_example_overwrites_no_file(name: str, tmp_path: Path) -> None:
    """A folder of the user's with the example's name: one line, and no file changes."""
    for folder in {file.partition("/")[0] for _, files in RUN.values() for file in files}:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "layout.json").write_text("mine", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1 and "exists: rename or remove it" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert {path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.*")} == {"mine"}


def test_a_pattern_of_a_file_is_built_and_read(tmp_path: Path) -> None:
    pattern = EXAMPLES / "my_own_pattern.py"
    options = ["--set", "pattern=swirl", "--set", "layers=6", "-o", "swirl", "--only", "layout"]
    words = ["-m", "cmpdesign", "--load", pattern, "build", "honeycomb", *options]
    run_python(words, tmp_path)
    reading = (
        "import cmpdesign, extractor\n"
        "layout = 'swirl/layout.json'\n"
        "seen = cmpdesign.render(layout, pitch_px=30, noise=2)\n"
        "markers = extractor.Extractor(layout).extract(seen.image)\n"
        "error_px = abs(markers.xy_px - seen.truth.marker_xy_px)\n"
        "found = markers.status == 1\n"
        "assert found.sum() >= len(found) - 1 and error_px[found].max() < 0.1\n"
    )
    run_python(["-c", reading], tmp_path)


@pytest.mark.slow
def test_a_pattern_of_a_file_passes_the_tests_of_patterns(tmp_path: Path) -> None:
    """Put where CONTRIBUTING says, in a copy of the checkout."""
    for part in ("cmpdesign", "extractor", "tests"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / part, tmp_path / part, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "templates").symlink_to(ROOT / "templates")
    shutil.copy(EXAMPLES / "my_own_pattern.py", tmp_path / "cmpdesign" / "patterns" / "swirl.py")
    tests = [f"tests/{name}" for name in ("cmpdesign/patterns/test_patterns.py", "house/test_structure.py")]
    words = ["-m", "pytest", "-n0", "-p", "no:cacheprovider", "-k", "swirl or order or import", *tests]
    assert " passed" in run_python(words, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs(name: str, tmp_path: Path) -> None:
    run = (
        "import sys, nbformat\nfrom nbclient import NotebookClient\n"
        "book = nbformat.read(sys.argv[1], 4)\n"
        "assert not any(cell.get('outputs') for cell in book.cells), 'notebooks are kept without results'\n"
        "NotebookClient(book, timeout=600, kernel_name='python3').execute()\n"
        "print(sum(bool(cell.get('outputs')) for cell in book.cells))"
    )
    program = tmp_path / "run.py"
    program.write_text(run, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [sys.executable, program, EXAMPLES / f"{name}.ipynb"]
    result = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert int(result.stdout.splitlines()[-1]) >= 3


@pytest.mark.slow
def test_the_examples_are_typed(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "mypy", "--strict", f"--cache-dir={tmp_path}", EXAMPLES]
    result = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
