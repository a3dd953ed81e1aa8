"""The structure of the loops in C++: rooms in the order of the Python packages, no circles, short functions.

Read as text, without a compiler.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.house.cpp_text import definitions
from tests.house.test_structure import MAX_FUNCTION_LINES, MAX_LINES, MAX_PARAMETERS, ROOMS, ROOT

FIRST, LAST = "base", "module"  # what all rooms stand on, and what knows all rooms
INCLUDE = re.compile(r'^#include "(.+\.hpp)"$', re.MULTILINE)
Rule = Callable[[Path], list[str]]


def sources(root: Path, package: str = "extractor") -> dict[str, Path]:
    """The C++ files by their place below ``native``."""
    native = root / package / "native"
    return {
        str(path.relative_to(native)): path
        for path in sorted(native.rglob("*"))
        if path.suffix in (".hpp", ".cpp")
    }


def inner_includes(root: Path) -> Iterator[tuple[str, str]]:
    """(including file, included header)."""
    for name, path in sources(root).items():
        for found in INCLUDE.findall(path.read_text(encoding="utf-8")):
            yield name, found if "/" in found else f"{name.rpartition('/')[0]}/{found}"


def upward_includes(root: Path) -> list[str]:
    order = [FIRST, *ROOMS["extractor"].split(), LAST]
    rooms = {name: re.split(r"[/.]", name)[0] for pair in inner_includes(root) for name in pair}
    pairs = {(rooms[one], rooms[other], one, other) for one, other in inner_includes(root)}
    return sorted(
        f"{one}: {other}, which stands later"
        for room, below, one, other in pairs
        if below not in order or order.index(below) > order.index(room)
    )


def circles(root: Path) -> list[str]:
    """Circles of headers or of folders within one folder."""
    graphs: dict[str, dict[str, set[str]]] = {}
    for one, other in inner_includes(root):
        ours, theirs = one.split("/"), other.split("/")
        depth = next(k for k, (a, b) in enumerate(zip(ours, theirs, strict=False)) if a != b)
        graphs.setdefault("/".join(ours[:depth]), {}).setdefault(ours[depth], set()).add(theirs[depth])
    found = []
    for folder, graph in graphs.items():
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            found.append(f"native/{folder}: {' <- '.join(error.args[1])}")
    return found


def long_files_and_functions(root: Path) -> list[str]:
    found = []
    for package in ("extractor", "cmpdesign"):
        for name, path in sources(root, package).items():
            text = path.read_text(encoding="utf-8")
            count = text.count("\n")
            found += [f"{name}: {count} lines"] if count >= MAX_LINES else []
            found += [
                f"{name}: {each.name} has {each.lines} lines"
                for each in definitions(text)
                if each.lines >= MAX_FUNCTION_LINES
            ]
    return found


def many_parameters(root: Path) -> list[str]:
    return [
        f"{name}: {each.name} has {each.parameters} parameters"
        for package in ("extractor", "cmpdesign")
        for name, path in sources(root, package).items()
        for each in definitions(path.read_text(encoding="utf-8"))
        if each.parameters > MAX_PARAMETERS
    ]


RULES: tuple[Rule, ...] = (upward_includes, circles, long_files_and_functions, many_parameters)
GOOD = {
    "base/array.hpp": "struct Array {};\n",
    "cells/grow.hpp": '#include "base/array.hpp"\nvoid grow(View<int, 2> a, int b);\n',
    "refine/solve/solve.cpp": '#include "refine/solve/solve.hpp"\n\nint sum(int a) {\n  return a;\n}\n',
    "refine/solve/solve.hpp": '#include "cells/grow.hpp"\n',
    "refine/step.hpp": '#include "refine/solve/solve.hpp"\n',
    "module.cpp": '#include "base/array.hpp"\n',
}
BAD: tuple[tuple[Rule, dict[str, str], str], ...] = (
    (upward_includes, {"cells/grow.hpp": '#include "refine/step.hpp"\n'}, "cells/grow.hpp: refine/step"),
    (circles, {"refine/solve/solve.hpp": '#include "refine/step.hpp"\n'}, "native/refine: "),
    (long_files_and_functions, {"cells/grow.cpp": "\n" * 500}, "500 lines"),
    (long_files_and_functions, {"cells/grow.cpp": "int f(int a) {\n" + "  a;\n" * 78 + "}\n"}, "f has 80"),
    (
        many_parameters,
        {
            "cells/grow.cpp": "A<T, 2> f(B<T, 1> a, int b, int c, int d, int e,\n int f, int g, int h, int i) {\n}\n"
        },
        "f has 9",
    ),
)


def written(root: Path, changes: dict[str, str]) -> Path:
    for name, text in {**GOOD, **changes}.items():
        path = root / "extractor" / "native" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_loops_keep_the_rule(rule: Rule) -> None:
    assert sum(1 for path in sources(ROOT).values() for _ in definitions(path.read_text("utf-8"))) > 500
    assert rule(ROOT) == []


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_good_loops_keep_every_rule(rule: Rule, tmp_path: Path) -> None:
    assert rule(written(tmp_path, {})) == []


@pytest.mark.parametrize(("rule", "changes", "said"), BAD)
def test_bad_loops_break_the_rule(rule: Rule, changes: dict[str, str], said: str, tmp_path: Path) -> None:
    found = rule(written(tmp_path, changes))
    assert found and said in found[0], found
