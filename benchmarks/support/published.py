"""Measured figures that the documentation shows: a JSON file beside it, and blocks of pages written from that.

A block of a page stands between ``<!-- NAME: written by make bench -->`` and ``<!-- end of NAME -->``. What a page says
between these lines is replaced; the rest of it is prose.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.files.atomic import write_file

ROOT = Path(__file__).resolve().parent.parent.parent
MEASURED = ROOT / "docs" / "measured"
BEGIN, END = "<!-- {}: written by make bench -->", "<!-- end of {} -->"


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """The page with those of the blocks that it has written anew.

    Raises:
        ValueError: a block begins and does not end, or begins twice.
    """
    for name, lines in blocks.items():
        begin, end = BEGIN.format(name), END.format(name)
        if begin not in text:
            continue
        before, _, rest = text.partition(begin)
        _, ends, after = rest.partition(end)
        if not ends:
            raise ValueError(f"the block {name} has no end; put {end!r} where it shall end")
        if begin in after:
            raise ValueError(f"the block {name} stands there twice; remove one")
        text = f"{before}{begin}\n\n{lines.strip()}\n\n{end}{after}"
    return text


def pages_with(blocks: Mapping[str, str]) -> dict[Path, str]:
    """README and the pages of docs/ that have one of the blocks: path -> text with them written anew."""
    found = {}
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        text = path.read_text(encoding="utf-8")
        if any(BEGIN.format(name) in text for name in blocks):
            found[path] = filled(text, blocks)
    return found


def publish(name: str, results: Mapping[str, Any], blocks: Mapping[str, str]) -> list[Path]:
    """Write docs/measured/NAME.json and the blocks of all pages; what was written."""
    from benchmarks.support.machine import conditions

    path = MEASURED / f"{name}.json"
    text = json.dumps({"conditions": conditions(), **results}, indent=1, sort_keys=True) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, text.encode())
    written = [path]
    for page, new in pages_with(blocks).items():
        if new != page.read_text(encoding="utf-8"):
            write_file(page, new.encode())
            written.append(page)
    return written


def measured(name: str) -> dict[str, Any]:
    """What docs/measured/NAME.json holds."""
    found = json.loads((MEASURED / f"{name}.json").read_text(encoding="utf-8"))
    return dict(found)
