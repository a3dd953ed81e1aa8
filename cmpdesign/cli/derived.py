"""Commands from calls: the options of a command, their types, defaults and help texts are those of the call."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import typer

from cmpdesign.cli.options.response import parse_reading_response
from cmpdesign.inputs.options import Option, Response, options_of

Run = Callable[..., None]
Takes = TypeVar("Takes", bound=Run)
_ENTRY = re.compile(r"^    (?:    )?(\w+): (.*(?:\n {8,}\S.*)*)", re.MULTILINE)


def derived(call: Callable[..., Any], *records: type, **arguments: Any) -> Callable[[Takes], Run]:
    """Give a command the options of a call.

    Args:
        call: the call, whose docstring describes arguments and the command.
        records: the ``TypedDict`` of the call's keywords, then the one that it extends, if any.
        arguments: argument of the call -> annotated type on the command line, or a type alone, whose help text is the
            docstring's.

    The command's function receives the arguments, its own parameters, and all options as keywords. Its docstring
    follows the first paragraph of the call's.
    """
    described = [each for source in (call, *records) for each in _meanings(source)]
    meanings, shared = dict(described), {name for record in records[1:] for name in record.__annotations__}
    options = sorted(options_of(records[0]), key=lambda option: option.name in shared)

    def decorated(run: Takes) -> Run:
        extra = [
            each
            for each in inspect.signature(run, eval_str=True).parameters.values()
            if each.kind is each.KEYWORD_ONLY
        ]

        def command(**values: Any) -> None:
            if values.get("response") is not None:
                values["response"] = parse_reading_response(values["response"])
            run(**values)

        written = [_argument(name, kind, meanings) for name, kind in arguments.items()]
        written += [_option(option, meanings) for option in options]
        command.__signature__ = inspect.Signature([*written, *extra])  # type: ignore[attr-defined]
        command.__annotations__ = {each.name: each.annotation for each in (*written, *extra)}
        command.__name__ = run.__name__
        command.__doc__ = f"{_first_sentence(call)}\n\n{inspect.getdoc(run) or ''}".strip()
        return command

    return decorated


def _meanings(described: Any) -> Iterator[tuple[str, str]]:
    """Name and meaning of every argument or key in a docstring."""
    for name, text in _ENTRY.findall(inspect.getdoc(described) or ""):
        yield name, " ".join(text.split())


def _first_sentence(call: Callable[..., Any]) -> str:
    text = " ".join((inspect.getdoc(call) or "").partition("\n\n")[0].split())
    return re.sub(r", as the command ``[^`]+`` does", "", text)


def _help(text: str) -> str:
    """A meaning as a help text: a sentence, the meaning of None as the default."""
    meaning, _, absent = text.rstrip(".").partition("; None: ")
    sentence = re.sub(r"``([^`]+)``", lambda found: found[1].upper(), meaning)
    sentence = sentence if re.match(r"rgb:", sentence) else sentence[:1].upper() + sentence[1:]
    return f"{sentence}." + (f" [default: {absent}]" if absent else "")


def _argument(name: str, kind: Any, meanings: dict[str, str]) -> inspect.Parameter:
    if get_origin(kind) is not Annotated:
        words = _help(meanings[name])
        info: Any = typer.Argument(metavar=name.upper(), help=words)
        if name == "output":
            info = typer.Option("-o", "--output", metavar="FILE", help=words)
        kind = Annotated[kind, info]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind)


def _option(option: Option, meanings: dict[str, str]) -> inspect.Parameter:
    name, usual = option.name, option.usual
    word = usual.name or f"--{name.replace('_', '-')}"
    info = typer.Option(word, metavar=usual.metavar, help=_help(meanings[name]))
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        default=usual.value,
        annotation=Annotated[_written_type(option.type), info],
    )


def _written_type(kind: Any) -> Any:
    """The type that the command line parses: texts for responses, and for what may be a number or a path."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    members = [each for each in get_args(kind) if each is not NoneType]
    if set(members) == set(get_args(Response)) or (int in members and Path in members):
        return str | None
    if Path in members:
        return Path | None
    assert len(members) == 1, kind
    (only,) = members
    return only | None if get_origin(only) is not Literal else Union[only, None]  # noqa: UP007
