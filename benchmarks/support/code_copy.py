"""Copies of the code with changed texts, in which what was compiled before stays valid.

Compiled functions are cached by file, time of modification and size of the file, function and line. A copy keeps these.
A changed module keeps its time, and its size where the new text is not longer. So only the caches of changed
definitions and of what uses them, directly or not, have to be removed: their code is compiled into that of their users.
"""

from __future__ import annotations

import ast
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PACKAGES = ("extractor", "cmpdesign")
EVERYTHING = "*"  # the name that stands for all definitions of a module


class Definition(NamedTuple):
    """A function, class or constant at the top of a module (dotted)."""

    module: str
    name: str


def path_of(module: str, root: Path) -> Path:
    """The file of a dotted module below ``root``."""
    path = root / module.replace(".", "/")
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def copy_package(package: str, root: Path) -> None:
    """Copy a package of this checkout, with its caches, into the folder ``root``."""
    shutil.copytree(ROOT / package, root / package)


def replace_text(module: str, old: str, new: str, root: Path) -> None:
    """Replace a text of the module below ``root``, see ``replace_source``.

    Raises:
        ValueError: the text does not occur exactly once.
    """
    text = path_of(module, root).read_text(encoding="utf-8")
    if text.count(old) != 1:
        raise ValueError(f"{module}: the text occurs {text.count(old)} times, not once: {old!r}")
    replace_source(module, text.replace(old, new), root)


def replace_source(module: str, text: str, root: Path) -> None:
    """Give the module below ``root`` another text, and remove the caches that this makes invalid."""
    path = path_of(module, root)
    before, stat = path.read_text(encoding="utf-8"), path.stat()
    missing = stat.st_size - len(text.encode())
    if missing > 0 and before.count("\n") == text.count("\n"):
        text += "#" * missing
    changed = changed_names(before, text)
    stale = users({Definition(module, name) for name in changed}, root)  # by the graph before the change
    path.write_text(text, encoding="utf-8")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    stale |= users({Definition(module, name) for name in changed}, root)
    for cache in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        cache.unlink()  # valid by time and size, too
    for user in stale:
        source = path_of(user.module, root)
        for cache in (source.parent / "__pycache__").glob(f"{source.stem}.{user.name}[-.]*.nb[ic]"):
            cache.unlink()


def changed_names(before: str, after: str) -> set[str]:
    """The top-level names that are defined differently; ``EVERYTHING`` where other statements differ."""
    old, new = _dumps(before), _dumps(after)
    return {name for name in old.keys() | new.keys() if old.get(name) != new.get(name)}


def users(changed: set[Definition], root: Path) -> set[Definition]:
    """The changed definitions and all of ``PACKAGES`` below ``root`` that use one of them, directly or not."""
    texts = {
        ".".join(path.relative_to(root).with_suffix("").parts): path.read_text(encoding="utf-8")
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
    }
    uses = {user: used for module, text in texts.items() for user, used in _uses(module, text, texts)}
    whole = {each.module for each in changed if each.name == EVERYTHING}
    found: set[Definition] = set()
    new = set(changed) | {user for user in uses if user.module in whole}
    while new:
        found |= new
        of_modules = new | {Definition(each.module, EVERYTHING) for each in new}
        new = {user for user, used in uses.items() if not used.isdisjoint(of_modules)} - found
    return found


def _names(statement: ast.stmt) -> list[str]:
    """What a top-level statement defines; ``EVERYTHING`` for one that is no definition."""
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    if isinstance(statement, ast.Assign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        return [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
    return [EVERYTHING]


def _dumps(text: str) -> dict[str, str]:
    """The texts of a module's definitions without their places in the file."""
    found: dict[str, str] = {}
    for statement in ast.parse(text).body:
        for name in _names(statement):
            found[name] = found.get(name, "") + ast.dump(statement)
    return found


def _uses(module: str, text: str, texts: dict[str, str]) -> Iterator[tuple[Definition, set[Definition]]]:
    """Every definition of a module with what it uses; of an imported module it may use everything."""
    tree = ast.parse(text)
    meaning = {name: Definition(module, name) for node in tree.body for name in _names(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                meaning[alias.asname or alias.name] = (
                    Definition(inner, EVERYTHING) if inner in texts else Definition(node.module, alias.name)
                )
    for statement in tree.body:
        used = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}
        for name in _names(statement):
            yield Definition(module, name), {meaning[other] for other in used if other in meaning}
