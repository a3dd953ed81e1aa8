"""docs/reference/api.md: the public names of both packages, from their signatures and docstrings."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from types import ModuleType
from typing import Any, is_typeddict

WIDTH = 100  # letters of a signature on one line
SECTIONS = ("Args", "Attributes", "Keys", "Returns", "Raises", "Yields")
# Package -> heading -> folders and files of the names below it.
ROOMS = {
    "cmpdesign": {
        "designs and layouts": "designs making layouts proposal",
        "files, workshop and experiments": "layout files products workshop",
        "pictures": "pictures verifying plots",
        "sequences": "sequences tracking inputs",
        "sensors of a robot": "runtime",
        "calibration and force": "calibration force",
        "data sets": "datasets",
        "errors": "errors",
    },
    "extractor": {
        "reading one picture": "pipeline result quality layout types made",
        "following": "track",
        "measuring in space": "space",
        "force": "contact",
        "errors": "errors",
    },
}
HEAD = """# Python

<!-- written by python -m tools.figures -->

Most commands are one call of `cmpdesign`; `extractor` reads pictures and needs numpy and OpenCV alone.
[From Python](../how-to/python.md) shows how they are used together. `help(NAME)` prints what stands here.
"""
EXAMPLE = re.compile(r"^(>>> |\.\.\. )|  # doctest: .*$", re.MULTILINE)
ENTRY = re.compile(r"^(\*{0,2}[\w.*]+(?:, \*{0,2}\w+)*)(?: \([^)]*\))?: (.*)$")


def page() -> str:
    """The text of the page."""
    parts = [HEAD]
    for name in ("cmpdesign", "extractor"):
        module = import_module(name)
        names = [each for each in module.__all__ if not each.startswith("__")]
        for room, members in _rooms(module, names).items():
            parts.append(f"## {name}: {room}\n")
            parts.append(_overview(module, members))
            parts += [_entry(each, getattr(module, each)) for each in members]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def _rooms(module: ModuleType, names: list[str]) -> dict[str, list[str]]:
    """The names by what they are for, in the order of ``ROOMS``; a name of no room is an error of the table."""
    found: dict[str, list[str]] = {}
    for room, places in ROOMS[module.__name__].items():
        found[room] = [each for each in names if _place(module, getattr(module, each)) in places.split()]
    assert sorted(names) == sorted(each for members in found.values() for each in members)
    return {room: members for room, members in found.items() if members}


def _place(module: ModuleType, found: Any) -> str:
    """The folder or file of the package where a name is defined: of ``cmpdesign.api`` the file."""
    words = getattr(found, "__module__", "").removeprefix("cmpdesign.api.").split(".")
    return words[1] if words[0] == module.__name__ else words[0]


def _overview(module: ModuleType, names: list[str]) -> str:
    rows = [f"| [`{name}`](#{name.lower()}) | {_cell(_first(getattr(module, name)))} |" for name in names]
    return "\n".join(["| name | |", "|---|---|", *rows])


def _entry(name: str, found: Any) -> str:
    lines = [f"### {name}", ""]
    if isinstance(found, type) and issubclass(found, Enum):
        lines += [_text(_doc(found)), "", ", ".join(f"`{each.name}`" for each in found)]
    elif (isinstance(found, type) and issubclass(found, Exception)) or is_typeddict(found):
        lines += [_text(_doc(found))]
    elif callable(found):
        lines += ["```text", _signature(name, found), "```", "", _text(_doc(found))]
        lines += _methods(found) if isinstance(found, type) else []
    else:
        lines += [f"`{' '.join(str(found).split())}`"]
    return "\n".join(lines)


def _methods(found: type) -> list[str]:
    """A table of what the class itself, or a class of its own package below it, defines."""
    rows = []
    for name, member in _members(found):
        words = _cell(_first(member))
        if isinstance(member, property) or not callable(member):
            rows.append(f"| `{name}` | {words} |")
        else:
            rows.append(f"| `{_signature(name, member, short=True)}` | {words} |")
    return ["", "| has | |", "|---|---|", *rows] if rows else []


def _members(found: type) -> Iterator[tuple[str, Any]]:
    fields = set(getattr(found, "__dataclass_fields__", ())) | set(getattr(found, "model_fields", ()))
    seen: set[str] = set()
    for owner in found.__mro__:
        if owner.__module__.split(".")[0] not in ("cmpdesign", "extractor"):
            continue
        for name, member in vars(owner).items():
            documented = isinstance(member, classmethod | staticmethod) or inspect.isfunction(member)
            documented = documented or isinstance(member, property) or hasattr(member, "attrname")
            if documented and not name.startswith("_") and name not in fields | seen:
                seen.add(name)
                yield name, member


def _signature(name: str, found: Any, short: bool = False) -> str:
    """As it stands in the source: one line, or one line a parameter where that is too long."""
    target = found.__func__ if isinstance(found, classmethod | staticmethod) else found
    signature = inspect.signature(target)
    own = [each for each in signature.parameters.values() if each.name not in ("self", "cls")]
    if short:
        return f"{name}({', '.join(str(each.replace(annotation=each.empty, default=each.empty)) for each in own)})"
    returned = signature.return_annotation
    after = "" if isinstance(found, type) or returned is signature.empty else f" -> {_annotation(returned)}"
    shown = list(_parameters(own))
    line = f"{name}({', '.join(shown)}){after}"
    return (
        line
        if len(line) <= WIDTH
        else "\n".join([f"{name}(", *(f"    {each}," for each in shown), f"){after}"])
    )


def _parameters(parameters: list[inspect.Parameter]) -> Iterator[str]:
    """The parameters as they are written; a default that has no short form is "..."."""
    starred = False
    for each in parameters:
        if each.kind is each.KEYWORD_ONLY and not starred:
            yield "*"
        starred = starred or each.kind in (each.KEYWORD_ONLY, each.VAR_POSITIONAL)
        mark = {each.VAR_POSITIONAL: "*", each.VAR_KEYWORD: "**"}.get(each.kind, "")
        kind = "" if each.annotation is each.empty else f": {_annotation(each.annotation)}"
        default = "..." if "<" in repr(each.default) else repr(each.default)
        yield f"{mark}{each.name}{kind}" + ("" if each.default is each.empty else f" = {default}")


def _annotation(annotation: Any) -> str:
    """The type as it is written, without how the command line writes it."""
    if isinstance(annotation, str) and annotation.startswith("Annotated["):
        whole = ast.parse(annotation, mode="eval").body
        kind = ast.get_source_segment(annotation, whole.slice.elts[0])  # type: ignore[attr-defined]
        return " ".join(str(kind).split())
    if isinstance(annotation, str):
        return re.sub(r"\bdocuments\.\w+\.", "", annotation)
    return getattr(annotation, "__name__", str(annotation))


def _doc(found: Any) -> str:
    return inspect.getdoc(getattr(found, "func", found)) or ""


def _first(found: Any) -> str:
    return " ".join(_doc(found).partition("\n\n")[0].split())


def _cell(text: str) -> str:
    return _marked(text).replace("|", "\\|")


def _marked(text: str) -> str:
    return re.sub(r"``([^`]*)``", r"`\1`", text).replace("<", "\\<")


def _text(doc: str) -> str:
    """A docstring as Markdown: examples as code, sections as lists."""
    parts: list[str] = []
    for paragraph in doc.split("\n\n"):
        heading, _, rest = paragraph.partition("\n")
        if heading.rstrip(":") in SECTIONS and heading.endswith(":"):
            parts += [f"*{heading}*", _entries(rest)]
        elif paragraph.startswith(">>>"):
            parts.append("\n".join(["```text", *EXAMPLE.sub("", paragraph).splitlines(), "```"]))
        else:
            parts.append(_marked(paragraph))
    return "\n\n".join(parts)


def _entries(text: str) -> str:
    """The entries of a section, one a bullet."""
    bullets: list[str] = []
    for line in inspect.cleandoc(text).splitlines():
        entry = ENTRY.match(line)
        if entry:
            bullets.append(f"- `{line.partition(': ')[0]}`: {_marked(entry[2])}")
        elif bullets:
            bullets[-1] += f" {_marked(line.strip())}"
        else:
            bullets.append(f"- {_marked(line)}")
    return "\n".join(bullets)
