"""Key figures of a design, and report.json."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cmpdesign import __version__
from cmpdesign.design.design import Design
from cmpdesign.layout.checks import CAMERA_PX, Finding, check_design
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.measures import cell_angles_deg, cell_widths_mm, edge_lengths_mm
from cmpdesign.patterns.colors import COLORS
from cmpdesign.patterns.pad_code import CodeFigures, code_figures


@dataclass(frozen=True)
class DesignReport:
    """Key figures.

    Attributes:
        name, pattern, source: the design's fields.
        layers, pitch_mm: the resolved values.
        markers: number of ids in the layout.
        present_markers: number of markers that touch a colored or white cell.
        cells: color -> number of cells.
        edges, virtual_markers: numbers of edges and of virtual markers on all edges.
        points: number of present and virtual markers together.
        size_mm: overall width and height, border included.
        shortest_edge_mm: length of the shortest edge.
        smallest_feature_mm: diameter of the largest circle inside the narrowest cell.
        sharpest_corner_deg: the smallest inner angle of all cells.
        digest: the layout's digest.
        code: key figures of the pad's code; None without a code.
        findings: the findings of ``check_design``.
    """

    name: str
    pattern: str
    source: str
    layers: int
    pitch_mm: float
    markers: int
    present_markers: int
    cells: Mapping[str, int]
    edges: int
    virtual_markers: int
    points: int
    size_mm: tuple[float, float]
    shortest_edge_mm: float
    smallest_feature_mm: float
    sharpest_corner_deg: float
    digest: str
    code: CodeFigures | None
    findings: tuple[Finding, ...]

    def figures(self) -> dict[str, str]:
        """The key figures, in words."""
        cells = ", ".join(f"{count} {color}" for color, count in self.cells.items() if count)
        absent = self.markers - self.present_markers
        rows = {
            "pattern": f"{self.pattern}, {self.layers} layers, pitch {self.pitch_mm:.4g} mm",
            "markers": f"{self.present_markers}" + (f" ({absent} more ids are never seen)" if absent else ""),
            "virtual markers": f"{self.virtual_markers} on {self.edges} edges ({self.points} points)",
            "cells": f"{sum(self.cells.values())}: {cells}",
            "overall size": "{:.2f} x {:.2f} mm, border included".format(*self.size_mm),
            "smallest feature": f"{self.smallest_feature_mm:.3f} mm (circle inside the narrowest cell)",
        }
        return rows if self.code is None else {**rows, "code": self.code.line()}


def design_report(design: Design, layout: Layout, camera_px: tuple[int, int] = CAMERA_PX) -> DesignReport:
    """The key figures of a design and its layout; ``camera_px`` as in ``check_design``.

    >>> from cmpdesign import build_layout, load
    >>> design = load("tac3d")
    >>> design_report(design, build_layout(design)).points
    4981
    """
    counts = np.bincount(layout.cell_color, minlength=len(COLORS)).tolist()
    present = int(layout.present.sum())
    virtual = len(layout.edges) * layout.virtual_per_edge
    return DesignReport(
        name=design.name,
        pattern=layout.pattern,
        source=design.source,
        layers=int(layout.parameters["layers"]),
        pitch_mm=float(layout.parameters["pitch_mm"]),
        markers=len(layout.marker_xy_mm),
        present_markers=present,
        cells=dict(zip(COLORS, counts, strict=True)),
        edges=len(layout.edges),
        virtual_markers=virtual,
        points=present + virtual,
        size_mm=layout.size_mm,
        shortest_edge_mm=round(float(edge_lengths_mm(layout).min()), 6),
        smallest_feature_mm=round(float(cell_widths_mm(layout).min()), 6),
        sharpest_corner_deg=round(float(cell_angles_deg(layout).min()), 6),
        digest=layout.digest,
        code=None if layout.code is None else code_figures(int(layout.parameters["layers"]), layout.code),
        findings=tuple(check_design(design, layout, camera_px)),
    )


def report_values(figures: DesignReport) -> dict[str, Any]:
    """The key figures by name; a design without a code has none of a code."""
    return {name: value for name, value in asdict(figures).items() if (name, value) != ("code", None)}


def report_to_json(figures: DesignReport, products: Mapping[str, Mapping[str, Any]] | None = None) -> str:
    """The text of report.json; ``products`` (name -> figures) are the key figures of the products."""
    document = {
        "format": "cmp-report",
        "version": 1,
        **report_values(figures),
        **(products or {}),
        "generator": f"cmpdesign {__version__}",
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"
