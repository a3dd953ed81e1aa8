"""docs/reference/reasons.md: what the reader says of a picture, a marker, a frame and a point, from its own enums."""

from __future__ import annotations

import ast
import inspect
from enum import Enum, StrEnum

from extractor import FrameStatus, Origin, PointReason, Quality, Reason, StartKind, Status, VirtualStatus

HEAD = """# Reasons, statuses and hints

<!-- written by python -m tools.figures -->

A poor picture raises no exception: the reader returns the markers that it found, a reason and hints. `verify`, `track`
and `reconstruct` print the same texts. [When numbering fails](../how-to/numbering-fails.md) has a picture of each.

## Reasons

`Markers.reason`, in JSON and tables the value. It is None when all went well.

"""
HINTS = """
## Hints

`Markers.quality.hints`. A hint names a property of the picture that limits the result, its value and the limit.
The values below are examples.

"""
# One picture that has everything against it.
POOR = Quality(
    blur_px=2.4,
    noise=21.0,
    contrast=12.0,
    weakest_inks=("green", "blue"),
    clipping=0.31,
    evenness=0.08,
    edge_px=6.5,
)
OTHERS: dict[str, tuple[type[Enum], str]] = {
    "Statuses of markers": (Status, "`Markers.status`, as numbers."),
    "Statuses of virtual markers": (VirtualStatus, "`Markers.virtual_status`, as numbers."),
    "Origins": (Origin, "`Markers.origin`: the evidence that determines the start of the numbering."),
    "Statuses of frames": (FrameStatus, "`Tracked.status`; `frame_status` in tables."),
    "Starts of frames": (StartKind, "`Tracked.start`; `start` in tables."),
    "Reasons of points in space": (PointReason, "Why a point of a `Shape` is unknown."),
}


def page() -> str:
    """The text of the page."""
    rows = ["| `Reason` | value | means, and what to do |", "|---|---|---|"]
    rows += [f"| `{reason.name}` | `{reason}` | {reason.text} |" for reason in Reason]
    parts = [HEAD + "\n".join(rows), HINTS + "\n".join(f"- {hint}" for hint in POOR.hints)]
    parts += [f"## {title}\n\n{words}\n\n{_table(kind)}" for title, (kind, words) in OTHERS.items()]
    return "\n".join(part.strip() + "\n" for part in parts)


def _table(kind: type[Enum]) -> str:
    notes = _notes(kind)
    rows = [f"| `{kind.__name__}` | value | |", "|---|---|---|"]
    for each in kind:
        value = str(each.value) if issubclass(kind, StrEnum) else str(int(each.value))
        rows.append(f"| `{each.name}` | `{value}` | {notes[each.name].replace('``', '`')} |")
    return "\n".join(rows)


def _notes(kind: type[Enum]) -> dict[str, str]:
    """Name -> the comment behind it in the source."""
    lines = inspect.getsource(kind).splitlines()
    tree = ast.parse("\n".join(lines)).body[0]
    assert isinstance(tree, ast.ClassDef)
    found = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            comments = [line.partition("  # ")[2] for line in lines[node.lineno - 1 : node.end_lineno]]
            found[node.targets[0].id] = " ".join(filter(None, comments))
    return found
