"""Values on the command line: sources, sizes, pairs, responses, and the names of templates that shells complete."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, cast

import typer

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.options import Response, Written

SourcesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE",
        help='Pictures, folders, patterns such as "run*/*.png", a video, a camera\'s number, or rtsp://...',
    ),
]


def _names(*kinds: str) -> Callable[[str], list[str]]:
    """Completes the names of templates of some kinds; without a kind those of all."""

    def complete(incomplete: str) -> list[str]:
        from cmpdesign.design.templates import template_kinds

        every = template_kinds()
        return [name for kind in kinds or every for name in every[kind] if name.startswith(incomplete)]

    return complete


# The parameter of a call -> the names that begin with a text.
COMPLETIONS: Mapping[str, Callable[[str], list[str]]] = {
    "design": _names("designs"),
    "designs": _names("designs"),
    "extends": _names("designs"),
    "scene": _names("scenes"),
    "plan": _names("plans"),
    "show": _names(),
}


def parse_pairs(option: str, texts: Sequence[str], key: type, written: Written) -> dict[Any, str]:
    """Key -> value from texts as "pitch_mm=60mil" or "0.5mm=plate.png".

    Args:
        option: name of the option, for the messages.
        texts: its values.
        key: type of the keys: str or float, which may end with "mm".
        written: the form and the example of the messages.

    Raises:
        CmpDesignError: a text without key or value, a key that is no finite number, or a number that is given twice.
    """
    pairs: dict[Any, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        try:
            found: Any = name if key is str else float(name.removesuffix("mm"))
        except ValueError:
            found = math.nan
        is_known = bool(name) if key is str else math.isfinite(found) and value
        if not equals or not is_known:
            raise CmpDesignError(f"{option} {text}: expected {written.metavar}, as in {written.example}")
        if key is float and found in pairs:
            raise CmpDesignError(f"{option} {text}: {found:g} is given twice")
        pairs[found] = value
    return pairs


def parse_response(text: str | None) -> Response | None:
    """The response from "srgb", "linear" or an exponent; None where the option is not given.

    Raises:
        CmpDesignError: another text, or an exponent beyond its limits.
    """
    if text in (None, "srgb", "linear"):
        return cast("Response | None", text)
    from extractor.image.response import light_of_values

    try:
        exponent = float(text)
        light_of_values(exponent)
    except ValueError:
        raise CmpDesignError(
            f"--response {text}: expected srgb, linear or an exponent from 0.2 to 5, as in 2.2"
        ) from None
    return exponent
