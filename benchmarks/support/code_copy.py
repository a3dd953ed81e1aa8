"""Copies of the code with a changed text, in which what was compiled before stays valid.

Compiled functions are cached by file, size and time of modification. A copy keeps these times. In it, the caches of the
changed module and of all modules that import that one are removed: code of the changed module is compiled into theirs.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("extractor", "cmpdesign")


def path_of(module: str, root: Path) -> Path:
    """The file of a dotted module below ``root``."""
    path = root / module.replace(".", "/")
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def users(module: str, root: Path) -> set[str]:
    """The module and all modules of ``PACKAGES`` below ``root`` that import it, directly or not."""
    texts = {
        ".".join(path.relative_to(root).with_suffix("").parts): path.read_text(encoding="utf-8")
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
    }
    found, new = set(), {module}
    while new:
        found |= new
        imports = [
            rf"from {re.escape(name)} import|from {re.escape(package)} import .*\b{leaf}\b"
            for name in new
            for package, _, leaf in [name.rpartition(".")]
        ]
        word = re.compile("|".join(imports))
        new = {other for other, text in texts.items() if word.search(text)} - found
    return found


def remove_caches(module: str, root: Path) -> None:
    """Remove the compiled functions of the module and of all that import it."""
    for user in users(module, root):
        source = path_of(user, root)
        for cache in (source.parent / "__pycache__").glob(f"{source.stem}.*.nb[ic]"):
            cache.unlink()


def copy_package(package: str, root: Path) -> None:
    """Copy a package of this checkout, with its caches, into the folder ``root``."""
    shutil.copytree(ROOT / package, root / package)


def replace_text(module: str, old: str, new: str, root: Path) -> None:
    """Replace a text of the module below ``root``, and remove the caches that this makes invalid.

    Raises:
        ValueError: the text does not occur exactly once.
    """
    path = path_of(module, root)
    text = path.read_text(encoding="utf-8")
    if text.count(old) != 1:
        raise ValueError(f"{module}: the text occurs {text.count(old)} times, not once: {old!r}")
    path.write_text(text.replace(old, new), encoding="utf-8")
    remove_caches(module, root)
