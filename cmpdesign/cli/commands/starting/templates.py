"""``cmpdesign templates``: lists and shows the templates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from cmpdesign.cli.options.completions import complete_template
from cmpdesign.cli.terminal import finish, print_document, say

if TYPE_CHECKING:
    from cmpdesign.documents.designs import TemplatesDocument

EXAMPLES = ("cmpdesign templates --kind scenes", "cmpdesign templates --show tac3d")
Kind = Literal["designs", "scenes", "plans", "machines", "materials", "silicones", "sensors"]
# The command or option that takes the names of a kind.
TAKERS = {
    "designs": "for build, check, init --extends and evaluate designs",
    "scenes": "for render --scene",
    "plans": "for dataset",
    "machines": "for --set laser.machine=NAME",
    "materials": "for --set laser.material=NAME",
    "silicones": "for --set mold.base_silicone=NAME, marker_silicone, cover_silicone",
    "sensors": "for evaluate --sensor",
}


def templates(
    kind: Annotated[
        Kind | None, typer.Option("--kind", help="List templates of one kind. [default: all]")
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(
            "--show",
            metavar="NAME",
            help='Print the TOML file of a template; as "sensors/tac3d" where two kinds share a name.',
            autocompletion=complete_template,
        ),
    ] = None,
) -> None:
    """List or show the templates.

    Templates are designs, scenes, plans of data sets, machines, materials, silicones and sensors.
    """
    if show is None:
        _list_templates(kind)
    else:
        _show_template(show if kind is None or "/" in show else f"{kind}/{show}")


class _Row(NamedTuple):
    """One template in the list."""

    kind: str
    name: str
    description: str
    source: str


def _list_templates(kind: Kind | None) -> None:
    from rich.table import Table

    from cmpdesign.design.templates import template_kinds, template_words

    rows = [
        _Row(each, name, *template_words(path))
        for each, names in template_kinds().items()
        if kind in (None, each)
        for name, path in names.items()
    ]
    for each in dict.fromkeys(row.kind for row in rows):
        table = Table(box=None, pad_edge=False)
        for heading in ("name", "description", *(["source"] if each == "designs" else [])):
            table.add_column(heading, overflow="fold")
        for row in rows:
            if row.kind == each:
                table.add_row(*row[1 : 1 + len(table.columns)])
        say(f"{'' if each == rows[0].kind else chr(10)}{each} ({TAKERS[each]})")
        say(table, soft_wrap=False)
    finish(lambda: _list_document(rows))


def _list_document(rows: list[_Row]) -> TemplatesDocument:
    from cmpdesign.documents.designs import TemplatePart, TemplatesDocument

    return TemplatesDocument(templates=tuple(TemplatePart(**row._asdict()) for row in rows))


def _show_template(name: str) -> None:
    from cmpdesign.cli.mode import current_mode
    from cmpdesign.design.templates import find_template
    from cmpdesign.documents.designs import TemplateDocument
    from cmpdesign.inputs.files import read_text

    kind, path = find_template(name)
    text = read_text(path)
    if not current_mode().as_json:
        print_document(text)
    finish(lambda: TemplateDocument(kind=kind, name=path.stem, text=text))
