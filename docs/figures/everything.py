"""All that is drawn and written: file name -> content."""

from __future__ import annotations

from pathlib import Path

from . import fields, gallery, measured
from .pictures import contact, drawings, hero, scene_templates, stages, surface

DOCS = Path(__file__).resolve().parent.parent
IMAGES = DOCS / "images"


def pictures() -> dict[str, bytes]:
    """Name in docs/images -> PNG or SVG."""
    found: dict[str, bytes] = {}
    for part in (hero, drawings, stages, gallery, contact, measured, scene_templates, surface):
        found |= part.figures()
    return found


def pages() -> dict[Path, str]:
    """Generated pages; docs/design-files.md keeps its prose, and only its tables are written."""
    design_files = DOCS / "design-files.md"
    return {
        DOCS / "gallery.md": gallery.page(),
        design_files: fields.filled(design_files.read_text(encoding="utf-8")),
        **measured.pages(),
    }
