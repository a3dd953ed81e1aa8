"""Every number of a ``Limits`` record says where it comes from: derived, published, measured, or chosen.

A record stands in the language that decides by it: in Python with a docstring, in C++ with a comment at each number.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.suites.ablation.rules import BY_NAME
from tests.house.source_trees import parsed, python_files

ROOT = Path(__file__).parents[2]
SOURCE = re.compile(r"\b(Derived|Published|Measured|Chosen)\b")
RECORDS = ("Limits", "MisfitRule", "WhiteCellPoints")  # types of fields that explain their own numbers
STRUCT = re.compile(r"^struct (\w+Limits) \{\n(.*?)^\};", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<!\.)\b(\w+) = ")
ENTRY = re.compile(r"^        (\w+(?:, \w+)*):", re.MULTILINE)


class Entry(NamedTuple):
    """A number of a record and what the docstring says of it; empty where nothing."""

    path: Path
    record: str
    field: str
    text: str

    @property
    def name(self) -> str:
        return f"{self.path.name} {self.record}.{self.field}"


def entries(root: Path) -> Iterator[Entry]:
    for path in python_files(root / "extractor"):
        for node in parsed(path).body:
            if isinstance(node, ast.ClassDef) and node.name.endswith("Limits"):
                texts = _texts(ast.get_docstring(node, clean=False) or "")
                yield from (
                    Entry(path, node.name, field, texts.get(field, "")) for field in _numbers_of(node)
                )


def entries_in_cpp(root: Path) -> Iterator[Entry]:
    """The numbers with a default in C++; the comment before a line or at its end is the text of all its numbers."""
    for path in sorted((root / "extractor" / "native").rglob("*.hpp")):
        for record, body in STRUCT.findall(path.read_text(encoding="utf-8")):
            text = ""
            for line in body.splitlines():
                code, _, comment = line.strip().partition("//")
                text += " " + comment.strip()
                if not code:
                    continue
                if re.match(r"  \S", line):  # not within a function
                    yield from (Entry(path, record, name, text) for name in NUMBER.findall(code))
                text = ""


def every_entry(root: Path) -> Iterator[Entry]:
    yield from entries(root)
    yield from entries_in_cpp(root)


def _numbers_of(record: ast.ClassDef) -> Iterator[str]:
    for node in record.body:
        if isinstance(node, ast.AnnAssign) and not ast.unparse(node.annotation).endswith(RECORDS):
            yield ast.unparse(node.target)


def _texts(docstring: str) -> dict[str, str]:
    """The text of each name in a list of attributes; names before one colon share it."""
    _, _, listed = docstring.partition("Attributes:\n")
    parts = ENTRY.split(listed)[1:]
    pairs = zip(parts[::2], parts[1::2], strict=True)
    return {name: " ".join(text.split()) for names, text in pairs for name in names.split(", ")}


def numbers_without_a_source(root: Path) -> list[str]:
    return [each.name for each in every_entry(root) if not SOURCE.search(each.text)]


def unknown_measurements(root: Path) -> list[str]:
    found = []
    for each in every_entry(root):
        rules = [rule for rule in re.findall(r'rule "([^"]+)"', each.text) if rule not in BY_NAME]
        modules = [name for name in re.findall(r"python -m ([\w.]+)", each.text) if find_spec(name) is None]
        found += [f"{each.name}: {name}" for name in (*rules, *modules)]
    return found


@pytest.mark.parametrize("rule", [numbers_without_a_source, unknown_measurements])
def test_every_limit_names_its_source(rule: Callable[[Path], list[str]]) -> None:
    assert len(list(entries(ROOT))) > 10 and len(list(entries_in_cpp(ROOT))) > 150
    assert not rule(ROOT)


def test_a_limit_without_a_source_or_with_an_unknown_one_is_found(tmp_path: Path) -> None:
    (tmp_path / "extractor").mkdir()
    (tmp_path / "extractor" / "stage.py").write_text(
        '''
class StageLimits(NamedTuple):
    """Limits.

    Attributes:
        least, most: px, of a cell. Chosen.
        share: of cells
            in view.
        turn: rad. Measured: rule "no such rule".
        wait: frames. Measured: `python -m benchmarks.nothing`.
        other: of a stage.
    """

    least: float = 1.0
    most: float = 2.0
    share: float = 0.5
    turn: float = 0.1
    wait: int = 3
    absent: int = 2
    other: OtherLimits = LIMITS
''',
        encoding="utf-8",
    )
    (tmp_path / "extractor" / "native").mkdir()
    (tmp_path / "extractor" / "native" / "stage.hpp").write_text(
        """
// Limits.
struct LoopLimits {
  // px, of a
  // cell. Chosen.
  double least = 1.0, most = 2.0;
  double share = 0.5;  // of cells in view.
  Index rounds = 3;  // Measured: rule "no rule".
  OtherLimits other;
};
""",
        encoding="utf-8",
    )
    assert numbers_without_a_source(tmp_path) == [
        "stage.py StageLimits.share",
        "stage.py StageLimits.absent",
        "stage.hpp LoopLimits.share",
    ]
    assert unknown_measurements(tmp_path) == [
        "stage.py StageLimits.turn: no such rule",
        "stage.py StageLimits.wait: benchmarks.nothing",
        "stage.hpp LoopLimits.rounds: no rule",
    ]
