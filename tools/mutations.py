"""Break the code at random places, one at a time, and count how many of these faults the tests notice.

    .venv/bin/python tools/mutations.py --seed 1 --count 10
    .venv/bin/python tools/mutations.py --only extractor/layout/lattice.py:layer_of:0

A place is a sign (+ and -), a comparison (< and >=, == and !=), an index or a number (a whole number becomes one more,
another half as much again) in a function in Python or C++. The faults are made in a copy of the checkout. For a fault
in a loop of the reader the copy's native module is built anew; the loops of cmpdesign are not broken.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.suites.code_copy import PACKAGES, ROOT, CodeCopy, Replacement
from tests.house.cpp_text import definitions

SWAPPED: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Lt: ast.GtE, ast.GtE: ast.Lt,
    ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
}  # fmt: skip
SIGNS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Lt: "<", ast.GtE: ">=",
    ast.Gt: ">", ast.LtE: "<=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


# as the format of the sources writes them: operators between spaces, numbers for themselves
CPP_PLACE = re.compile(r"(?<= )(?:[+-]|<=|>=|==|!=|<|>)(?= )|(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.>])")
OPPOSITE = {"+": "-", "-": "+", "<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "=="}


class Place(NamedTuple):
    """A place that can be broken: the k-th of a function, in a file by its path in the checkout."""

    file: str
    function: str
    k: int

    def __str__(self) -> str:
        return f"{self.file}:{self.function}:{self.k}"


def functions(text: str) -> Iterator[ast.FunctionDef]:
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            yield node
        elif isinstance(node, ast.ClassDef):
            yield from (item for item in node.body if isinstance(item, ast.FunctionDef))


def breakable(function: ast.FunctionDef) -> list[ast.expr]:
    """The function's nodes that can be broken, in the order of its text."""
    nodes: list[ast.expr] = []
    for statement in function.body:
        for node in ast.walk(statement):
            swapped = isinstance(node, ast.BinOp) and type(node.op) in SWAPPED
            compared = isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPPED
            number = isinstance(node, ast.Constant) and type(node.value) in (int, float)
            if swapped or compared or number:
                nodes.append(node)  # type: ignore[arg-type]
    return sorted(nodes, key=lambda node: (node.lineno, node.col_offset, type(node).__name__))


def larger(number: float) -> str:
    return repr(number + 1 if isinstance(number, int) else number * 1.5 or 0.5)


def breakable_in_cpp(text: str, function: str) -> list[re.Match[str]]:
    """The places of all definitions of that name, outside comments."""
    return [
        match
        for each in definitions(text)
        if each.name == function
        for match in CPP_PLACE.finditer(text, each.start, each.end)
        if "//" not in text[text.rfind("\n", 0, match.start()) : match.start()]
    ]


def broken_cpp(text: str, place: Place) -> str:
    found = breakable_in_cpp(text, place.function)
    if place.k >= len(found):
        raise KeyError(str(place))
    match = found[place.k]
    new = OPPOSITE.get(match[0]) or larger(ast.literal_eval(match[0]))
    return text[: match.start()] + new + text[match.end() :]


def broken(text: str, place: Place) -> str:
    """The file's text with the place broken.

    Raises:
        KeyError: there is no such place.
    """
    if place.file.endswith(".cpp"):
        return broken_cpp(text, place)
    for function in functions(text):
        if function.name == place.function and place.k < len(breakable(function)):
            node = breakable(function)[place.k]
            break
    else:
        raise KeyError(str(place))
    lines = text.split("\n")
    if isinstance(node, ast.Constant):
        assert isinstance(node.value, int | float)
        new = larger(node.value)
        row = lines[node.lineno - 1].encode()
        lines[node.lineno - 1] = (row[: node.col_offset] + new.encode() + row[node.end_col_offset :]).decode()
        return "\n".join(lines)
    left = node.left  # type: ignore[attr-defined]
    operator = type(node.op if isinstance(node, ast.BinOp) else node.ops[0])  # type: ignore[attr-defined]
    at = left.end_lineno - 1
    while SIGNS[operator] not in lines[at][left.end_col_offset if at == left.end_lineno - 1 else 0 :]:
        at += 1
    start = left.end_col_offset if at == left.end_lineno - 1 else 0
    tail = lines[at][start:].replace(SIGNS[operator], SIGNS[SWAPPED[operator]], 1)
    lines[at] = lines[at][:start] + tail
    return "\n".join(lines)


def places(root: Path) -> list[Place]:
    """Every place of both packages, and of the loops of the reader."""
    found = []
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            file = str(path.relative_to(root))
            for function in functions(path.read_text(encoding="utf-8")):
                found += [Place(file, function.name, k) for k in range(len(breakable(function)))]
    for path in sorted((root / "extractor" / "native").rglob("*.cpp")):
        text, file = path.read_text(encoding="utf-8"), str(path.relative_to(root))
        for name in dict.fromkeys(each.name for each in definitions(text)):
            found += [Place(file, name, k) for k in range(len(breakable_in_cpp(text, name)))]
    return found


def notices(place: Place, copy: CodeCopy, limit_s: float) -> str:
    """The tests' result for one fault: "noticed by ..." or "not noticed"."""
    text = (copy.folder / place.file).read_text(encoding="utf-8")
    try:
        with copy.replaced([Replacement(place.file, text, broken(text, place))]):
            return tested(place, copy.folder, limit_s)
    except RuntimeError:
        return "noticed by the compiler"


def tested(place: Place, root: Path, limit_s: float) -> str:
    files = sorted((root / "tests").rglob("test_*.py"), key=lambda file: relevance(file, place, root))
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *map(str, files)]
    try:
        result = subprocess.run(
            command, cwd=root, capture_output=True, text=True, timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired:
        return f"not noticed in {limit_s:.0f} s"
    if result.returncode == 0:
        return "not noticed"
    said = [line for line in result.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return "noticed by " + (
        said[0].partition(" ")[2].partition(" - ")[0] if said else "the collection of tests"
    )


def relevance(file: Path, place: Place, root: Path) -> tuple[int, str]:
    """Tests that name the module come first, then those of the package, then the others."""
    text = file.read_text(encoding="utf-8")
    own = place.file.replace("/native/", "/").rpartition(".")[0].split("/")
    parts = set(own) & set(file.relative_to(root).with_suffix("").parts)
    by_package = f"import {own[0]}" in text or f"from {own[0]}" in text
    rank = 0 if ".".join(own) in text else 1 if len(parts) > 1 else 2 if by_package else 3
    return (rank, str(file))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--only", nargs="*", default=[], help="file:function:k")
    parser.add_argument("--limit-s", type=float, default=900)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "copy"
        left_out = shutil.ignore_patterns(".venv", ".git", "build", "dist", "out", "cmake", *PACKAGES)
        shutil.copytree(
            ROOT, folder, ignore=lambda at, names: left_out(at, names) if Path(at) == ROOT else []
        )
        copy = CodeCopy(folder)
        words = [word.split(":") for word in options.only]
        chosen = [Place(file, function, int(k)) for file, function, k in words]
        chosen = chosen or random.Random(options.seed).sample(places(folder), options.count)
        counts = 0
        for place in chosen:
            said = notices(place, copy, options.limit_s)
            counts += said.startswith("noticed")
            print(f"{place}  {said}", flush=True)
        print(f"{counts} of {len(chosen)} noticed")


if __name__ == "__main__":
    os.environ.pop("PYTHONPATH", None)
    # bytecode of a text that is changed twice within a second would be taken for valid
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    main()
