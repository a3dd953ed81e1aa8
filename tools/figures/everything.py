"""All pictures and generated pages: file name -> content."""

from __future__ import annotations

from pathlib import Path

from . import api, commands, fields, gallery, measured, presets, reasons
from .pictures import (
    coded_pads,
    contact,
    drawings,
    failures,
    hero,
    lengths,
    scene_templates,
    sides,
    stages,
    surface,
)
from .pictures.tutorials import photos

DOCS = Path(__file__).resolve().parents[2] / "docs"
IMAGES = DOCS / "images"
PARTS = (
    hero,
    drawings,
    lengths,
    sides,
    stages,
    failures,
    coded_pads,
    gallery,
    contact,
    measured,
    scene_templates,
    surface,
    photos,
)


def pictures() -> dict[str, bytes]:
    """Name in docs/images -> PNG, SVG or JPEG."""
    found: dict[str, bytes] = {}
    for part in PARTS:
        found |= part.figures()
    return found


def pages() -> dict[Path, str]:
    """Path -> text of generated pages. Of design-files.md and extractor.md only tables are generated."""
    extractor = DOCS / "explanation" / "extractor.md"
    design_files = DOCS / "reference" / "design-files.md"
    return {
        DOCS / "reference" / "gallery.md": gallery.page(),
        DOCS / "reference" / "command-line.md": commands.page(),
        DOCS / "reference" / "api.md": api.page(),
        DOCS / "reference" / "reasons.md": reasons.page(),
        extractor: presets.filled(extractor.read_text(encoding="utf-8")),
        design_files: fields.filled(design_files.read_text(encoding="utf-8")),
        **measured.pages(),
    }
