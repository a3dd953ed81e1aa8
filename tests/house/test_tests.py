"""The rules of the tests: tests use public names; a test of an internal function states the reason."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import extractor
from tests.house.source_trees import Import, imports_of, parsed, python_files

ROOT = Path(__file__).parents[2]
PACKAGES = ("extractor", "cmpdesign")
# What programs import; all else of the extractor is its inside.
PUBLIC = {f"extractor.{name}" for name in (*extractor.__all__, "draw", "__file__", "")}
REASON = "Inside:"
RECORD_MAKERS = {"lattice_of", "topology_of"}  # the layout's tables, which kernels of other rooms take
OF_NAMED_TUPLES = {"_replace", "_asdict", "_fields", "_make"}
PRIVATE = re.compile(r"_[A-Za-z]\w*(?<!_)")  # _repr_html_ and the like belong to notebooks
DOTTED = re.compile(rf"({'|'.join(PACKAGES)})(\.\w+)+")


class TestFile(NamedTuple):
    """A file of tests; ``room`` is that of the extractor whose inside it may test, or empty."""

    __test__ = False

    path: Path
    module: str
    room: str

    @property
    def reason(self) -> str:
        """The sentence with the reason for a test of an internal function."""
        lines = (ast.get_docstring(parsed(self.path)) or "").splitlines()
        found = [line.removeprefix(REASON).strip() for line in lines if line.startswith(REASON)]
        return found[0] if len(found) == 1 else ""


def test_files(root: Path) -> list[TestFile]:
    found = []
    for path in python_files(root / "tests"):
        if path == Path(__file__):
            continue  # it shows what breaks the rules
        parts = path.relative_to(root).with_suffix("").parts
        room = parts[2] if parts[:2] == ("tests", "extractor") and len(parts) == 4 else ""
        found.append(TestFile(path, ".".join(parts), room))
    return found


test_files.__test__ = False  # type: ignore[attr-defined]


def named_imports(file: TestFile) -> Iterator[Import]:
    """Imports of the packages; a module named in a string, as for a patch, counts as imported."""
    for each in imports_of(file.path, file.module):
        if each.module.partition(".")[0] in PACKAGES:
            yield each
    for node in ast.walk(parsed(file.path)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and DOTTED.fullmatch(node.value):
            module, _, name = node.value.rpartition(".")
            yield Import(module, name, node.lineno)


def private(name: str) -> bool:
    return any(PRIVATE.fullmatch(part) for part in name.split("."))


def looked_up(node: ast.AST) -> str:
    """The name of an attribute, but for those of the test's own classes; a word in a string."""
    if isinstance(node, ast.Attribute):
        return "" if isinstance(node.value, ast.Name) and node.value.id in ("self", "cls") else node.attr
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and PRIVATE.fullmatch(node.value):
        return node.value
    return ""


def private_names(root: Path) -> list[str]:
    """Imported, looked up in something that is not the test's own, or written in a string to be patched."""
    found = []
    for file in test_files(root):
        for each in named_imports(file):
            if private(each.name) or private(each.module):
                found.append(f"{file.module}:{each.line}: {each.module}.{each.name}")
        for node in ast.walk(parsed(file.path)):
            text = looked_up(node)
            if private(text) and text not in OF_NAMED_TUPLES:
                found.append(f"{file.module}:{node.lineno}: {text}")  # type: ignore[attr-defined]
    return found


def inner_imports(file: TestFile) -> list[Import]:
    """Imports of internal modules of the extractor."""
    every = (each for each in named_imports(file) if each.module.partition(".")[0] == "extractor")
    return [
        each
        for each in every
        if f"{each.module}.{each.name}" not in PUBLIC and each.module != "extractor.draw"
    ]


def imports_from_inside(root: Path) -> list[str]:
    """Imports of internal modules by tests outside of their folders, without a reason, or of another folder's
    functions.
    """
    found = []
    for file in test_files(root):
        for each in inner_imports(file):
            where = f"{file.module}:{each.line}: {each.module}.{each.name}"
            own = file.room and each.module.split(".")[1] == file.room
            record = each.name[:1].isupper() or each.name in RECORD_MAKERS
            if not file.room:
                found.append(f"{where}: only extractor and extractor.draw here")
            elif not file.reason:
                found.append(f'{where}: no line "{REASON} ..." says why')
            elif not (own or record):
                found.append(f"{where}: not of the room {file.room}")
    return found


def reasons_for_nothing(root: Path) -> list[str]:
    return [file.module for file in test_files(root) if file.reason and not inner_imports(file)]


RULES = (private_names, imports_from_inside, reasons_for_nothing)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_tests_keep_the_rule(rule: object) -> None:
    assert rule(ROOT) == []  # type: ignore[operator]


BEGIN = '"""A test.\n\nInside: an image shows it too late.\n"""\n'
CASES = (
    ("a", "from extractor import Extractor\nfrom extractor.draw import draw_markers\n", ""),
    ("a", "from cmpdesign.scene.drawing import render\nmonkeypatch.setattr(render, 'missing', 1)\n", ""),
    ("extractor/solve/a", BEGIN + "from extractor.solve.b import solved\nrecord._replace(x=1)\n", ""),
    (
        "extractor/solve/a",
        BEGIN + "from extractor.layout.c import Lattice, lattice_of\nimport extractor.solve.b\n",
        "",
    ),
    ("a", "from cmpdesign import scene\nscene.part._repr_svg_()\n", ""),
    ("a", "from cmpdesign.scene import _hidden\n", "cmpdesign.scene._hidden"),
    ("a", "from cmpdesign._inside import shown\n", "cmpdesign._inside.shown"),
    ("a", "from cmpdesign import scene\nscene.part._hidden()\n", ": _hidden"),
    ("a", "for name in ('_first', 'second'):\n    monkeypatch.setattr(where, name, 1)\n", ": _first"),
    ("a", "monkeypatch.setattr('cmpdesign.scene._hidden', 1)\n", "cmpdesign.scene._hidden"),
    ("a", "from extractor.solve.b import solved\n", "only extractor and extractor.draw"),
    ("a", "from extractor import solve\n", "only extractor and extractor.draw"),
    ("a", "def test():\n    import extractor.solve.b\n", "only extractor and extractor.draw"),
    ("a", "monkeypatch.setattr('extractor.solve.b.solved', 1)\n", "only extractor and extractor.draw"),
    ("extractor/a", BEGIN + "from extractor.solve.b import solved\n", "only extractor and extractor.draw"),
    ("extractor/solve/a", "from extractor.solve.b import solved\n", 'no line "Inside:'),
    ("extractor/solve/a", BEGIN + "from extractor.layout.c import moved\n", "not of the room solve"),
    ("extractor/solve/a", BEGIN + "from extractor import Extractor\n", "tests.extractor.solve.a"),
)


@pytest.mark.parametrize(("name", "text", "said"), CASES)
def test_the_rules_see_what_breaks_them(name: str, text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "tests" / f"{name}.py"
    path.parent.mkdir(parents=True)
    path.write_text(text, encoding="utf-8")
    found = [line for rule in RULES for line in rule(tmp_path)]
    assert bool(found) == bool(said) and said in "".join(found[:1]), found
