"""DXF R2010 in millimetres: one laser layer per pass, closed LWPOLYLINEs, true extents."""

from __future__ import annotations

import io
from collections import OrderedDict
from itertools import pairwise
from typing import Any

from cmpdesign import __version__
from cmpdesign.libraries import extra
from cmpdesign.products.laser.formats.drawing import LaserDrawing
from cmpdesign.products.laser.formats.laser_layers import TOOL_LAYER, LaserLayer

# Values of $INSUNITS and $MEASUREMENT.
MILLIMETRES, METRIC = 4, 1
_ENTITIES = "  0\nSECTION\n  2\nENTITIES\n"
FIDUCIAL_LAYER = "T1"


def drawing_to_dxf(drawing: LaserDrawing) -> str:
    """Format the walls of the passes, and the fiducials as circles on the laser layer T1, which is not plotted."""
    with extra("laser"):
        from ezdxf._options import options
        from ezdxf.filemanagement import new

    # The option omits dates and random identifiers: the same bytes for the same job.
    fixed, options.write_fixed_meta_data_for_testing = options.write_fixed_meta_data_for_testing, True
    try:
        document = new("R2010")
        # The library adds classes in the order of a set, which differs from process to process.
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = OrderedDict(sorted(classes.classes.items()))
        _update_header(document, drawing)
        space = document.modelspace()
        for laser_pass in drawing.passes:
            _add_laser_layer(document, laser_pass.name, drawing.laser_layers[laser_pass.name])
        _add_laser_layer(document, FIDUCIAL_LAYER, TOOL_LAYER).dxf.plot = 0
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
    """The walls as text of the section ENTITIES, with the document's next free handles.

    The library needs 0.1 ms to make a polyline and 0.2 ms to write one, and each cell of a job is in two files.
    """
    handles, owner = document.entitydb.handles, document.modelspace().layout_key
    handle = int(str(handles), 16)
    parts: list[str] = []
    for laser_pass in drawing.passes:
        points = [f" 10\n{x!r}\n 20\n{y!r}\n" for x, y in laser_pass.walls.xy_mm.tolist()]
        for start, end in pairwise(laser_pass.walls.first.tolist()):
            head = (
                f"  0\nLWPOLYLINE\n  5\n{handle:X}\n330\n{owner}\n100\nAcDbEntity\n  8\n{laser_pass.name}\n"
            )
            parts += [head, f"100\nAcDbPolyline\n 90\n{end - start}\n 70\n1\n", *points[start:end]]
            handle += 1
    handles.reset(f"{handle:X}")
    return "".join(parts)


def _update_header(document: Any, drawing: LaserDrawing) -> None:
    extent, header, space = drawing.extent_mm, document.header, document.modelspace()
    low, high = (extent.left, extent.bottom), (extent.right, extent.top)
    header["$INSUNITS"], header["$MEASUREMENT"] = MILLIMETRES, METRIC
    header["$EXTMIN"], header["$EXTMAX"] = (*low, 0.0), (*high, 0.0)
    header["$LIMMIN"], header["$LIMMAX"] = low, high
    space.dxf_layout.dxf.extmin = (*low, 0.0)
    space.dxf_layout.dxf.extmax = (*high, 0.0)
    header.custom_vars.append("generator", f"cmpdesign {__version__}")


def _add_laser_layer(document: Any, name: str, laser_layer: LaserLayer) -> Any:
    return document.layers.add(name, color=laser_layer.aci, true_color=laser_layer.rgb)
