"""Names and texts from files: one printable line, and the nearest known name of an unknown one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Annotated

from pydantic import AfterValidator, Field

MAX_NAME_LETTERS = 100
MAX_LINE_LETTERS = 1000
_MAX_COMPARED = 60  # letters of an unknown name that are compared with the known ones


def nearest_name(word: object, known: Iterable[str]) -> str:
    """The part of a message that states the nearest known name; empty if no known name is near.

    >>> nearest_name("honeycom", ["round", "honeycomb"])
    ' (did you mean honeycomb?)'
    """
    found = difflib.get_close_matches(str(word)[:_MAX_COMPARED], list(known), n=1, cutoff=0.5)
    return f" (did you mean {found[0]}?)" if found else ""


def one_printable_line(value: str) -> str:
    """The text, if terminals, XML and job sheets can show it.

    Raises:
        ValueError: a line break, a control character, or another character without a picture.
    """
    if not value.isprintable():
        raise ValueError(
            f"{value[:40]!a} has line breaks or control characters; write it on one line of plain letters"
        )
    return value


# A name of a design, a machine, a material, a product: names are written to XML, job sheets, file names and the
# terminal.
Name = Annotated[str, Field(max_length=MAX_NAME_LETTERS), AfterValidator(one_printable_line)]
# A sentence: a source, a description, a remedy.
Line = Annotated[str, Field(max_length=MAX_LINE_LETTERS), AfterValidator(one_printable_line)]
