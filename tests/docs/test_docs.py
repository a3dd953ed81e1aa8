"""The documentation: every command and snippet is run, every picture drawn again, every link followed.

In the Markdown files, fenced blocks are run in order, page by page, in a folder of their own:

* ``console``: lines that start with "$ " are commands, the lines below them what they print. A command that ends
  with "# exit code N" must end so; any other must end with 0. Without lines below, only the exit code counts;
  other comments are dropped.
* ``python``: run with the names of the blocks before; a ``text`` block right after it is what it prints.
* ``toml NAME``: becomes the file NAME.

In a table whose first column is "you see", what stands in that column as code is printed by a command of the page.

Printed and documented texts must be equal, but for these: blanks at a line's end; a line "..." stands for any
lines; a number before " ms" may be any; of other decimals, the last digit may differ by 2.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from cmpdesign import demo
from cmpdesign.cli import app
from cmpdesign.contact.objects.heightmap import MAX_HEIGHTS
from cmpdesign.design.design import Design
from cmpdesign.design.templates import templates
from cmpdesign.inputs import documents
from cmpdesign.inputs import files as inputs
from cmpdesign.inputs import names as lines
from cmpdesign.inputs.texts import MAX_LINE_LETTERS
from cmpdesign.patterns import registered_patterns
from tests.docs.stand_ins import make_stand_in
from tools.figures import everything, fields

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TUTORIALS = ROOT / "docs" / "tutorials" / "README.md"
IMAGES = ROOT / "docs" / "images"
FENCE = re.compile(r"^```(\w+)(?: ([\w.]+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DECIMAL = re.compile(r"-?\d+\.\d+")
FREE_MS = re.compile(r"\d+(\.\d+)? ms")
COLUMNS = "120"
SLOW_PAGES = {"cast-pad", "compare-designs", "evaluation"}


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the file name after it, its text, and the output that follows it."""

    language: str
    name: str
    text: str
    output: str | None


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    found = list(FENCE.finditer(text))
    kept = []
    for match, following in pairwise([*found, None]):
        assert match
        output = None
        if following and following[1] == "text" and not text[match.end() : following.start()].strip():
            output = following[3]
        if match[1] != "text":
            kept.append(Block(match[1], match[2] or "", match[3], output))
    return kept


def differs(printed: str, documented: str) -> str | None:
    """None if the texts are equal by the rules above; else the first different line."""
    lines = [line.rstrip() for line in printed.rstrip().splitlines()]
    wanted = [line.rstrip() for line in documented.rstrip().splitlines()]
    while wanted:
        line = wanted.pop(0)
        if line == "...":
            while lines and not (wanted and same_line(lines[0], wanted[0])):
                lines.pop(0)
        elif not lines or not same_line(lines.pop(0), line):
            return f"documented {line!r} in\n{documented}\nprinted\n{printed}"
    return f"documented nothing more, printed {lines[0]!r}" if lines else None


def same_line(printed: str, documented: str) -> bool:
    printed, documented = FREE_MS.sub("# ms", printed), FREE_MS.sub("# ms", documented)
    if DECIMAL.sub("#", printed) != DECIMAL.sub("#", documented):
        return False
    pairs = zip(DECIMAL.findall(printed), DECIMAL.findall(documented), strict=True)
    return all(near(one, other) for one, other in pairs)


def near(one: str, other: str) -> bool:
    places = len(other.partition(".")[2])
    return len(one.partition(".")[2]) == places and abs(float(one) - float(other)) <= 2.001 * 10.0**-places


def run_console(text: str) -> str:
    everything_printed = ""
    for command, output in commands(text):
        line, _, comment = command.partition("    # ")
        wanted = int(comment.removeprefix("exit code ")) if comment.startswith("exit code ") else 0
        printed, code = run_command(shlex.split(line))
        assert code == wanted, f"{line}: exit code {code}\n{printed}"
        if output:
            assert differs(printed, output) is None, differs(printed, output)
        everything_printed += printed
    return everything_printed


def quoted_lines(page: Path) -> list[str]:
    """The quotations in the column "you see" of a page's tables."""
    tables = re.findall(
        r"^\| you see \|.*\n\|[-|]+\|\n((?:\|.*\n)+)", page.read_text(encoding="utf-8"), re.MULTILINE
    )
    cells = [row.split(" | ")[0] for table in tables for row in table.splitlines()]
    return [quote for cell in cells for quote in re.findall(r"`([^`]+)`", cell)]


QUICK_BENCHMARKS = {"benchmarks.damage"}


def commands(text: str) -> Iterator[tuple[str, str]]:
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield command, output


def run_command(words: list[str]) -> tuple[str, int]:
    """The printed text of a command, and its exit code. ``make`` targets must exist; the demo is run as make runs
    it.
    """
    if words[0] == "cat":
        return Path(words[1]).read_text(encoding="utf-8"), 0
    if words[0] == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        recipe = re.search(rf"^{words[1]}:.*(?:\n\t(.*))?$", makefile, re.MULTILINE)
        assert recipe, f"the Makefile has no target {words[1]}"
        if words[1] == "demo":
            assert recipe[1].endswith("-m cmpdesign.demo")
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                code = demo.main()
            return printed.getvalue(), code
        return "", 0
    if words[:2] == ["python", "-m"]:
        assert words[2] in QUICK_BENCHMARKS, f"{words[2]} takes too long for a command that the docs show"
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            code = importlib.import_module(words[2]).main(words[3:])
        return printed.getvalue(), code
    assert words[0] == "cmpdesign", words
    make_stand_in(words)
    result = CliRunner().invoke(app, words[1:])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.output, result.exit_code


def run_python(block: Block, names: dict[str, Any], page: str) -> None:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(block.text, page, "exec"), names)
    assert differs(printed.getvalue(), block.output or "") is None, differs(
        printed.getvalue(), block.output or ""
    )


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=pytest.mark.slow if page.stem in SLOW_PAGES else ()) for page in PAGES],
    ids=lambda page: "tutorials" if page == TUTORIALS else page.stem,
)
def test_every_command_and_snippet_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", COLUMNS)
    names: dict[str, Any] = {}
    printed = ""
    for block in blocks(page):
        if block.language == "console":
            printed += run_console(block.text)
        elif block.language == "python":
            run_python(block, names, page.name)
        else:
            assert block.language == "toml" and block.name, f"{page.name}: a block of {block.language}"
            Path(block.name).write_text(block.text, encoding="utf-8")
    names.clear()  # closes the files of snippets; Python 3.13 warns of files that the garbage collector closes
    assert [quote for quote in quoted_lines(page) if quote not in printed] == []


def test_every_path_on_the_pages_exists() -> None:
    """Of the pages of docs/ only paths of sources: reliability.md names tests by their path below tests/."""
    map_page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    paths = re.findall(r"`((?:extractor|cmpdesign|benchmarks|tests|tools|docs)/[\w/.]*)`", map_page)
    assert len(paths) > 25
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        paths += re.findall(
            r"`((?:extractor|cmpdesign|benchmarks|tests|templates|examples)/[\w/]+\.\w+)`", text
        )
    gone = [path for path in paths if not (ROOT / path).exists() and not (ROOT / "tests" / path).exists()]
    assert gone == []


@pytest.mark.parametrize("name", ["reference/reliability.md", "explanation/hard-cases.md"])
def test_every_named_test_exists(name: str) -> None:
    page = (ROOT / "docs" / name).read_text(encoding="utf-8")
    named = re.findall(r"`((?:\w+/)+test_\w+)(?:\.py)?(?:::(test_\w+))?`", page)
    assert len(named) > 15
    for file, test in named:
        text = (ROOT / "tests" / f"{file}.py").read_text(encoding="utf-8")
        assert not test or f"def {test}(" in text, (file, test)


def test_stated_limits_hold() -> None:
    page = (ROOT / "docs" / "reference" / "reliability.md").read_text(encoding="utf-8")
    for text, limit in (
        ("16 MiB", inputs.MAX_TEXT_BYTES == 16 << 20),
        ("250 megapixels", inputs.MAX_PIXELS == 250_000_000),
        ("40 levels, numbers of 300 digits", (documents.MAX_LEVELS, documents.MAX_DIGITS) == (40, 300)),
        ("100; 1000 characters", (lines.MAX_NAME_LETTERS, lines.MAX_LINE_LETTERS) == (100, 1000)),
        ("at most 1000 characters", MAX_LINE_LETTERS == 1000),
        ("25,000,000 heights", MAX_HEIGHTS == 25_000_000),
    ):
        assert limit and text in page, text


def test_the_comparison_can_fail() -> None:
    assert differs("a 1.23 px, 5.0 ms\n", "a 1.25 px, 99 ms\n") is None
    assert differs("a\nb\nc\nd\n", "a\n...\nd\n") is None
    for printed, documented in (
        ("1.23", "1.26"),
        ("1.23", "1.230"),
        ("331 markers", "332 markers"),
        ("a\nb", "a"),
        ("a", "a\nb"),
        ("a\nb\nc", "a\n...\nd"),
    ):
        assert differs(printed, documented) is not None, (printed, documented)


@pytest.fixture(scope="module")
def drawn() -> dict[str, bytes]:
    """All pictures, without the search for the smallest PNG, which changes no pixel."""
    encode = cv2.imencode
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cv2, "imencode", lambda suffix, *more: encode(suffix, *more[: 1 + (suffix != ".png")]))
        return everything.pictures()


def test_every_picture_is_what_its_script_draws(drawn: dict[str, bytes]) -> None:
    """SVG to the byte; PNG once blurred, as sub-pixel shifts of thin lines and fonts do not make another picture."""
    assert set(drawn) == {path.name for path in IMAGES.iterdir()}, "run python -m tools.figures"
    for name, data in drawn.items():
        committed = (IMAGES / name).read_bytes()
        if name.endswith(".svg"):
            assert data == committed, f"{name}: run python -m tools.figures"
            continue
        new, old = blurred(data), blurred(committed)
        assert new.shape == old.shape, f"{name}: run python -m tools.figures"
        assert np.abs(new - old).mean() < 1.0, f"{name}: run python -m tools.figures"


def blurred(png: bytes) -> np.ndarray[Any, np.dtype[np.float32]]:
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    return cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 3.0)


def test_pictures_are_small() -> None:
    sizes = {path.name: path.stat().st_size for path in IMAGES.iterdir()}
    assert sum(sizes.values()) < 3e6
    assert all(size < 3e5 for size in sizes.values()), sizes
    assert all(size < 2e5 for name, size in sizes.items() if name.startswith("stage-"))


def test_generated_pages_are_up_to_date() -> None:
    for path, text in everything.pages().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run python -m tools.figures"


def test_everything_registered_is_in_the_gallery(drawn: dict[str, bytes]) -> None:
    page = (ROOT / "docs" / "reference" / "gallery.md").read_text(encoding="utf-8")
    for kind, names in (("pattern", registered_patterns()), ("template", templates())):
        for name in names:
            assert f"\n### {name}\n" in page
            assert f"(../images/{kind}-{name}.png)" in page and f"{kind}-{name}.png" in drawn


def test_every_field_of_a_design_is_documented() -> None:
    named = re.findall(r"^\| `(\w+)` \|", fields.fields(), flags=re.MULTILINE)
    assert named == list(Design.model_fields)
    page = (ROOT / "docs" / "reference" / "design-files.md").read_text(encoding="utf-8")
    for name, model in fields.tables().items():
        named = re.findall(r"^\| `(\w+)` \|", fields.table(model), flags=re.MULTILINE)
        assert named == list(model.model_fields) and f"\n### {name}\n" in page


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"], ids=lambda p: p.stem
)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)]+)\)", text):
        if target.startswith("https://"):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.is_file(), target
        if anchor:
            assert anchor in anchors(path), target


def anchors(page: Path) -> set[str]:
    """The headings' anchors as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_picture_is_shown() -> None:
    shown = {
        Path(target).name
        for page in PAGES
        for target in re.findall(r"!\[[^]]+\]\(([^)]+)\)", page.read_text())
    }
    assert shown == {path.name for folder in (IMAGES, IMAGES.parent / "screens") for path in folder.iterdir()}
