"""Pads rebuilt from written files, and their readings, independent of the products' predictions.

A pad is a list of colored polygons as the camera sees them: mm, x to the camera's right, y up. Bosses are sliced from
written meshes, burnt cells replayed from written programs; the picture is drawn by resvg.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import resvg_py
import shapely
import trimesh
from numpy.typing import NDArray

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from extractor import Extractor, parse_layout
from tests.support.laser_tools import groups_of, run_gcode

Points = NDArray[np.float64]
SIZE, FILL, FINER, BLUR_PX = (640, 480), 0.94, 6, 0.8


@dataclass(frozen=True)
class SeenCell:
    color: str
    outline_mm: Points


def sliced_bosses(mesh: Path, below_tip_mm: float = 1e-3) -> list[Points]:
    """Outlines of a written plate's bosses at their tips, in the plate's own frame (bosses up)."""
    body = trimesh.load(io.BytesIO(mesh.read_bytes()), file_type="stl")
    top = float(body.bounds[1][2])
    lines = trimesh.intersections.mesh_plane(body, (0, 0, 1), (0, 0, top - below_tip_mm))
    loops = shapely.get_parts(shapely.polygonize(shapely.linestrings(np.round(lines[..., :2], 6))))
    return [shapely.get_coordinates(loop.exterior)[:-1] for loop in loops]


def cast_pad(folder: Path, scale: float) -> list[SeenCell]:
    """The cells at the base layer, from the written plates, seen from below, where the camera is.

    A plate is used turned about x: y changes its sign. From below, x does. ``scale``: mold over cured silicone.
    """
    cells = []
    for mesh in sorted(folder.glob("mesh/mold-boss-*.stl")):
        color = mesh.stem.removeprefix("mold-boss-")
        cells += [SeenCell(color, loop * (-1.0, -1.0) / scale) for loop in sliced_bosses(mesh)]
    return cells


def carved_pad(
    folder: Path, origin_mm: Points, front_kerf_mm: Points, back_kerf_mm: Points, mirrored: bool
) -> list[SeenCell]:
    """The cells of the written programs at the seen side; a later burnt area replaces an earlier filling."""
    radii = (back_kerf_mm if mirrored else front_kerf_mm) / 2
    cells: list[SeenCell] = []
    for program in sorted(folder.glob("laser/[1-9]-*.gcode")):
        color = program.stem.split("-")[1]
        burnt = []
        for stroke in groups_of(run_gcode(program.read_text(encoding="utf-8"))):
            line = shapely.LineString(np.vstack([stroke[:, :2], stroke[-1:, 2:]]) / radii)
            rim = shapely.get_coordinates(shapely.buffer(line, 1.0, quad_segs=16).exterior)
            burnt.append(shapely.Polygon(rim * radii - origin_mm))
        tree = shapely.union_all(burnt)
        cells = [SeenCell(cell.color, part) for cell in cells for part in _without(cell.outline_mm, tree)]
        cells += [SeenCell(color, shapely.get_coordinates(hole.exterior)[:-1]) for hole in burnt]
    side = np.array([-1.0 if mirrored else 1.0, 1.0])
    return [SeenCell(cell.color, cell.outline_mm * side) for cell in cells]


def _without(outline: Points, later: shapely.Geometry) -> list[Points]:
    cell = shapely.Polygon(outline)
    if not cell.intersects(later):
        return [outline]
    parts = shapely.get_parts(cell.difference(later))
    return [shapely.get_coordinates(part.exterior)[:-1] for part in parts if part.geom_type == "Polygon"]


@dataclass(frozen=True)
class SeenPad:
    """Share of the present markers that are measured, and their deviation from the nominal layout in pitches."""

    share: float
    rms: float
    worst: float
    mirrored: bool | None


def picture_of(layout: Layout, cells: list[SeenCell]) -> tuple[NDArray[np.uint8], float]:
    """(H, W, 3) BGR of a pad on black ground, and its px per mm; the layout's origin is drawn where it lies."""
    px_mm = FILL * min(SIZE[0] / layout.size_mm[0], SIZE[1] / layout.size_mm[1])
    size = [n * FINER for n in SIZE]
    shapes = [f'<rect width="{size[0]}" height="{size[1]}" fill="{layout.palette["black"]}"/>']
    middle = _middle(layout)
    for cell in cells:
        x, y = (FINER * px_mm * (cell.outline_mm - middle) * (1, -1) + np.array(size) / 2).T
        points = "L".join(f"{a:.4f} {b:.4f}" for a, b in zip(x, y, strict=True))
        shapes.append(f'<path fill="{layout.palette[cell.color]}" d="M{points}Z"/>')
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]}" height="{size[1]}">'
    png = resvg_py.svg_to_bytes(svg_string=head + "".join(shapes) + "</svg>", skip_system_fonts=True)
    fine = cv2.imdecode(np.frombuffer(bytes(png), np.uint8), cv2.IMREAD_COLOR)
    of = np.arange(256.0)
    light_of = np.where(of <= 10, of / 3294.6, ((of / 255 + 0.055) / 1.055) ** 2.4).astype(np.float32)
    light = cv2.LUT(fine, light_of)
    light = cv2.GaussianBlur(cv2.resize(light, SIZE, interpolation=cv2.INTER_AREA), (0, 0), BLUR_PX)
    value = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055)
    return np.rint(255 * np.clip(value, 0, 1)).astype(np.uint8), px_mm


def _middle(layout: Layout) -> Points:
    """(2,) mm: the middle of the pad as the camera sees it."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    return np.asarray((low + high) / 2 * (-1.0 if layout.mirrored else 1.0, 1.0))


def read_seen(layout: Layout, cells: list[SeenCell]) -> SeenPad:
    """Read a pad with the nominal layout."""
    image, px_mm = picture_of(layout, cells)
    markers = Extractor(parse_layout(layout_to_json(layout)), side="either").extract(image)
    seen = layout.marker_xy_mm * (-1.0 if layout.mirrored else 1.0, 1.0)
    wanted = px_mm * (seen - _middle(layout)) * (1, -1) + (np.array(SIZE) - 1) / 2
    measured = layout.present & (markers.status == 1)
    off = np.hypot(*(markers.xy_px - wanted)[measured].T) / (px_mm * float(layout.parameters["pitch_mm"]))
    share = float(measured.sum() / layout.present.sum())
    if not len(off):
        return SeenPad(share, np.nan, np.nan, markers.mirrored)
    return SeenPad(share, float(np.sqrt((off**2).mean())), float(off.max()), markers.mirrored)
