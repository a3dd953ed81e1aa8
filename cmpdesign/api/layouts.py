"""Layouts for programs: for the reader, for files, for notebooks."""

from __future__ import annotations

import re
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmpdesign.design.design import Design as Parameters
from cmpdesign.files.layout_json import layout_document, layout_to_json, write_layout
from cmpdesign.layout import layout as layouts
from cmpdesign.layout.build import build_layout as build

if TYPE_CHECKING:
    from extractor import LayoutLike, Reference

    AnyLayout = LayoutLike | layouts.Layout

NOTEBOOK_PX = 420  # longer side of a drawing in a notebook


class Layout(layouts.Layout):
    """A pattern's geometry: every marker, cell and edge in mm, seen from the front.

    >>> layout = cmpdesign.load("tac3d").layout
    >>> Extractor(layout).extract(image)                  # the reader takes a layout
    >>> layout.marker_xy_mm[217], layout.size_mm          # read-only arrays; the index in the array is the marker's id
    >>> layout.write("layout.json")

    The attributes are those of ``layout.json``: marker_layer, marker_index (M,) int32; marker_xy_mm (M, 2) float64;
    cell_corners (C, 3) int32; cell_color (C,) uint8, an index into red, green, blue, black, white; edges (E, 2) int32;
    present (M,) bool; virtual_xy_mm (E, m, 2); outline_mm (K, 2); size_mm; digest. A notebook shows the pattern.
    """

    @classmethod
    def of(cls, layout: layouts.Layout) -> Layout:
        """The same layout with the methods of this class; both share the read-only arrays."""
        if isinstance(layout, cls):
            return layout
        return cls(**{item.name: getattr(layout, item.name) for item in fields(layout)})

    def reference(self) -> Reference:
        """The reader's value of the layout: for ``Extractor``, ``Tracker`` and the other classes of ``extractor``."""
        return self._reference

    @cached_property
    def _reference(self) -> Reference:
        from extractor import parse_layout

        return parse_layout(self.to_json())

    def to_json(self) -> str:
        """The text of ``layout.json``; the same text for the same layout."""
        return layout_to_json(self)

    def to_dict(self) -> dict[str, Any]:
        """The JSON object of ``layout.json``; ``Extractor`` takes it, too."""
        return layout_document(self)

    def write(self, path: str | Path) -> None:
        """Write ``layout.json``.

        Raises:
            OutputError: the file cannot be written; an existing file is unchanged.
        """
        write_layout(self, path)

    def to_svg(self) -> str:
        """The pattern as SVG, true to size, in mm."""
        from cmpdesign.products.drawing.svg import layout_to_svg

        return layout_to_svg(self)

    def _repr_svg_(self) -> str:
        """The pattern as SVG in a size that can be seen in notebooks."""
        scale = NOTEBOOK_PX / max(self.size_mm)
        return re.sub(
            r'\b(width|height)="([\d.]+)mm"',
            lambda side: f'{side[1]}="{float(side[2]) * scale:.0f}"',
            self.to_svg(),
            count=2,
        )


def build_layout(design: Parameters) -> Layout:
    """The layout of a design: every marker, cell and edge, in the layout frame (mm).

    Raises:
        DesignError: the sizes cannot be resolved, there are too many virtual markers, or the clip outline removes the
            reference cell or one of its neighbours.

    >>> layout = build_layout(load("honeycomb", layers=10, pitch_mm=1.5))
    >>> len(layout.marker_xy_mm), len(layout.cell_corners), len(layout.edges)
    (331, 600, 930)
    """
    return Layout.of(build(design))


def read_layout(path: AnyLayout) -> Layout:
    """Read a ``layout.json``.

    Args:
        path: the file; or a ``Layout``, a ``Reference`` or the JSON object of a layout file.

    Raises:
        extractor.LayoutError: the file cannot be read or contradicts itself.
        TypeError: another value.
    """
    if isinstance(path, layouts.Layout):
        return Layout.of(path)
    from cmpdesign.reading.read_layout import layout_from_reference
    from extractor import layout_of

    return Layout.of(layout_from_reference(layout_of(path)))


def reference_from(given: AnyLayout) -> Reference:
    """The reader's value of a layout; ``given`` and errors as for ``read_layout``."""
    if isinstance(given, layouts.Layout):
        return Layout.of(given).reference()
    from extractor import layout_of

    return layout_of(given)
