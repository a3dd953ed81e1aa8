"""Printable forms of texts: texts of files, paths and options may hold escape sequences and line breaks."""

from __future__ import annotations

import json

# Of an error or a warning: no message of the program is as long; only texts from files and arguments can be longer.
MAX_LINE_LETTERS = 1000
_HEAD_LETTERS = 700  # letters before the cut; the remedy stands at the end of a line


def visible(text: str, keep: str = "") -> str:
    r"""The text with every unprintable character escaped as in JSON, except the characters in ``keep``.

    >>> visible("a\x1b[31mb")
    'a\\u001b[31mb'
    """
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or letter in keep else json.dumps(letter)[1:-1] for letter in text
    )


def shortened(text: str) -> str:
    """The text, cut in the middle at ``MAX_LINE_LETTERS``."""
    if len(text) <= MAX_LINE_LETTERS:
        return text
    gap = " ... "
    return text[:_HEAD_LETTERS] + gap + text[len(text) - (MAX_LINE_LETTERS - _HEAD_LETTERS - len(gap)) :]


def one_line(error: BaseException | str) -> str:
    """The error's message: one line of printable characters, at most ``MAX_LINE_LETTERS``."""
    return shortened(visible(" ".join(str(error).split())))
