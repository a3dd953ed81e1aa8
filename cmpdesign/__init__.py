"""Design, make and read multicolor continuous marker patterns (CMP) for vision-based tactile sensors.

    patterns  graphs, numbering and positions      contact   objects pressed into the elastic layer
    design    validated parameters of a pattern    scene     rendered images with exact ground truth
    layout    markers, cells, edges; checks        tracking  markers of videos and cameras as tables
    files     layout.json, images, videos          evaluate  the article's experiments, simulated
    products  drawings, lasers, molds, prints      cli       the command line
    reading   layouts and pictures verified

Each room imports only rooms above it, left column first. Public names are loaded at their first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cmpdesign.design.design import Design as Design
    from cmpdesign.design.design import load_design as load_design
    from cmpdesign.errors import CmpDesignError as CmpDesignError
    from cmpdesign.errors import DesignError as DesignError
    from cmpdesign.errors import OutputError as OutputError
    from cmpdesign.files.layout_json import layout_to_json as layout_to_json
    from cmpdesign.files.layout_json import write_layout as write_layout
    from cmpdesign.layout.build import build_layout as build_layout
    from cmpdesign.layout.checks import check_design as check_design
    from cmpdesign.layout.layout import Layout as Layout
    from cmpdesign.products.drawing.svg import write_svg as write_svg

__version__ = "0.1.0"

_HOMES = {
    "CmpDesignError": "cmpdesign.errors",
    "Design": "cmpdesign.design.design",
    "DesignError": "cmpdesign.errors",
    "Layout": "cmpdesign.layout.layout",
    "OutputError": "cmpdesign.errors",
    "build_layout": "cmpdesign.layout.build",
    "check_design": "cmpdesign.layout.checks",
    "layout_to_json": "cmpdesign.files.layout_json",
    "load_design": "cmpdesign.design.design",
    "write_layout": "cmpdesign.files.layout_json",
    "write_svg": "cmpdesign.products.drawing.svg",
}

__all__ = sorted([*_HOMES, "__version__"])


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'cmpdesign' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
