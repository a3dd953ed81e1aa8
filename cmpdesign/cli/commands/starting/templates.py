"""``cmpdesign templates``: lists and shows the templates."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from cmpdesign.api import making
from cmpdesign.cli.derived import derived
from cmpdesign.cli.mode import current_mode
from cmpdesign.cli.terminal import print_document, say, say_columns

if TYPE_CHECKING:
    from cmpdesign.documents.designs import TemplateDocument, TemplatesDocument

EXAMPLES = ("cmpdesign templates --kind scenes", "cmpdesign templates --show tac3d")
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


@derived(making.templates, "listing")
def templates(found: TemplatesDocument | TemplateDocument) -> None:
    """Templates are designs, scenes, plans of data sets, machines, materials, silicones and sensors."""
    if hasattr(found, "text"):
        if not current_mode().as_json:
            print_document(found.text)
        return
    gap = ""
    for kind, listed in groupby(found.templates, key=lambda each: each.kind):
        say(f"{gap}{kind} ({TAKERS[kind]})")
        headings = ("name", "description", *(["source"] if kind == "designs" else []))
        say_columns(headings, [[getattr(each, name) for name in headings] for each in listed], folds=True)
        gap = "\n"
