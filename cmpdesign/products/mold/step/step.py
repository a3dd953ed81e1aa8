"""STEP AP242: a named, colored solid in mm; the same bytes for the same solid."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmpdesign.libraries import extra
from cmpdesign.products.mold.step.entities import StepEntities, add_context, add_product, format_real
from cmpdesign.products.mold.step.shape import add_solid

PART = "ADVANCED_BREP_SHAPE_REPRESENTATION"


@dataclass(frozen=True)
class NamedSolid:
    """A named, colored solid.

    Attributes:
        name: name of the product, ASCII.
        color: "#rrggbb".
        shape: TopoDS_Solid, mm.
    """

    name: str
    color: str
    shape: Any


def solid_to_step(solid: NamedSolid) -> bytes:
    """Format the STEP file of a part.

    Raises:
        RuntimeError: a solid that ``add_solid`` cannot write.
    """
    entities = StepEntities()
    body = add_solid(solid.shape, entities)
    context = add_context(entities)
    _add_color(solid.color, body, context, entities)
    add_product(solid.name, PART, (body,), context, entities)
    return entities.to_bytes(solid.name)


def _add_color(color: str, body: int, context: int, entities: StepEntities) -> None:
    red, green, blue = (format_real(int(color[i : i + 2], 16) / 255) for i in (1, 3, 5))
    number = entities.add(f"COLOUR_RGB('',{red},{green},{blue})")
    number = entities.add(f"FILL_AREA_STYLE_COLOUR('',#{number})")
    number = entities.add(f"FILL_AREA_STYLE('',(#{number}))")
    number = entities.add(f"SURFACE_STYLE_FILL_AREA(#{number})")
    number = entities.add(f"SURFACE_SIDE_STYLE('',(#{number}))")
    number = entities.add(f"SURFACE_STYLE_USAGE(.BOTH.,#{number})")
    number = entities.add(f"PRESENTATION_STYLE_ASSIGNMENT((#{number}))")
    number = entities.add(f"STYLED_ITEM('color',(#{number}),#{body})")
    entities.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(#{number}),#{context})")


@contextmanager
def _silenced_output() -> Any:
    """Suppress the reports of the kernel's reader on standard output."""
    with extra("cad"):
        from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    for printer in printers:
        messenger.RemovePrinter(printer)
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


def read_step(data: bytes) -> Any:
    """Read the shape (TopoDS_Shape) of a file with the kernel's own reader, mm."""
    with extra("cad"):
        from OCP.STEPControl import STEPControl_Reader

    with _silenced_output(), tempfile.TemporaryDirectory(prefix="cmpdesign-") as folder:
        path = Path(folder) / "part.step"
        path.write_bytes(data)
        reader = STEPControl_Reader()
        reader.ReadFile(str(path))
        reader.TransferRoots()
        return reader.OneShape()
