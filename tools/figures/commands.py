"""The page docs/reference/command-line.md, from the program itself: its commands, options, examples and documents."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import typer
from typer.main import get_command

from cmpdesign.cli import app
from cmpdesign.cli.command import OUTPUT_OPTIONS, PURPOSES
from cmpdesign.documents.document import Message
from cmpdesign.documents.registry import DOCUMENTS

HEAD = """# The command line

<!-- written by python -m tools.figures -->

`cmpdesign` and `python -m cmpdesign` are the same program. `-h` or `--help` after any command shows what stands here;
`cmpdesign --install-completion` makes the shell complete commands, options and the names of templates.

Every command has these options:

{shared}

| exit code | means |
|---|---|
| 0 | done |
| 1 | done, with a negative verdict or an early end: not verified, not buildable, nothing tracked |
| 2 | bad input, or a file that cannot be written: one line on standard error, and nothing half-written |
| 130 | stopped by Ctrl-C; every file that was written is complete |

Results go to standard output; errors, warnings, steps and progress go to standard error. Progress is shown on a
terminal only.

## JSON

With `--json`, standard output is one document, or empty after an error that ends the command. Every document has a
`format` and a `version`: the version is raised when a field goes or changes its meaning or type; fields may be added
without that. Read what you need and ignore the rest. Standard error has one JSON object a line:

{message}

`cmpdesign schema COMMAND` prints the JSON Schema of a command's document, `cmpdesign schema message` that of these
lines, and `cmpdesign schema` alone that of a design's TOML file.

"""


def page() -> str:
    """The text of the page."""
    shared = _table("option", [_option_row(parameter) for parameter in OUTPUT_OPTIONS])
    parts = [HEAD.format(shared=shared, message=_fields(Message.model_json_schema()))]
    sections = list(_commands(get_command(app), ()))
    for purpose, names in PURPOSES.items():
        parts.append(f"## {purpose}\n")
        for name in names.split():
            parts += [_section(words, command) for words, command in sections if words[0] == name]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def _commands(group: Any, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*words, name))
        else:
            yield (*words, name), command


def _section(words: tuple[str, ...], command: Any) -> str:
    """A command: what it does, its arguments and options, its examples, its document."""
    own = [parameter for parameter in command.params if parameter not in OUTPUT_OPTIONS]
    arguments = [_argument_row(each) for each in own if each.param_type_name == "argument"]
    options = [_option_row(each) for each in own if each.param_type_name == "option"]
    name = " ".join(words)
    lines = [f"### {name}", "", re.sub(r"(?<!\n)\n(?!\n)", " ", command.help.strip()), ""]
    if arguments:
        lines += [_table("argument", arguments), ""]
    if options:
        lines += [_table("option", options), ""]
    lines += ["```text", *(f"$ {line}" for line in command.epilog.splitlines()), "```", ""]
    for model in DOCUMENTS.get(name, ()):
        schema = model.model_json_schema()
        kind, version = (schema["properties"][field]["const"] for field in ("format", "version"))
        lines += [
            f"JSON: `{kind}`, version {version}. {' '.join(_escaped(schema['description']).split())}",
            "",
        ]
        lines += [_fields(schema), ""]
    return "\n".join(lines)


def _argument_row(parameter: Any) -> tuple[str, str]:
    name = parameter.metavar if parameter.required else f"[{parameter.metavar}]"
    return f"`{name}{'...' if parameter.nargs == -1 else ''}`", _escaped(parameter.help)


def _option_row(parameter: Any) -> tuple[str, str]:
    """The names with their value, and the help text with range and default, as the help of the program shows them."""
    names, words = parameter.get_help_record(_context())
    return f"`{names.replace('|', chr(92) + '|')}`", _escaped(words.replace("  [", " ["))


@cache
def _context() -> typer.Context:
    """Of all commands, which Typer makes anew for every call."""
    return typer.Context(get_command(app))


def _table(heading: str, rows: list[tuple[str, str]]) -> str:
    return "\n".join(
        [f"| {heading} | meaning |", "|---|---|", *(f"| {name} | {words} |" for name, words in rows)]
    )


def _fields(schema: dict[str, Any]) -> str:
    """The fields of a document; those of its parts follow as "part.field"."""
    return "\n".join(
        ["| field | type | meaning |", "|---|---|---|", *_field_rows(schema, schema.get("$defs", {}), "")]
    )


def _field_rows(schema: dict[str, Any], parts: dict[str, Any], above: str) -> Iterator[str]:
    for name, field in schema["properties"].items():
        if above or name not in ("format", "version"):
            kind = _type(field)
            inner = _part_of(field, parts)
            words = field.get("description") or (inner or {}).get("description") or ""
            yield f"| `{above}{name}` | {_escaped(kind)} | {_escaped(' '.join(words.split()))} |"
            if inner is not None:
                yield from _field_rows(inner, parts, f"{above}{name}.")


def _part_of(field: dict[str, Any], parts: dict[str, Any]) -> dict[str, Any] | None:
    """The part that a field, its items or its values are."""
    for each in (
        field,
        *field.get("anyOf", ()),
        field.get("items", {}),
        field.get("additionalProperties", {}),
    ):
        if isinstance(each, dict) and "$ref" in each:
            found: dict[str, Any] = parts[each["$ref"].rpartition("/")[2]]
            return found
    return None


def _type(field: dict[str, Any]) -> str:
    if "anyOf" in field:
        return " or ".join(_type(each) for each in field["anyOf"])
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    if "const" in field:
        return f"`{field['const']}`"
    if "$ref" in field:
        return "object"
    if field.get("type") == "array":
        return f"list of {_type(field['items'])}" if "items" in field else f"{field['maxItems']} numbers"
    if isinstance(field.get("additionalProperties"), dict):
        return f"object of {_type(field['additionalProperties'])}"
    return str(field.get("type", "any"))


def _escaped(text: str) -> str:
    return text.replace("``", "`").replace("|", "\\|").replace("<", "\\<")
