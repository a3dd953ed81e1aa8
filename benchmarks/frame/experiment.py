"""The command line of all experiments.

An experiment is a function of options that yields what is printed, tables and texts, and returns what is kept:

    def measure(quick: bool = False, seed: int = COMMIT) -> Shown:
        \"\"\"What is measured.

        Args:
            quick: few pictures.
        \"\"\"
        yield Table(...)
        return Found({"rows": ...})

    main = Experiment("name", measure)
    main.run_as(__name__)

Options have the names, types, defaults and meanings of the arguments. ``--json`` writes what is kept and all tables;
``--publish`` writes it into docs/measured, and anew what pages show of it.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import Parameter, getdoc, getmodule, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from benchmarks.frame.conditions import commit_seed, conditions_text, machine_conditions
from benchmarks.frame.published import Page, json_text, publish, read_measured
from benchmarks.frame.table import Table
from cmpdesign.files.atomic import write_file

INPUT = "folder"  # an argument of this name is given without dashes
COMMIT = -1  # as a seed: that of the commit's hash
_MEANING = re.compile(r"^ +(\w+): (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Found:
    """What is kept of a run.

    Attributes:
        record: for JSON.
        failed: the run found what must not be, such as a wrong id: the exit code is 1.
    """

    record: Mapping[str, Any] = field(default_factory=dict)
    failed: bool = False


Shown = Generator[Table | str, None, Found | None]


class OptionError(ValueError):
    """Options that are wrong or exclude each other; the message is printed with the usage."""


@dataclass(frozen=True)
class Experiment:
    """A command ``python -m benchmarks.NAME``.

    Attributes:
        name: of the command, and of its file in docs/measured.
        measure: see the module.
        page: for experiments that the documentation shows: content of docs/measured -> blocks and pictures.
        merged: earlier content of docs/measured, record -> the record to publish; the new record alone by default.
        published_options: those that a published run may change; all others have their defaults.
    """

    name: str
    measure: Callable[..., Shown]
    page: Callable[[dict[str, Any]], Page] | None = None
    merged: Callable[[dict[str, Any], Mapping[str, Any]], Mapping[str, Any]] = lambda earlier, new: new
    published_options: tuple[str, ...] = ()

    def published(self) -> Page:
        """What the documentation shows by the present content of docs/measured."""
        measured = read_measured(self.name)
        return self.page(measured) if self.page and measured else Page()

    def run_as(self, module: str) -> None:
        """Run with the words of the command line if the module of this name is the program, and end."""
        if module == "__main__":
            raise SystemExit(self())

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        """Run with words of the command line. Returns the exit code."""
        parser = self._parser()
        options = vars(parser.parse_args(arguments))
        json_path, is_published = options.pop("json"), options.pop("publish", False)
        usual = {name: parser.get_default(name) for name in options}
        for name in options if is_published else ():
            if options[name] != usual[name] and name not in (*self.published_options, "processes"):
                parser.error(f"figures with --{name} are not published; leave --publish or --{name} out")
        try:
            self._check(options)
            return self._run(options, json_path, is_published)
        except OptionError as error:
            parser.error(str(error))

    def _run(self, options: dict[str, Any], json_path: Path | None, is_published: bool) -> int:
        import cv2

        cv2.setNumThreads(1)
        started, tables = time.perf_counter(), {}
        shown = _Kept(self.measure(**options))
        for part in shown:
            print(part, end="\n\n" if isinstance(part, Table) else "\n", flush=True)
            if isinstance(part, Table):
                tables[part.title] = part.records()
        found = shown.found
        command = self._command(options)
        print(f"{command}\n{time.perf_counter() - started:.0f} s; {conditions_text()}")
        known = {"conditions": machine_conditions(), "command": command}
        if json_path:
            write_file(json_path, json_text({**known, "tables": tables, **found.record}))
        if is_published:
            assert self.page is not None
            record = dict(self.merged(read_measured(self.name), {**known, **found.record}))
            for path in publish(self.name, record, self.page(record)):
                print(f"wrote {path}")
        return int(found.failed)

    def _check(self, options: dict[str, Any]) -> None:
        for name, value in options.items():
            if name == "seed" and value == COMMIT:
                try:
                    options[name] = commit_seed()
                except ValueError as error:
                    raise OptionError(error) from None
                continue
            least = 0 if name == "seed" else 1
            if isinstance(value, int) and not isinstance(value, bool) and value < least:
                raise OptionError(f"--{name.replace('_', '-')} is {value}; it must be {least} or more")

    def _command(self, options: Mapping[str, Any]) -> str:
        """The command that repeats the run."""
        words = [f"python -m benchmarks.{self.name}"]
        for name, parameter in signature(self.measure).parameters.items():
            value, option = options[name], f"--{name.replace('_', '-')}"
            values = value if isinstance(value, list) else [value]
            if value in (parameter.default, None) or name == "processes":
                continue
            option = "" if name == INPUT else option
            words += [option if value is True else f"{option} {_quoted(each)}".strip() for each in values]
        return " ".join(words)

    def _parser(self) -> argparse.ArgumentParser:
        told = getattr(getmodule(self.measure), "__doc__", None) or ""
        parser = argparse.ArgumentParser(
            prog=f"python -m benchmarks.{self.name}",
            description=told,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        meanings = dict(_MEANING.findall(getdoc(self.measure) or ""))
        hints = get_type_hints(self.measure)
        for name, parameter in signature(self.measure).parameters.items():
            _add_option(parser, parameter, hints[name], meanings.get(name, ""))
        parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures, too")
        if self.page:
            parser.add_argument(
                "--publish", action="store_true", help="write docs/measured and the pages that show it"
            )
        return parser


class _Kept:
    """Iterates over what is shown, and keeps what the generator returns."""

    def __init__(self, shown: Shown) -> None:
        self._shown, self.found = shown, Found()

    def __iter__(self) -> Generator[Table | str, None, None]:
        self.found = (yield from self._shown) or self.found


def _quoted(value: Any) -> str:
    return f'"{value}"' if " " in str(value) else str(value)


def _add_option(parser: argparse.ArgumentParser, parameter: Parameter, kind: Any, meaning: str) -> None:
    """Add the option of an argument: a flag, a number, a text, one of several texts, or several of one kind."""
    option: dict[str, Any] = {"help": meaning or None, "default": parameter.default}
    if get_origin(kind) is UnionType:
        (kind,) = (each for each in get_args(kind) if each is not NoneType)
    if get_origin(kind) is tuple:
        kind, option["nargs"], option["action"], option["default"] = get_args(kind)[0], "+", "extend", []
    if kind is bool:
        option["action"] = "store_true"
    elif get_origin(kind) is Literal:
        option["choices"] = get_args(kind)
    else:
        option["type"], option["metavar"] = kind, parameter.name.upper()
    if parameter.name == INPUT:
        parser.add_argument(INPUT, nargs="?", **option)
    else:
        parser.add_argument(f"--{parameter.name.replace('_', '-')}", dest=parameter.name, **option)
