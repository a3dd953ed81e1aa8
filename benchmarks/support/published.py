"""Measured figures of the documentation: JSON files in docs/measured, and blocks of pages written from these.

A block of a page stands between ``<!-- NAME: written by make bench -->`` and ``<!-- end of NAME -->``. The text
between these lines is replaced; all other text is kept.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.files.atomic import write_file

ROOT = Path(__file__).resolve().parent.parent.parent
MEASURED_FOLDER = ROOT / "docs" / "measured"
BLOCK_BEGIN, BLOCK_END = "<!-- {}: written by make bench -->", "<!-- end of {} -->"


def replace_blocks(text: str, blocks: Mapping[str, str]) -> str:
    """The page with the text of its blocks replaced.

    Raises:
        ValueError: a block has no end, or begins twice.
    """
    for name, lines in blocks.items():
        begin, end = BLOCK_BEGIN.format(name), BLOCK_END.format(name)
        if begin not in text:
            continue
        before, _, rest = text.partition(begin)
        _, ends, after = rest.partition(end)
        if not ends:
            raise ValueError(f"the block {name} has no end; write {end!r} at its end")
        if begin in after:
            raise ValueError(f"the block {name} occurs twice; remove one of them")
        text = f"{before}{begin}\n\n{lines.strip()}\n\n{end}{after}"
    return text


def updated_pages(blocks: Mapping[str, str]) -> dict[Path, str]:
    """README and the pages of docs/ with one of the blocks: path -> text with replaced blocks."""
    found = {}
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        text = path.read_text(encoding="utf-8")
        if any(BLOCK_BEGIN.format(name) in text for name in blocks):
            found[path] = replace_blocks(text, blocks)
    return found


def write_published(name: str, results: Mapping[str, Any], blocks: Mapping[str, str]) -> list[Path]:
    """Write docs/measured/NAME.json and the blocks of all pages. Returns the written files."""
    from benchmarks.support.machine import machine_conditions

    path = MEASURED_FOLDER / f"{name}.json"
    text = json.dumps({"conditions": machine_conditions(), **results}, indent=1, sort_keys=True) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, text.encode())
    written = [path]
    for page, new in updated_pages(blocks).items():
        if new != page.read_text(encoding="utf-8"):
            write_file(page, new.encode())
            written.append(page)
    return written


def read_measured(name: str) -> dict[str, Any]:
    """The content of docs/measured/NAME.json."""
    found = json.loads((MEASURED_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return dict(found)
