"""Commands from calls: the parameters of a command, their types, defaults and help texts are those of the call.

A call's parameters without default are arguments, the others are options; ``output`` is an option, too. The docstring's
entries are the help texts: what follows "; or " is for programs only, what follows "; None: " is the default, and "see
``name``" stands for the entry of another call or record.
"""

from __future__ import annotations

import builtins
import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Union, Unpack, get_args, get_origin

import typer

from cmpdesign.cli.command import Command, examples
from cmpdesign.cli.options import COMPLETIONS, parse_pairs, parse_response
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_written
from cmpdesign.inputs.options import Response, Usual, Written, options_of, pixels_of
from cmpdesign.tracking.jobs.options import ReadingOptions, SequenceOptions

Run = Callable[..., Any]
Parse = Callable[[Any], Any]
LAYOUT = "the pattern's layout.json"
_ENTRY = re.compile(r"^    (?:    )?(\w+(?:, \w+)*): (.*(?:\n {8,}\S.*)*)", re.MULTILINE)
_REQUIRED = inspect.Parameter.empty
_CONTEXT = inspect.Parameter("ctx", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)


@dataclass(frozen=True)
class _Taken:
    """A parameter of a call.

    Attributes:
        name: its name.
        kind: its type.
        default: its default; ``_REQUIRED``: none.
        written: how the command line writes it.
        is_argument: it is given by its place.
        is_key: it is a key of a record of options, which the call gets only if it is given.
    """

    name: str
    kind: Any
    default: Any
    written: Written
    is_argument: bool = False
    is_key: bool = False


def command(
    group: typer.Typer, call: Callable[..., Any], doing: str, *shown: str, **how: Any
) -> Callable[[Run], Run]:
    """Add a command to a group.

    Args:
        group: the group.
        call, doing, how: see ``derived``.
        shown: the command's examples.
    """

    def decorated(run: Run) -> Run:
        group.command(cls=Command, epilog=examples(*shown))(derived(call, doing, **how)(run))
        return run

    return decorated


def derived(
    call: Callable[..., Any], doing: str, calling: Run | None = None, **arguments: Any
) -> Callable[[Run], Run]:
    """Give a command the parameters of a call, whose docstring describes parameters and the command.

    Args:
        call: the call.
        doing: what the call does, for the progress.
        calling: called in place of the call; its keyword-only parameters are further options, flags last.
        arguments: parameter of the call -> another help text; None: the command does not have the parameter.

    The call's record goes to the command's function, which prints the record for people and may return an exit code;
    a parameter ``given`` of the function gets the values of the call. With ``--json`` the record is printed. The
    docstring of the function follows the first sentence of the call's.
    """
    left_out = {name for name, words in arguments.items() if words is None}
    taken = [each for each in _taken(call) if each.name not in left_out]
    taken.sort(key=lambda each: 0 if each.is_argument else 1 if each.name == "output" else 2)
    meanings = _meanings(call) | {name: words for name, words in arguments.items() if words is not None}

    def decorated(run: Run) -> Run:
        own = {} if calling is None else inspect.signature(calling).parameters
        extra = [
            each.replace(annotation=_evaluated(each.annotation, getattr(calling, "__globals__", {})))
            for each in own.values()
            if each.kind is each.KEYWORD_ONLY
        ]
        parsers = {each.name: _form(each)[1] for each in taken}
        keys = {each.name for each in taken if each.is_key}
        takes_given = "given" in inspect.signature(run).parameters

        def command(ctx: typer.Context, **values: Any) -> None:
            values = {
                name: parsers[name](each) if name in parsers else each
                for name, each in values.items()
                if name not in keys or getattr(ctx.get_parameter_source(name), "name", "") == "COMMANDLINE"
            }
            with working(doing):
                done = (calling or call)(**values)
            print_written(done)
            finish(done, (run(done, given=values) if takes_given else run(done)) or 0)

        of_call = [_parameter(each, meanings) for each in taken]
        placed = sum(each.is_argument for each in taken) + any(each.name == "output" for each in taken)
        modes = [each for each in extra if each.default is False]
        values = [each for each in extra if each.default is not False]
        written = [_CONTEXT, *of_call[:placed], *values, *of_call[placed:], *modes]
        command.__signature__ = inspect.Signature(written)  # type: ignore[attr-defined]
        command.__annotations__ = {each.name: each.annotation for each in written}
        command.__name__ = run.__name__
        command.__doc__ = f"{_first_sentence(call)}\n\n{inspect.getdoc(run) or ''}".strip()
        return command

    return decorated


class _Names(dict[str, Any]):
    """The names of a module; a name that only type checkers import is a type of Python alone."""

    def __missing__(self, name: str) -> Any:
        return getattr(builtins, name, _PythonOnly)


class _PythonOnly:
    """Stands for a type that the command line cannot write."""

    def __class_getitem__(cls, item: object) -> type:
        return cls


def _evaluated(text: Any, names: Mapping[str, Any]) -> Any:
    return eval(text, {}, _Names(names)) if isinstance(text, str) else text


def _taken(call: Callable[..., Any]) -> Iterator[_Taken]:
    """The parameters: those of the signature, then the keys of its records, those of ``SequenceOptions`` last."""
    names = call.__globals__
    for each in inspect.signature(call).parameters.values():
        kind = _evaluated(each.annotation, names)
        if each.kind is each.VAR_KEYWORD:
            assert get_origin(kind) is Unpack, f"{call.__name__}: **{each.name} is no record"
            (record,) = get_args(kind)
            shared = SequenceOptions.__annotations__
            for option in sorted(options_of(record), key=lambda option: option.name in shared):
                yield _Taken(option.name, option.type, option.usual.value, option.usual, is_key=True)
            continue
        if not isinstance(kind, UnionType) and get_origin(kind) is Annotated:
            kind, written = get_args(kind)
        else:
            written = next(
                (one.usual for one in options_of(SequenceOptions) if one.name == each.name), Written()
            )
        default = each.default if written.needed is None else _REQUIRED if written.needed else None
        is_placed = each.kind is each.POSITIONAL_OR_KEYWORD and each.default in (_REQUIRED, ())
        is_argument = is_placed and each.name != "output" and written.name is None
        yield _Taken(each.name, kind, default, written, is_argument)


def _meanings(described: Any) -> dict[str, str]:
    """Name -> meaning of every argument or key in a docstring and in the docstrings that it names."""
    found: dict[str, str] = {}
    of_records = {} if described in (SequenceOptions, ReadingOptions) else dict(_meanings(SequenceOptions))
    names = getattr(described, "__globals__", None) or vars(inspect.getmodule(described))
    for entry, text in _ENTRY.findall(inspect.getdoc(described) or ""):
        meaning = " ".join(text.split())
        other = re.match(r"see ``(\w+)``", meaning)
        elsewhere = _meanings(names[other[1]]) if other and other[1] in names else {}
        for name in entry.split(", "):
            if not meaning.startswith("see "):
                found[name] = meaning
            elif name in elsewhere:
                found[name] = elsewhere[name]
        if elsewhere and isinstance(names[other[1]], type):  # type: ignore[index]
            of_records |= elsewhere
    return {"layout": LAYOUT, **of_records, **found}


def _first_sentence(call: Callable[..., Any]) -> str:
    text = " ".join((inspect.getdoc(call) or "").partition("\n\n")[0].split())
    return re.sub(r",? as the commands? ``[^`]+`` do(es)?(?=[.;:])", "", text)


def _help(text: str) -> str:
    """A meaning as a help text: a sentence, the meaning of None as the default."""
    meaning, _, absent = re.sub(r"(?<!\.)\.$", "", text).partition("; None: ")
    meaning = meaning.partition("; or ")[0]
    sentence = re.sub(r"``([^`]+)``", lambda found: found[1].upper(), meaning)
    sentence = sentence if re.match(r"rgb:", sentence) else sentence[:1].upper() + sentence[1:]
    return sentence + ("" if sentence.endswith("...") else ".") + (f" [default: {absent}]" if absent else "")


def _parameter(taken: _Taken, meanings: Mapping[str, str]) -> inspect.Parameter:
    """The parameter as typer reads it."""
    name, written, kind = taken.name, taken.written, _form(taken)[0]
    meaning = meanings[name].partition("; None: ")[0] if written.needed else meanings[name]
    words: dict[str, Any] = {"help": _help(meaning), "metavar": written.metavar}
    words["autocompletion"] = COMPLETIONS.get(name)
    # a record of options checks its own limits, and its message names the value
    if kind in (int, int | None, float, float | None) and not isinstance(written, Usual):
        words |= {"min": written.least, "max": written.most}
    if taken.is_argument:
        several = kind == list[str] or kind == list[Path]
        words["metavar"] = written.metavar or (name.removesuffix("s") if several else name).upper()
        info: Any = typer.Argument(**words)
    else:
        word = written.name or f"--{name.replace('_', '-')}"
        if name == "output":
            words["metavar"] = written.metavar or "FILE"
        info = typer.Option(*(("-o", word) if name == "output" else (word,)), **words)
    default = taken.default
    if isinstance(default, tuple):
        default = "x".join(map(str, default)) if default else None
    kind = kind | None if default is None and get_origin(kind) is list else kind
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info]
    )


def _members(kind: Any) -> list[Any]:
    """The types of a union, without None."""
    kinds = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    return [each for each in kinds if each is not NoneType]


def _form(taken: _Taken) -> tuple[Any, Parse]:
    """The type that the command line parses, and the way from its value to what the call takes."""
    members, written = _members(taken.kind), taken.written
    option = written.name or f"--{taken.name.replace('_', '-')}"
    several = [each for each in members if get_origin(each) in (Sequence, list, Mapping)]
    sizes = [each for each in members if get_origin(each) is tuple]
    if written.with_commas:
        return str, _same
    if several and get_origin(several[0]) is Mapping:
        key = get_args(several[0])[0]
        return list[str], lambda texts: parse_pairs(option, texts or [], key, written)
    if several:
        # one or several sources are texts, as patterns and numbers of cameras; a list of files are paths
        is_of_files = len(members) == 1 and Path in _members(get_args(several[0])[0])
        return list[Path] if is_of_files else list[str], lambda values: values or taken.default
    kind: Any = members[0]
    parse: Parse = _same
    if set(members) == set(get_args(Response)):
        kind, parse = str, parse_response
    elif str in members and (sizes or {int, float} & set(members)):
        kind = str
    elif sizes:
        most = int(written.most or 99_999)
        kind, parse = str, lambda text: None if text is None else pixels_of(taken.name, text, most)
    elif Path in members or _PythonOnly in members:
        kind = Path
    return Union[kind, None] if taken.default is None else kind, parse  # noqa: UP007


def _same(value: Any) -> Any:
    return value
