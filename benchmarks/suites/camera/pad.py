"""The outlines of a pad's colored cells, as designed or with the errors of printing and casting."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import Pad
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK, BLUE, COLORS, GREEN, RED
from cmpdesign.scene.camera.plain import pitch_mm
from cmpdesign.scene.parts.damage import bleed_polygons

Points = NDArray[np.float64]
ARC_POINTS = 9  # of a rounded corner
MAX_TANGENT = 0.45  # longest part of a side that a rounded corner may take


def colored_cells(layout: Layout) -> NDArray[np.int64]:
    """(K,) the numbers of the cells that are not black."""
    return np.flatnonzero(layout.cell_color != BLACK)


def cell_polygons_mm(layout: Layout, pad: Pad, pitch_px: float, rng: np.random.Generator) -> Points:
    """(K, n, 2) mm: the outlines of ``colored_cells``, counter-clockwise. n is 3, or more with rounded corners.

    ``pitch_px`` converts the pad's lengths in px.
    """
    cells, pitch = colored_cells(layout), pitch_mm(layout)
    polygons = layout.marker_xy_mm[layout.cell_corners[cells]]
    if pad.color_shift:
        shift = color_shifts(pad.color_shift * pitch, rng)
        polygons = polygons + shift[layout.cell_color[cells]][:, None]
    if pad.corner_scatter_px:
        polygons = polygons + _in_disc(polygons.shape[:2], rng) * (pad.corner_scatter_px * pitch / pitch_px)
    if pad.bleed:
        polygons = bleed_polygons(polygons, pad.bleed * pitch, rng)
    if pad.rounding:
        polygons = rounded_polygons(polygons, pad.rounding * pitch)
    return polygons


def color_shifts(longest: float, rng: np.random.Generator) -> Points:
    """(colors, 2): a shift for each color. The mean of red, green and blue is zero, the longest of them as given."""
    shift = rng.standard_normal((len(COLORS), 2))
    inks = [RED, GREEN, BLUE]
    shift[inks] -= shift[inks].mean(axis=0)
    shift[inks] /= np.linalg.norm(shift[inks], axis=1).max()
    others = [number for number in range(len(shift)) if number not in inks]
    shift[others] /= np.maximum(np.linalg.norm(shift[others], axis=1, keepdims=True), 1.0)
    return np.asarray(longest * shift)


def rounded_polygons(polygons: Points, radius: float) -> Points:
    """(K, n * ARC_POINTS, 2): convex polygons (K, n, 2), counter-clockwise, with corners rounded by circles.

    A corner's circle is smaller where its tangents would take more than ``MAX_TANGENT`` of a side.
    """
    before = np.roll(polygons, 1, axis=1) - polygons
    after = np.roll(polygons, -1, axis=1) - polygons
    length_before = np.linalg.norm(before, axis=2, keepdims=True)
    length_after = np.linalg.norm(after, axis=2, keepdims=True)
    before, after = before / length_before, after / length_after
    half = 0.5 * np.arccos(np.clip((before * after).sum(axis=2, keepdims=True), -1.0, 1.0))
    tangent = np.minimum(radius / np.tan(half), MAX_TANGENT * np.minimum(length_before, length_after))
    bisector = before + after
    bisector /= np.linalg.norm(bisector, axis=2, keepdims=True)
    centre = polygons + bisector * tangent / np.cos(half)
    start = polygons + tangent * before - centre
    # from one tangent point to the other the radius turns by 180 degrees less the corner's angle
    angle = np.linspace(0.0, 1.0, ARC_POINTS) * (np.pi - 2.0 * half)
    cos, sin = np.cos(angle), np.sin(angle)
    x = start[..., :1] * cos - start[..., 1:] * sin
    y = start[..., :1] * sin + start[..., 1:] * cos
    arcs = centre[:, :, None] + np.stack([x, y], axis=-1)
    return np.asarray(arcs.reshape(len(polygons), -1, 2))


def _in_disc(shape: tuple[int, ...], rng: np.random.Generator) -> Points:
    """(*shape, 2): points uniform in the unit disc."""
    radius, angle = np.sqrt(rng.uniform(0, 1, shape)), rng.uniform(0, 2 * np.pi, shape)
    return np.asarray(radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
