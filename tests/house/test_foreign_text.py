"""One module prints, and few modules open files: foreign text passes through their checks."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.house.source_trees import parsed, python_files

ROOT = Path(__file__).parents[2]
PACKAGES = ("cmpdesign", "extractor")
PRINTS = {
    "cmpdesign/cli/terminal.py",
    "cmpdesign/__main__.py",  # one fixed line, before terminal.py is loaded
}
PRINTING = {"print", "echo", "secho", "Console", "Text", "Panel", "pprint"}
CONSOLE = re.compile(r"console\([^()]*\)\.print")  # of the console that terminal.py makes
STREAMS = {"stdout", "stderr", "__stdout__", "__stderr__"}
# Modules that open files, and which of these calls are theirs to make.
READS = {
    "cmpdesign/inputs/files.py": {"os.open", "os.fdopen"},
    "cmpdesign/inputs/documents.py": {"tomllib.loads", "json.loads"},
    "extractor/layout/text_file.py": {"os.open", "os.fdopen"},
    "extractor/layout/json_fields.py": {"json.loads"},
    "extractor/space/rig.py": {"tomllib.loads"},
    "extractor/contact/gel.py": {"np.load"},  # of bytes that text_file.py read
    "cmpdesign/files/images.py": {"cv2.imdecode"},  # of bytes that inputs/files.py read
    "cmpdesign/products/laser/coupon/stated_response.py": {
        "Image.open"
    },  # of bytes that inputs/files.py read
    "cmpdesign/scene/parts/sensor.py": {"cv2.imdecode"},  # of a JPEG that it just made
    "cmpdesign/files/npz.py": {"np.load"},  # of a file that inputs/files.py opened
    "cmpdesign/files/locks.py": {"os.open"},  # to lock: nothing is read
    "cmpdesign/files/atomic.py": {"os.open", "open 'rb+'"},  # to flush to disk what it wrote
    "cmpdesign/tracking/sources/live.py": {"cv2.VideoCapture"},  # of a camera
    "cmpdesign/inputs/cameras/v4l2.py": {"os.open"},  # of a camera, to ask its driver
    "cmpdesign/inputs/videos.py": {"open 'r'"},  # of a video or a stream, by PyAV
    "cmpdesign/files/video_writer.py": {"cv2.VideoCapture"},  # of the video that it wrote
    "cmpdesign/tracking/sinks/csv_recovery.py": {"open 'r+b'"},  # to cut the text behind its last whole frame
    "cmpdesign/evaluation/journal.py": {
        "read_bytes",
        "open 'r+b'",
    },  # the installed code's digest; its own last line
    "cmpdesign/products/mold/processes.py": {"os.fdopen"},  # to write to a process
    "cmpdesign/evaluation/runner.py": {"json.loads"},  # of a text that it just made
    "cmpdesign/libraries.py": {"read_text", "json.loads"},  # what pip noted beside the installed package
}
READING = {
    "os.open", "os.fdopen", "tomllib.loads", "tomllib.load", "json.loads", "json.load", "cv2.imdecode", "cv2.imread",
    "cv2.VideoCapture", "np.load", "np.loadtxt", "np.genfromtxt", "np.fromfile", "Image.open", "io.open", "open",
}  # fmt: skip
READING_METHODS = {"read_text", "read_bytes"}


@cache
def calls(path: Path) -> list[ast.Call]:
    return [node for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]


def prints(root: Path) -> list[str]:
    """Printing outside of terminal.py: by a call, or through the name of a stream."""
    found = []
    for path in (path for package in PACKAGES for path in python_files(root / package)):
        if str(path.relative_to(root)) in PRINTS:
            continue
        functions = [ast.unparse(call.func) for call in calls(path)]
        found += [
            f"{path}: {text}"
            for text in functions
            if text.rpartition(".")[2] in PRINTING and not CONSOLE.fullmatch(text)
        ]
        found += [
            f"{path}:{node.lineno}: sys.{node.attr}"
            for node in ast.walk(parsed(path))
            if isinstance(node, ast.Attribute) and node.attr in STREAMS and ast.unparse(node.value) == "sys"
        ]
    return found


def reads(root: Path) -> list[str]:
    found = []
    for path in (path for package in PACKAGES for path in python_files(root / package)):
        allowed = READS.get(str(path.relative_to(root)), set())
        found += [
            f"{path}: {text}" for call in calls(path) if (text := reading(call)) and text not in allowed
        ]
    return found


def reading(call: ast.Call) -> str:
    """The reading call, or "" for another; ``path.open`` counts by its mode."""
    text = ast.unparse(call.func)
    method = text.rpartition(".")[2]
    if text in READING:
        return text
    if method in READING_METHODS and isinstance(call.func, ast.Attribute):
        return method
    if method == "open" and isinstance(call.func, ast.Attribute):
        modes = [*call.args[:1], *(word.value for word in call.keywords if word.arg == "mode")]
        mode = next((m.value for m in modes if isinstance(m, ast.Constant) and isinstance(m.value, str)), "r")
        is_archive = len(call.args) > 1  # of a member of an archive that is being written
        return f"open {mode!r}" if ("r" in mode or "+" in mode) and not is_archive else ""
    return ""


def test_one_module_prints() -> None:
    assert prints(ROOT) == []


def test_few_modules_open_files() -> None:
    assert reads(ROOT) == []


def test_every_exception_is_needed() -> None:
    for name, allowed in READS.items():
        assert {reading(call) for call in calls(ROOT / name)} >= allowed, name


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        (prints, "print('a')"),
        (prints, "import typer\ntyper.echo('a')"),
        (prints, "import sys\nsys.stdout.write('a')"),
        (prints, "from rich.console import Console\nConsole().print('a')"),
        (prints, "console(stderr=True).print(Text('a'))"),
        (reads, "path.read_text()"),
        (reads, "import numpy as np\nnp.load('a.npy')"),
        (reads, "open('a')"),
        (reads, "path.open()"),
        (reads, "path.open('rb')"),
        (reads, "import tomllib\ntomllib.loads('a')"),
    ],
)
def test_the_rules_can_fail(rule: object, text: str, tmp_path: Path) -> None:
    for package in PACKAGES:
        (tmp_path / package).mkdir()
    (tmp_path / "cmpdesign" / "a.py").write_text("console().print('a')\npath.open('wb')\n", encoding="utf-8")
    assert rule(tmp_path) == []  # type: ignore[operator]
    (tmp_path / "cmpdesign" / "b.py").write_text(text, encoding="utf-8")
    assert rule(tmp_path)  # type: ignore[operator]
