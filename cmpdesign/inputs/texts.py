"""Printable forms of texts: texts of files, paths and options may hold escape sequences and line breaks."""

from __future__ import annotations

import json


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
