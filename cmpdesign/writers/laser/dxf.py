"""DXF R2010 in millimetres: one layer a pass, closed LWPOLYLINEs, true extents."""

from __future__ import annotations

import io
from collections import OrderedDict
from typing import Any

from cmpdesign import __version__
from cmpdesign.writers.laser.drawing import Drawing
from cmpdesign.writers.laser.palette import TOOL, Layer

MILLIMETRES, METRIC = 4, 1
FIDUCIALS = "T1"


def drawing_to_dxf(drawing: Drawing) -> str:
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
        _header(document, drawing)
        space = document.modelspace()
        for one in drawing.passes:
            _layer(document, one.name, drawing.layers[one.name])
            attributes = {"layer": one.name}
            for path in one.walls:
                space.add_lwpolyline(path.tolist(), format="xy", close=True, dxfattribs=attributes)
        _layer(document, FIDUCIALS, TOOL).dxf.plot = 0
        for x, y in drawing.fiducials_mm.tolist():
            space.add_circle((x, y), drawing.fiducial_diameter_mm / 2, dxfattribs={"layer": FIDUCIALS})
        text = io.StringIO()
        document.write(text)
    finally:
        options.write_fixed_meta_data_for_testing = fixed
    return text.getvalue()


def _header(document: Any, drawing: Drawing) -> None:
    left, bottom, right, top = drawing.extent_mm
    header = document.header
    header["$INSUNITS"], header["$MEASUREMENT"] = MILLIMETRES, METRIC
    header["$EXTMIN"], header["$EXTMAX"] = (left, bottom, 0.0), (right, top, 0.0)
    header["$LIMMIN"], header["$LIMMAX"] = (left, bottom), (right, top)
    document.modelspace().dxf_layout.dxf.extmin = (left, bottom, 0.0)
    document.modelspace().dxf_layout.dxf.extmax = (right, top, 0.0)
    document.header.custom_vars.append("generator", f"cmpdesign {__version__}")


def _layer(document: Any, name: str, layer: Layer) -> Any:
    return document.layers.add(name, color=layer.aci, true_color=layer.rgb)
