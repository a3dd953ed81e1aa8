"""Definitions of functions in C++ sources, read as text, without a compiler.

The sources have one format (clang-format): a definition ends where its closing brace stands below its first line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

DEFINITION = re.compile(
    r"^(?P<indent> *)(?!(?:return|else|if|for|while|switch|case|namespace|struct|class|using)\b)"
    r"[\w:<>,*&\[\] ]*?[\w>*&]\s+(?:\w+::)?(?P<name>\w+|operator\S+)\((?P<parameters>[^;{}]*?)\)[\w\s:]*\{\n",
    re.MULTILINE,
)


class Definition(NamedTuple):
    """A function's definition: its name, its number of parameters and of lines, and where its body is in the text."""

    name: str
    parameters: int
    lines: int
    start: int
    end: int


def definitions(text: str) -> Iterator[Definition]:
    for match in DEFINITION.finditer(text):
        end = text.find(f"\n{match['indent']}}}", match.end())
        parameters = re.sub(r"<[^<>]*>", "", re.sub(r"<[^<>]*>", "", match["parameters"]))
        count = parameters.count(",") + 1 if parameters.strip() else 0
        yield Definition(match["name"], count, text.count("\n", match.start(), end) + 2, match.end(), end)
