"""Source code for the tests of its rules: files, imports and functions, read without execution."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

Function = ast.FunctionDef | ast.AsyncFunctionDef


class Import(NamedTuple):
    """One name that a file imports: ``from module import name``; ``name`` is empty for ``import module``."""

    module: str
    name: str
    line: int


class Tree(NamedTuple):
    """The Python files of a package by their module's name; a package's own file has the package's name."""

    package: str
    files: dict[str, Path]

    def module_of(self, imported: Import) -> str | None:
        """The package's module that an import loads; None for others."""
        whole = f"{imported.module}.{imported.name}"
        return next((name for name in (whole, imported.module) if name in self.files), None)


def tree_of(root: Path, package: str) -> Tree:
    files = {}
    for path in python_files(root / package):
        parts = path.relative_to(root).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return Tree(package, files)


def python_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*.py") if "__pycache__" not in path.parts)


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imports_of(path: Path, module: str) -> Iterator[Import]:
    """Wherever in the file, in functions and for type checkers, too; relative ones by their whole name."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, "", node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            yield from (Import(source, alias.name, node.lineno) for alias in node.names)


def functions_of(path: Path) -> Iterator[Function]:
    return (node for node in ast.walk(parsed(path)) if isinstance(node, Function))


def defined_in(path: Path) -> set[str]:
    """The names that a file gives a meaning itself, at its top."""
    names = set()
    for node in parsed(path).body:
        if isinstance(node, Function | ast.ClassDef):
            names.add(node.name)
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return names
