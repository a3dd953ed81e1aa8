"""DXF R2010 in millimetres: one layer a pass, closed LWPOLYLINEs, true extents."""

from __future__ import annotations

import io
from collections import OrderedDict
from itertools import pairwise
from typing import Any

from cmpdesign import __version__
from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import TOOL_LAYER, LaserLayer

MILLIMETRES, METRIC = 4, 1
_ENTITIES = "  0\nSECTION\n  2\nENTITIES\n"
FIDUCIAL_LAYER = "T1"


def drawing_to_dxf(drawing: LaserDrawing) -> str:
    """The walls of the passes, and the fiducials as circles on the layer T1, which is not plotted."""
    from ezdxf._options import options
    from ezdxf.filemanagement import new

    # No date and no random identifier: the same bytes for the same job.
    fixed, options.write_fixed_meta_data_for_testing = options.write_fixed_meta_data_for_testing, True
    try:
        document = new("R2010")
        # The library adds them in the order of a set, which differs from process to process.
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = OrderedDict(sorted(classes.classes.items()))
        _update_header(document, drawing)
        space = document.modelspace()
        for one in drawing.passes:
            _add_layer(document, one.name, drawing.layers[one.name])
        _add_layer(document, FIDUCIAL_LAYER, TOOL_LAYER).dxf.plot = 0
        for x, y in drawing.fiducials_mm.tolist():
            space.add_circle((x, y), drawing.fiducial_diameter_mm / 2, dxfattribs={"layer": FIDUCIAL_LAYER})
        polylines = _polyline_text(document, drawing)
        text = io.StringIO()
        document.write(text)
    finally:
        options.write_fixed_meta_data_for_testing = fixed
    before, entities, after = text.getvalue().partition(_ENTITIES)
    return before + entities + polylines + after


def _polyline_text(document: Any, drawing: LaserDrawing) -> str:
    """The walls as text for the section ENTITIES, with handles that the document leaves to them.

    The library takes a tenth of a millisecond for every polyline and twice that to write it; a job has each cell
    in two files.
    """
    handles, owner = document.entitydb.handles, document.modelspace().layout_key
    number_of = int(str(handles), 16)
    parts: list[str] = []
    for one in drawing.passes:
        points = [f" 10\n{x!r}\n 20\n{y!r}\n" for x, y in one.walls.xy_mm.tolist()]
        for start, end in pairwise(one.walls.first.tolist()):
            head = f"  0\nLWPOLYLINE\n  5\n{number_of:X}\n330\n{owner}\n100\nAcDbEntity\n  8\n{one.name}\n"
            parts += [head, f"100\nAcDbPolyline\n 90\n{end - start}\n 70\n1\n", *points[start:end]]
            number_of += 1
    handles.reset(f"{number_of:X}")
    return "".join(parts)


def _update_header(document: Any, drawing: LaserDrawing) -> None:
    left, bottom, right, top = drawing.extent_mm
    header = document.header
    header["$INSUNITS"], header["$MEASUREMENT"] = MILLIMETRES, METRIC
    header["$EXTMIN"], header["$EXTMAX"] = (left, bottom, 0.0), (right, top, 0.0)
    header["$LIMMIN"], header["$LIMMAX"] = (left, bottom), (right, top)
    document.modelspace().dxf_layout.dxf.extmin = (left, bottom, 0.0)
    document.modelspace().dxf_layout.dxf.extmax = (right, top, 0.0)
    document.header.custom_vars.append("generator", f"cmpdesign {__version__}")


def _add_layer(document: Any, name: str, layer: LaserLayer) -> Any:
    return document.layers.add(name, color=layer.aci, true_color=layer.rgb)
