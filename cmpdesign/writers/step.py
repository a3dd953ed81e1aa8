"""STEP AP242: a named, colored solid in mm; the same bytes for the same solid."""

from __future__ import annotations

import re
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Files carry no date of their own: that of the format's edition stands for it.
TIME_STAMP = b"2014-12-01T00:00:00"


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


def solid_to_step(solid: Solid) -> bytes:
    """A part's file."""
    document, shapes, colors = _document()
    _add_solid(solid, shapes, colors)
    return _written(document, solid.name)


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
    colors.SetColor(label, color, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    return label


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
    """The file under its own name, and without the time of its writing."""
    head, mark, body = data.partition(b"ENDSEC;")
    head = re.sub(rb"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", b"'%s'" % TIME_STAMP, head)
    return head.replace(b"'Open CASCADE Shape Model'", f"'{name}.step'".encode(), 1) + mark + body


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
