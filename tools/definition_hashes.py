"""Hashes of every top-level definition's syntax tree, sorted: equal before and after a move of code.

    .venv/bin/python tools/definition_hashes.py > before.txt     # then move code, and compare
    .venv/bin/python tools/definition_hashes.py | diff before.txt -

The place of a definition and the modules of its imports do not count: a move changes only these. Functions,
classes and assignments count, without comments and with docstrings.
"""

from __future__ import annotations

import ast
import hashlib
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = ("extractor", "cmpdesign", "benchmarks")


class WithoutModules(ast.NodeTransformer):
    """Removes imports within a definition, and keeps the imported names."""

    def __init__(self) -> None:
        self.brought: set[str] = set()

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        self.brought |= {alias.asname or alias.name for alias in node.names}


def definitions(path: Path) -> list[str]:
    """One line for every top-level definition of a file."""
    lines = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = node.name
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            name = ",".join(ast.unparse(target) for target in targets)
        else:
            continue
        without = WithoutModules()
        tree = ast.dump(without.visit(node)) + ",".join(sorted(without.brought))
        lines.append(f"{hashlib.sha256(tree.encode()).hexdigest()[:24]}  {name}")
    return lines


if __name__ == "__main__":
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    print(*sorted(line for path in files for line in definitions(path)), sep="\n")
