"""Kerf, corners, pockets: closed forms against general geometry, and the burnt shape against a raster sweep."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_erosion
from scipy.spatial import cKDTree

from cmpdesign.patterns.colors import BLACK
from cmpdesign.products.laser.as_made import measure_as_made
from cmpdesign.products.laser.formats.drawing import job_drawing
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.paths.beam import BeamFootprint
from cmpdesign.products.laser.paths.cavities import (
    Cavities,
    burnt_areas_mm2,
    burnt_outlines_mm,
    burnt_shapes,
    make_cavities,
)
from cmpdesign.products.laser.paths.corners import balanced_spur_length, corner_residue_area, spur_area
from cmpdesign.products.laser.paths.fill import hatch_strokes, ring_strokes
from cmpdesign.products.laser.paths.kerf import inset_outline, inset_polygons, outset_outline, polygon_areas
from cmpdesign.products.laser.paths.webs import burn_depth_mm
from tests.support.laser_tools import PIXEL_MM, Points, filled, groups_of, made_job, run_gcode, swept

TRIANGLE = 1.5 * np.array([(0, 0), (1, 0), (0.5, np.sqrt(0.75))])


@st.composite
def triangles(draw: st.DrawFn) -> Points:
    """One triangle of about 1.5 mm, turned and stretched as elliptical patterns do."""
    angle = draw(st.floats(0, 6.28))
    aspect = draw(st.floats(0.6, 1.6))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return (TRIANGLE @ turn.T * (1, aspect))[None]


def by_shapely(made: Cavities, beam: BeamFootprint) -> shapely.Polygon:
    """The burn of the first cavity, by a general-purpose buffer of the path and its spurs."""
    path = shapely.Polygon(beam.to_beam_units(made.path_mm[0]))
    ends = [
        (beam.to_beam_units(p), beam.to_beam_units(t))
        for p, t in zip(made.path_mm[0], made.tip_mm[0], strict=True)
    ]
    spurs = [shapely.LineString(end) for end in ends if not np.array_equal(*end)]
    burnt = shapely.buffer(shapely.union_all([path, *spurs]), 1.0, quad_segs=128)
    return shapely.Polygon(beam.to_millimetres(shapely.get_coordinates(burnt.exterior)))


@settings(max_examples=40, deadline=None)
@given(triangles(), st.floats(0.02, 0.25), st.floats(0.02, 0.25), st.sampled_from(["plain", "overcut"]))
def test_burnt_areas_and_outlines_are_exact(cell: Points, kerf_x: float, kerf_y: float, corner: str) -> None:
    front = BeamFootprint.of_kerf(kerf_x, kerf_y)
    made = make_cavities(np.arange(1), cell, front, corner)  # type: ignore[arg-type]
    for beam in (front, front.at_depth(0.2, 1.0)):
        expected = by_shapely(made, beam)
        assert burnt_areas_mm2(made, beam)[0] == pytest.approx(expected.area, rel=1e-4)
        outline = shapely.Polygon(burnt_outlines_mm(made, beam)[0])
        assert outline.is_valid
        # Chords of the corners' arcs stay within a third of a micrometre.
        assert shapely.hausdorff_distance(outline.exterior, expected.exterior) < 3.3e-4


@settings(max_examples=40, deadline=None)
@given(triangles(), st.floats(0.5, 0.99), st.floats(0.7, 1.4), st.sampled_from(["plain", "overcut"]))
def test_beams_as_wide_as_the_cell_burn_valid_shapes(
    cell: Points, share: float, ratio: float, corner: str
) -> None:
    """Burns of two spurs overlap; a cell's neighbour is burnt to the depth that a general-purpose library computes."""
    inscribed = 4 * polygon_areas(cell)[0] / shapely.Polygon(cell[0]).length
    front = BeamFootprint.of_kerf(share * inscribed, share * inscribed * ratio)
    made = make_cavities(np.arange(1), cell, front, corner)  # type: ignore[arg-type]
    assume(made.exists.all())
    for beam in (front, front.at_depth(0.05, 1.0)):
        expected = by_shapely(made, beam)
        outlines = burnt_outlines_mm(made, beam)
        (shape,) = burnt_shapes(outlines)
        assert shape.is_valid and shape.geom_type == "Polygon"
        assert burnt_areas_mm2(made, beam)[0] == pytest.approx(expected.area, rel=4e-3)
        assert shapely.hausdorff_distance(shape.exterior, expected.exterior) < 3e-3
        beside = outlines + (0.4, 0.1)
        cut = shapely.intersection(expected, shapely.affinity.translate(expected, 0.4, 0.1))
        deepest = shapely.points(shapely.get_coordinates(shapely.segmentize(cut, 0.01)))
        rim = shapely.distance(deepest, expected.exterior)
        assert burn_depth_mm(beside, outlines) == pytest.approx(rim.max(initial=0.0), abs=1e-2)


@settings(max_examples=40, deadline=None)
@given(triangles(), st.floats(0.02, 0.25), st.floats(0.02, 0.25))
def test_the_path_touches_every_side_from_inside(cell: Points, kerf_x: float, kerf_y: float) -> None:
    beam = BeamFootprint.of_kerf(kerf_x, kerf_y)
    path, exists = inset_polygons(cell, beam)
    assert exists.all()
    general = inset_outline(cell[0], beam)
    assert len(general) == 1
    assert shapely.hausdorff_distance(shapely.LinearRing(general[0]), shapely.LinearRing(path[0])) < 1e-9
    burnt = shapely.Polygon(burnt_outlines_mm(make_cavities(np.arange(1), cell, beam, "plain"), beam)[0])
    nominal = shapely.Polygon(cell[0])
    outside = shapely.distance(shapely.points(shapely.get_coordinates(burnt)), nominal)
    assert outside.max() < 1e-9
    for start, end in zip(cell[0], np.roll(cell[0], -1, axis=0), strict=True):
        assert shapely.distance(burnt.exterior, shapely.LineString([start, end])) < 1e-9


@given(st.floats(0.1, 3.0))
def test_a_balanced_spur_burns_what_it_leaves(angle: float) -> None:
    half = np.array([angle / 2])
    length = balanced_spur_length(half)
    assert spur_area(half, length) == pytest.approx(corner_residue_area(half), rel=1e-6, abs=1e-12)
    assert 0 <= length[0] < 1 / np.sin(half[0])


def test_three_corners_lose_what_the_formula_says() -> None:
    for radius in (0.015, 0.05, 0.125):
        beam = BeamFootprint(radius, radius)
        made = make_cavities(np.arange(1), TRIANGLE[None], beam, "plain")
        lost = polygon_areas(TRIANGLE[None]) - burnt_areas_mm2(made, beam)
        assert lost[0] == pytest.approx(2.0546 * radius**2, rel=1e-3)


@pytest.mark.parametrize(
    ("corner", "kerf_mm"),
    [("plain", 0.03), ("plain", 0.1), ("overcut", 0.03), ("overcut", 0.1), ("overcut", 0.25)],
)
@pytest.mark.parametrize("name", ["honeycomb", "round"])
def test_areas_are_nominal(name: str, corner: str, kerf_mm: float) -> None:
    """Areas are within 0.6 % of the nominal cells of 1.5 mm: plain up to 0.1 mm, overcut up to 0.25 mm of kerf."""
    job = made_job(name, laser__corner=corner, laser__kerf_mm=str(kerf_mm), laser__depth_mm="0.2mm")
    for one in measure_as_made(job):
        assert abs(one.front.area_error_percent) < 0.6
    if name == "honeycomb" and corner == "plain":
        wider = made_job(name, laser__corner=corner, laser__kerf_mm="0.25", laser__depth_mm="0.2mm")
        assert measure_as_made(wider)[0].front.area_error_percent == pytest.approx(
            -100 * 2.0546 * 0.125**2 / 0.97428, rel=1e-3
        )


def test_corner_losses_are_as_stated() -> None:
    """Up to half a kerf of a 60 degree corner by plain paths, about two thirds of that with spurs."""
    plain, spurred = (
        measure_as_made(made_job(laser__corner=c, laser__kerf_mm="0.2", laser__depth_mm="0.1"))[0].front
        for c in ("plain", "overcut")
    )
    assert plain.corner_loss_mm == pytest.approx(0.1, abs=1e-6)
    assert spurred.corner_loss_mm == pytest.approx(0.1 * (1 - 0.34858), abs=1e-5)
    assert plain.burnt_beside_mm == 0
    assert spurred.burnt_beside_mm == pytest.approx(0.1 * 0.34858 / 2, abs=1e-5)


@pytest.mark.parametrize(
    ("kerf_mm", "corner"),
    [((0.03, 0.03), "plain"), ((0.16, 0.12), "plain"), ((0.1, 0.13), "overcut"), ((0.25, 0.25), "overcut")],
    ids=str,
)
def test_predictions_agree_with_a_raster_sweep_of_the_gcode(
    kerf_mm: tuple[float, float], corner: str
) -> None:
    """Area within 0.5 % and webs within 3 micrometres, at both faces, of pixels of 2 micrometres."""
    kerf = {"laser__kerf_x_mm": str(kerf_mm[0]), "laser__kerf_y_mm": str(kerf_mm[1])}
    job = made_job(laser__corner=corner, layers="2", laser__depth_mm="0.2", laser__taper_deg="1", **kerf)
    drawing, figures = job_drawing(job), measure_as_made(job)
    for face, beam in (("front", job.front), ("back", job.back)):
        filled_before: list[Points] = []
        for one, predicted in zip(job.cell_passes, figures, strict=True):
            strokes = groups_of(run_gcode(drawing_to_gcode(drawing.with_one_pass(one))))
            swept_cells = [pixels_of(stroke, beam.kerf_mm) for stroke in strokes]
            figure = getattr(predicted, face)
            nominal = polygon_areas(one.cavities.nominal_mm).sum()  # type: ignore[union-attr]
            area, burns = sum(area for area, _ in swept_cells), [rim for _, rim in swept_cells]
            assert 100 * (area / nominal - 1) == pytest.approx(figure.area_error_percent, abs=0.5)
            if figure.web_mm is not None:
                gaps = min(smallest_gap(burns[i], burns[i + 1 :]) for i in range(len(burns) - 1))
                assert gaps == pytest.approx(figure.web_mm, abs=0.003)
            if figure.web_to_filled_mm is not None and figure.web_to_filled_mm > 0:
                gaps = min(smallest_gap(burn, filled_before) for burn in burns)
                assert gaps == pytest.approx(figure.web_to_filled_mm, abs=0.003)
            elif figure.web_to_filled_mm is not None:
                meeting = min(smallest_gap(burn, filled_before) for burn in burns)
                assert meeting <= 2 * PIXEL_MM
            filled_before += burns


def pixels_of(stroke: Points, kerf_mm: tuple[float, float]) -> tuple[float, Points]:
    """Area in mm2, and (N, 2) rim pixels in mm, of the part that a closed stroke burns or cuts out."""
    margin = 0.3
    low, high = stroke.reshape(-1, 2).min(axis=0) - margin, stroke.reshape(-1, 2).max(axis=0) + margin
    low = np.floor(low / PIXEL_MM) * PIXEL_MM
    burnt = filled(swept(stroke, kerf_mm, (low[0], low[1], high[0], high[1])))
    rows, columns = np.nonzero(burnt & ~binary_erosion(burnt))
    return float(burnt.sum()) * PIXEL_MM**2, np.column_stack([columns, rows]) * PIXEL_MM + low + PIXEL_MM / 2


def smallest_gap(one: Points, others: list[Points]) -> float:
    """Between the rims: on average they lie half a pixel beyond the centres of the last burnt pixels."""
    tree = cKDTree(one)
    return min((float(tree.query(other)[0].min()) for other in others), default=np.inf) - PIXEL_MM


@pytest.mark.parametrize("angle_deg", [0.0, 67.0, 134.0])
def test_hatches_clear_the_pocket_and_stay_inside(angle_deg: float) -> None:
    cells = np.concatenate([TRIANGLE[None], TRIANGLE[None] @ np.diag([-1, -1])])
    beam = BeamFootprint.of_kerf(0.16, 0.12)
    made = make_cavities(np.arange(2), cells, beam, "plain")
    lines = hatch_strokes(made.path_mm, 0.1, angle_deg)
    assert set(lines.owner.tolist()) == {0, 1} and not lines.closed
    for cell in range(2):
        segments = [line for line, owner in zip(lines, lines.owner, strict=True) if owner == cell]
        wall = shapely.LinearRing(beam.to_beam_units(made.path_mm[cell]))
        strokes = [shapely.LineString(beam.to_beam_units(line)) for line in segments]
        inside = shapely.Polygon(beam.to_beam_units(made.path_mm[cell]))
        assert all(inside.buffer(2e-3).contains(stroke) for stroke in strokes)
        burnt = shapely.union_all([shapely.buffer(stroke, 1.0, quad_segs=64) for stroke in [wall, *strokes]])
        assert burnt.area * beam.area_factor == pytest.approx(burnt_areas_mm2(made, beam)[cell], rel=1e-3)
        # No ridge stays, and lines run to and fro.
        assert not burnt.interiors
        directions = np.array([line[1] - line[0] for line in segments]) @ [
            np.cos(np.radians(angle_deg)),
            np.sin(np.radians(angle_deg)),
        ]
        assert (directions[:-1] * directions[1:] < 0).all()


def test_rings_clear_the_pocket_from_the_inside_out() -> None:
    beam = BeamFootprint.of_kerf(0.16, 0.12)
    made = make_cavities(np.arange(2), np.concatenate([TRIANGLE[None], TRIANGLE[None] + 3]), beam, "plain")
    inner = ring_strokes(made.path_mm, 0.06)
    assert inner.closed and list(inner.owner) == sorted(inner.owner)
    areas = [shapely.Polygon(ring).area for ring, owner in zip(inner, inner.owner, strict=True) if owner == 0]
    assert areas == sorted(areas) and len(areas) > 3
    strokes = [
        shapely.LinearRing(beam.to_beam_units(ring)) for ring in [made.path_mm[0], *inner][: 1 + len(areas)]
    ]
    burnt = shapely.union_all([shapely.buffer(stroke, 1.0, quad_segs=64) for stroke in strokes])
    assert not burnt.interiors
    assert burnt.area * beam.area_factor == pytest.approx(burnt_areas_mm2(made, beam)[0], rel=1e-3)


def test_an_outline_is_cut_from_outside() -> None:
    beam = BeamFootprint.of_kerf(0.2, 0.1)
    star = np.array(
        [
            (np.cos(a) * r, np.sin(a) * r)
            for a, r in zip(np.linspace(0, 2 * np.pi, 10, endpoint=False), [5, 3] * 5, strict=True)
        ]
    )
    (path,) = outset_outline(star, beam)
    burnt = shapely.buffer(shapely.LinearRing(beam.to_beam_units(path)), 1.0, quad_segs=64)
    pad = shapely.Polygon(beam.to_millimetres(shapely.get_coordinates(burnt.interiors[0])))
    # The pad keeps its size but for its inner corners, which a round beam leaves round.
    assert shapely.difference(shapely.Polygon(star), shapely.buffer(pad, 1e-3)).area < 1e-6
    assert pad.area == pytest.approx(shapely.Polygon(star).area, rel=2e-3)


def test_every_carved_cell_is_in_one_pass() -> None:
    for name in ("honeycomb", "round", "elliptical", "square"):
        job = made_job(name)
        cells = np.concatenate([one.cavities.cell for one in job.cell_passes])  # type: ignore[union-attr]
        assert sorted(cells.tolist()) == np.flatnonzero(job.layout.cell_color != BLACK).tolist()
        for one in job.cell_passes:
            assert one.cavities is not None
            corners = job.layout.cell_corners[one.cavities.cell]
            assert len(np.unique(corners)) == corners.size, "cells of a pass never touch"
            assert len(set(job.layout.cell_color[one.cavities.cell].tolist())) == 1
