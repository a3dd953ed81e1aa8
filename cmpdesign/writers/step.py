"""STEP AP242: named, colored solids in mm, alone or as an assembly; the same bytes for the same solids."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Files carry no date of their own: that of the format's edition stands for it.
TIME_STAMP = "2014-12-01T00:00:00"


@dataclass(frozen=True)
class Solid:
    """A named, colored solid.

    Attributes:
        name: the product's name.
        color: "#rrggbb".
        shape: TopoDS_Solid, mm.
    """

    name: str
    color: str
    shape: Any


@dataclass(frozen=True)
class Place:
    """A solid's place in an assembly: first turned about the x axis (if ``turned``), then moved."""

    solid: Solid
    name: str
    xyz_mm: tuple[float, float, float]
    turned: bool = False


@dataclass(frozen=True)
class Assembly:
    """A named group of places and further groups."""

    name: str
    places: Sequence[Place]
    groups: Sequence[Assembly] = ()


def solid_to_step(solid: Solid) -> bytes:
    """A part's file."""
    document, shapes, colors = _document()
    _add_solid(solid, shapes, colors)
    return _written(document, solid.name)


def assembly_to_step(assembly: Assembly) -> bytes:
    """An assembly's file: each solid once, placed as often as it is used."""
    document, shapes, colors = _document()
    known: dict[str, Any] = {}
    _add_assembly(assembly, shapes, colors, known)
    shapes.UpdateAssemblies()
    return _written(document, assembly.name)


def _document() -> tuple[Any, Any, Any]:
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    main = document.Main()
    return document, XCAFDoc_DocumentTool.ShapeTool_s(main), XCAFDoc_DocumentTool.ColorTool_s(main)


def _add_solid(solid: Solid, shapes: Any, colors: Any) -> Any:
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.XCAFDoc import XCAFDoc_ColorType

    label = shapes.AddShape(solid.shape, False)
    _name(label, solid.name)
    rgb = [int(solid.color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    color = Quantity_Color(*rgb, Quantity_TypeOfColor.Quantity_TOC_sRGB)
    colors.SetColor(label, color, XCAFDoc_ColorType.XCAFDoc_ColorGen)
    return label


def _add_assembly(assembly: Assembly, shapes: Any, colors: Any, known: dict[str, Any]) -> Any:
    from OCP.TopLoc import TopLoc_Location

    label = shapes.NewShape()
    _name(label, assembly.name)
    for place in assembly.places:
        solid = place.solid
        if solid.name not in known:
            known[solid.name] = _add_solid(solid, shapes, colors)
        _name(shapes.AddComponent(label, known[solid.name], _location(place)), place.name)
    for group in assembly.groups:
        inner = _add_assembly(group, shapes, colors, known)
        _name(shapes.AddComponent(label, inner, TopLoc_Location()), group.name)
    return label


def _location(place: Place) -> Any:
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
    from OCP.TopLoc import TopLoc_Location

    move = gp_Trsf()
    if place.turned:
        import math

        move.SetRotation(gp_Ax1(gp_Pnt(0.0, 0.0, 0.0), gp_Dir(1.0, 0.0, 0.0)), math.pi)
    move.SetTranslationPart(gp_Vec(*place.xyz_mm))
    return TopLoc_Location(move)


def _name(label: Any, name: str) -> None:
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name

    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))


def _written(document: Any, name: str) -> bytes:
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.STEPControl import STEPControl_StepModelType

    with _silent(), tempfile.TemporaryDirectory(prefix="cmpdesign-") as folder:
        writer = STEPCAFControl_Writer()
        writer.SetColorMode(True)
        writer.SetNameMode(True)
        # Curves in the parameter plane only repeat what surfaces and edges say, and double the file.
        Interface_Static.SetIVal_s("write.surfacecurve.mode", 0)
        Interface_Static.SetCVal_s("write.step.schema", "AP242DIS")
        Interface_Static.SetCVal_s("write.step.unit", "MM")
        path = Path(folder) / "part.step"
        if not writer.Transfer(document, STEPControl_StepModelType.STEPControl_AsIs):
            raise RuntimeError(f"{name}: the STEP translator refused the solid")
        if writer.Write(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise RuntimeError(f"{name}: the STEP writer failed")
        return _canonical(path.read_bytes(), name)


def _canonical(data: bytes, name: str) -> bytes:
    """The file without what changes from run to run: time stamp, counters in names, order of the styles."""
    head, mark, body = data.decode("utf-8").partition("ENDSEC;")
    head = re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", f"'{TIME_STAMP}'", head)
    head = head.replace("'Open CASCADE Shape Model'", f"'{name}.step'", 1)
    numbers: dict[str, int] = {}

    def renumbered(match: re.Match[str]) -> str:
        # The counter's digits move the line's break, too.
        name, rest = match[2], re.sub(r"\n *", "", match[3])
        number = numbers.setdefault(match[1], len(numbers) + 1)
        return f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{number}',{name}{rest};\n"

    usage = r"NEXT_ASSEMBLY_USAGE_OCCURRENCE\('(\d+)',\s*('[^']*')(.*?);\n"
    body = re.sub(usage, renumbered, body, flags=re.DOTALL)
    return (head + mark + _styles_in_order(body)).encode("utf-8")


_STYLES = "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION"
_STYLE = """#{0} = MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(
    #{1}),#{context});
#{1} = STYLED_ITEM('color',(#{2}),#{item});
#{2} = PRESENTATION_STYLE_ASSIGNMENT((#{3}));
#{3} = SURFACE_STYLE_USAGE(.BOTH.,#{4});
#{4} = SURFACE_SIDE_STYLE('',(#{5}));
#{5} = SURFACE_STYLE_FILL_AREA(#{6});
#{6} = FILL_AREA_STYLE('',(#{7}));
#{7} = FILL_AREA_STYLE_COLOUR('',#{8});
#{8} = COLOUR_RGB('',{rgb});
"""
_STYLE_ENTITIES = 9


def _styles_in_order(body: str) -> str:
    """The styles, which stand last, by the solid that they color; the translator orders them by address."""
    first = re.search(rf"#(\d+) = {_STYLES}", body)
    if first is None:
        return body
    start, end = first.start(), body.index("ENDSEC;", first.start())
    entities = dict(re.findall(r"#(\d+) = (.*?);\n", body[start:end], flags=re.DOTALL))
    styles = []
    for text in entities.values():
        if not text.startswith(_STYLES):
            continue
        styled, context = re.findall(r"#(\d+)", text)
        item, rgb = _styled(entities, styled)
        styles.append((item, context, rgb))
    number, written = int(first[1]), ""
    for item, context, rgb in sorted(styles):
        numbers = range(number, number + _STYLE_ENTITIES)
        written += _STYLE.format(*numbers, context=context, item=item, rgb=rgb)
        number += _STYLE_ENTITIES
    return body[:start] + written + body[end:]


def _styled(entities: dict[str, str], number: str) -> tuple[int, str]:
    """The number of the entity that a STYLED_ITEM colors, and the color's text."""
    *styles, item = re.findall(r"#(\d+)", entities[number])
    todo = styles
    while todo:
        text = entities[todo.pop(0)]
        if text.startswith("COLOUR_RGB"):
            return int(item), text.partition(",")[2].rstrip(")")
        todo = re.findall(r"#(\d+)", text) + todo
    raise RuntimeError("STEP: a style without a color")


@contextmanager
def _silent() -> Any:
    """The translator reports every file on standard output; it must not."""
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
    """The file's shape (TopoDS_Shape), mm."""
    from OCP.STEPControl import STEPControl_Reader

    with _silent(), tempfile.TemporaryDirectory(prefix="cmpdesign-") as folder:
        path = Path(folder) / "part.step"
        path.write_bytes(data)
        reader = STEPControl_Reader()
        reader.ReadFile(str(path))
        reader.TransferRoots()
        return reader.OneShape()
