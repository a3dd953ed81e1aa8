"""Shared by all commands: options of output, examples, refused paths, and one line for errors and for Ctrl-C."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    Mode,
    current_mode,
    is_expected,
    print_error,
    print_origin,
    use_mode,
)
from cmpdesign.errors import CmpDesignError, spelled
from cmpdesign.inputs.texts import shortened, visible
from cmpdesign.libraries import missing_library_text

INTERRUPTED = "interrupted; every file that was written is complete"
# The commands by what people do, in the order of the help text and of the reference.
PURPOSES = {
    "Design and make": "templates init studio size check build kerf",
    "Read and follow": "verify cameras track view reconstruct serve calibrate",
    "Try before making": "render evaluate",
    "Make data sets": "dataset extract export",
    "For other programs": "schema",
}
_ARGUMENT_TYPE = re.compile(r"^(  [A-Z]+)( <[^>]+>)", re.MULTILINE)


_carrier = typer.Typer(add_completion=False)


@_carrier.command()
def _carry(
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print one JSON document in place of text, and errors and warnings as JSON lines on stderr.",
        ),
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print errors and warnings only; no progress.")
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="Also print each step with its time, and the place in the code where an error arose.",
        ),
    ] = False,
) -> None:
    """Carries the options of every command, in the order of ``Mode``."""


OUTPUT_OPTIONS = [each for each in get_command(_carrier).params if each.name in Mode._fields]


def examples(*lines: str) -> str:
    """The end of a help text: two examples, without the prompt; of a single one, the second prints the document."""
    return "\n".join(lines if len(lines) > 1 else (*lines, f"{lines[0]} --json"))


class _WithExamples:
    """A command or group whose help text ends with examples."""

    epilog: str | None

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """One line an example, unwrapped, so that it can be copied."""
        if self.epilog:
            with formatter.section("Examples"):
                for line in self.epilog.splitlines():
                    formatter.write(f"{'':{formatter.current_indent}}$ {line}\n")


class Command(_WithExamples, TyperCommand):
    """A command with ``--json``, ``--quiet`` and ``--verbose``, which its function does not receive.

    It refuses "-" for a file or folder: no command reads standard input or writes files to output.
    """

    def __init__(self, name: str | None, *, params: list[Any] | None = None, **options: Any) -> None:
        super().__init__(name, params=[*(params or []), *OUTPUT_OPTIONS], **options)

    def get_help(self, ctx: Any) -> str:
        """The help text without Python's types of arguments, as in "SOURCE <list[str]>"."""
        return _ARGUMENT_TYPE.sub(lambda found: found[1] + " " * len(found[2]), super().get_help(ctx))

    def invoke(self, ctx: Any) -> Any:
        mode = Mode(*(ctx.params.pop(name) for name in Mode._fields))
        excluded = mode.quiet and mode.verbose
        use_mode(mode._replace(verbose=mode.verbose and not excluded))
        if excluded:
            raise CmpDesignError("--quiet and --verbose exclude each other; give one of them")
        for parameter in self.params:
            given = ctx.params.get(parameter.name)
            values: Iterable[Any] = given if isinstance(given, list | tuple) else (given,)
            if any(isinstance(value, Path) and str(value) == "-" for value in values):
                raise CmpDesignError(
                    f"{parameter.opts[-1]} -: standard input and output are not supported; give a name"
                )
        with spelled(self._spelled):
            return super().invoke(ctx)

    def _spelled(self, name: str, value: str | None) -> str:
        """A parameter as the command line writes it; a word of another command for what this command does not have."""
        written = {
            each.name: " or ".join([*each.secondary_opts, each.opts[-1]])
            if each.opts[-1].startswith("--")
            else each.name.upper()
            for each in self.params
        }
        option = written.get(name, f"--{name.replace('_', '-')}")
        return option if value is None else f"{option} {value}"


class Group(_WithExamples, TyperGroup):
    """A group of commands."""


def new_group(help_text: str, *shown: str) -> typer.Typer:
    """A group of commands; ``shown`` are its examples."""
    return typer.Typer(
        cls=Group, epilog=examples(*shown), no_args_is_help=True, rich_markup_mode=None, help=help_text
    )


class OneLineErrors(Group):
    """Prints expected errors as one line on stderr with exit code 2, and Ctrl-C as one line with exit code 130.

    The help text has the commands by ``PURPOSES``.
    """

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        widest = max(map(len, self.commands))
        for purpose, names in PURPOSES.items():
            commands = [self.commands[name] for name in names.split()]
            texts = [each.get_short_help_str(formatter.width - 6 - widest) for each in commands]
            with formatter.section(purpose):
                formatter.write_dl(
                    list(zip((f"{name:{widest}}" for name in names.split()), texts, strict=True))
                )

    def make_context(self, info_name: Any, args: list[str], parent: Any = None, **extra: Any) -> Any:
        # for errors in the command line, before the options are known
        use_mode(Mode(as_json=_asks_for_json(args)))
        try:
            return super().make_context(info_name, args, parent, **extra)
        except Exception as error:
            _finish_usage_error(error)
            raise

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            print_error(INTERRUPTED, EXIT_INTERRUPTED)
            raise typer.Exit(EXIT_INTERRUPTED) from None
        except ModuleNotFoundError as error:
            text = missing_library_text(error)
            if text is None:
                raise
            print_origin(error)
            print_error(text)
        except Exception as error:
            if not is_expected(error):
                _finish_usage_error(error)
                raise
            print_origin(error)
            print_error(error)
        raise typer.Exit(EXIT_BAD_INPUT)


def _asks_for_json(words: Sequence[str]) -> bool:
    before = words[: words.index("--")] if "--" in words else words
    return "--json" in before


def _finish_usage_error(error: Exception) -> None:
    """Make the message of an error in the command line printable, or print the message as JSON and exit."""
    if not hasattr(error, "format_message"):
        return
    message = error.format_message()
    if type(error).__name__ == "NoArgsIsHelpError":  # the message is the help text
        return
    # Pydantic, which typer uses, begins with "Value error".
    text = shortened(visible(message.replace(": Value error, ", ": ", 1), keep="\n"))
    if current_mode().as_json:
        print_error(text)
        raise typer.Exit(EXIT_BAD_INPUT) from None
    error.format_message = lambda: text


app = typer.Typer(
    cls=OneLineErrors,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # markup would remove text in brackets from a help text
    help="Design, make and read multicolor continuous marker patterns for vision-based tactile sensors.\n\n"
    "Exit codes: 0 done; 1 done, with a negative verdict or an early end; 2 bad input, or a file that cannot be "
    "written; 130 stopped by Ctrl-C.",
    epilog=examples("cmpdesign build tac3d -o mine", "cmpdesign verify --help"),
)
