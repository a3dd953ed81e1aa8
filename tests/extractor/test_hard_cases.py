"""Hard cases: each gives right places, or lost markers with a reason; never a NaN that spreads, nor a wrong id.

``docs/hard-cases.md`` lists them. Warnings are errors in every test here, as everywhere.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.scene import (
    Blob,
    Camera,
    Damage,
    Light,
    Optics,
    Press,
    Rendered,
    Scene,
    Sensor,
    composed,
    render,
)
from cmpdesign.scene.standard import BLACK_RGB, INKS, standard_layout, standard_scene
from extractor import Extractor, Markers, Status, parse_layout
from extractor.cells.cell_mesh import build_cell_mesh
from extractor.cells.cells import Cells
from extractor.cells.region_growing import grow
from extractor.cells.seeds import find_seeds
from extractor.cells.triangle_fit import fit_triangles
from extractor.complete.repair import repair_markers
from extractor.image.ink_segmentation import Segmentation
from extractor.layout.lattice_tables import lattice_of
from extractor.layout.topology import topology_of
from extractor.localmap.neighbour_prediction import predict_markers
from extractor.numbering.marker_places import InitialMarkers
from extractor.presets import PRESETS
from extractor.refine.drawn_pattern import DrawingBuffers, allocate_drawing_buffers
from extractor.refine.estimate import RefinedMarkers
from extractor.refine.solve.fisher_information import covariances, solve_shifts
from extractor.refine.solve.shared_pixels import overlap
from extractor.refine.synthesis_steps import SynthesisSolver

ROOT = Path(__file__).parents[2]
NAMED_TEST = re.compile(r"`([\w/]+)::(test_\w+)`")  # folder/file::function, below tests/
LAYERS = 5
SIZE = (300, 260)
WRONG = 0.3  # of the shortest edge
Image = NDArray[np.uint8]


@cache
def extractor(pattern: str = "honeycomb", preset: str = "balanced") -> Extractor:
    return Extractor(parse_layout(layout_to_json(standard_layout(pattern, LAYERS))), preset)  # type: ignore[arg-type]


@cache
def scene(pattern: str = "honeycomb") -> Scene:
    return standard_scene(standard_layout(pattern, LAYERS))


def sound(markers: Markers, seen: Rendered | None = None) -> NDArray[np.bool_]:
    """Which markers were found; fails where anything is half known, or has another marker's id."""
    found = markers.status != Status.LOST
    np.testing.assert_array_equal(np.isfinite(markers.xy_px), np.stack([found, found], axis=1))
    assert np.isfinite(markers.cov_px2[found]).all() and np.isnan(markers.cov_px2[~found]).all()
    assert (np.linalg.eigvalsh(markers.cov_px2[found]) > 0).all()
    assert (markers.reason is not None) == (markers.mirrored is None)
    if markers.reason is None:
        refined = markers.stages["refine"]
        assert np.isfinite(refined.blur_px) and np.isfinite(refined.noise)
    placed = markers.virtual_status != 0
    np.testing.assert_array_equal(np.isfinite(markers.virtual_xy_px[..., 0]), placed)
    assert (
        np.isfinite(markers.virtual_cov_px2[placed]).all()
        and np.isnan(markers.virtual_cov_px2[~placed]).all()
    )
    assert (np.linalg.eigvalsh(markers.virtual_cov_px2[placed]) > 0).all()
    if seen is not None:
        true = seen.truth.marker_xy_px
        edges = extractor().layout.edges
        shortest = np.linalg.norm(true[edges[:, 0]] - true[edges[:, 1]], axis=1).min()
        assert not (np.linalg.norm(markers.xy_px - true, axis=1) > WRONG * shortest).any()
    return np.asarray(found)


def rms(markers: Markers, seen: Rendered) -> float:
    error = (markers.xy_px - seen.truth.marker_xy_px)[markers.status == Status.MEASURED]
    return float(np.sqrt(np.mean(error**2)))


# -- colors


@pytest.mark.parametrize(
    "red", [(200.0, 40.0, 45.0), (200.0, 40.0, 40.0), (200.0, 45.0, 40.0), (200.0, 20.0, 60.0)]
)
def test_red_straddles_the_wrap(red: tuple[float, float, float]) -> None:
    """Hues of 358, 0, 2 and 347 degrees: with noise, the 8-bit hue jumps between 0 and 179 within a cell."""
    seen = render(replace(scene(), inks={**INKS, "red": red}, sensor=Sensor(noise=4.0)), size=SIZE)
    markers = extractor().extract(seen.image)
    assert sound(markers, seen).all() and rms(markers, seen) < 0.03


def test_black_and_clipped_seeds_do_not_divide() -> None:
    """Domains whose pixels are all (0, 0, 0), and all (0, 0, 255), in HSV: P . mean is 0, and as large as it gets."""
    label = np.zeros((40, 60), np.uint8)
    label[10:20, 5:15], label[10:20, 25:35], label[25:35, 5:15] = 1, 2, 3
    hsv = np.zeros((40, 60, 3), np.uint8)
    hsv[10:20, 25:35] = (0, 0, 255)
    hsv[25:35, 5:15] = (179, 255, 255)
    segmentation = Segmentation(
        hsv=hsv, label=label, hues_deg=np.array([0.0, 120.0, 240.0]), chroma=np.full(3, 150.0)
    )
    with np.errstate(all="raise"):
        regions = grow(segmentation, find_seeds(segmentation))
    assert np.isfinite(regions.moments).all()
    np.testing.assert_array_equal(np.sort(regions.moments[:, 0]), (1, 100, 100))


def test_seeds_in_black_lose_their_cells_only() -> None:
    """The middles of some cells are painted black, and of others white."""
    seen = render(scene(), size=SIZE)
    image = np.asarray(seen.image).copy()
    corners = scene().layout.cell_corners[:30]
    for number, (x, y) in enumerate(seen.truth.marker_xy_px[corners].mean(axis=1)):
        cv2.circle(image, (round(x), round(y)), 2, (0, 0, 0) if number % 2 else (255, 255, 255), -1)
    assert sound(extractor().extract(image), seen).mean() > 0.85


@pytest.mark.parametrize("gray", [0, 60, 128, 255])
def test_achromatic_regions_are_no_cells(gray: int) -> None:
    """Patches whose hue is undefined, on the pattern and beside it."""
    seen = render(scene(), size=SIZE)
    image = np.asarray(seen.image).copy()
    image[100:118, 60:78] = image[5:30, 5:30] = gray
    found = sound(extractor().extract(image), seen)
    assert found.mean() > 0.9


@pytest.mark.parametrize(("gain", "limit_px"), [((1.2, 1.2, 1.2), 0.03), ((1.6, 1.9, 1.6), 0.4)])
def test_saturated_channels_are_read(gain: tuple[float, float, float], limit_px: float) -> None:
    """Light that clips the white cell, and light that clips every ink's own channel: that moves its edges outward."""
    seen = render(replace(scene(), light=Light(rgb=gain)), size=SIZE)
    assert (np.asarray(seen.image) == 255).any(axis=(0, 1)).all()
    markers = extractor().extract(seen.image)
    assert sound(markers, seen).all() and rms(markers, seen) < limit_px


# -- shapes


def test_regions_of_one_pixel_are_clutter() -> None:
    """Single pixels of every ink all over the picture."""
    seen = render(scene(), size=SIZE)
    image = np.asarray(seen.image).copy()
    rng = np.random.default_rng(1)
    y, x = rng.integers(0, SIZE[1], 300), rng.integers(0, SIZE[0], 300)
    image[y, x] = np.array([(45, 50, 200), (60, 150, 40), (190, 60, 45)], np.uint8)[np.arange(300) % 3]
    assert sound(extractor().extract(image), seen).mean() > 0.95


@pytest.mark.parametrize("grain_px", [0.7, 2.0, 4.0])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_a_pattern_amid_colored_noise_is_read(pattern: str, grain_px: float) -> None:
    """Thousands of domains all around, so many that only what looks like a cell is looked at; coarse ones, too."""
    seen = render(scene(pattern), size=SIZE)
    grain = np.random.default_rng(2).standard_normal((600, 800, 3), dtype=np.float32)
    grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), grain_px))
    image = np.clip(127 + 70 * grain / grain.std(), 0, 255).astype(np.uint8)
    within = cv2.convexHull(np.rint(seen.truth.marker_xy_px).astype(np.int32))
    mask = cv2.dilate(cv2.fillConvexPoly(np.zeros(SIZE[::-1], np.uint8), within, 1), np.ones((15, 15)))
    image[: SIZE[1], : SIZE[0]][mask > 0] = seen.image[mask > 0]
    markers = extractor(pattern).extract(image)
    assert markers.stages["seeds"].cluttered
    assert sound(markers, seen).all() and rms(markers, seen) < 0.05


def test_of_an_image_of_noise_hardly_any_domain_becomes_a_cell() -> None:
    grain = np.random.default_rng(1).standard_normal((480, 640, 3), dtype=np.float32)
    grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), 1.0))
    image = np.clip(127 + 70 * grain / grain.std(), 0, 255).astype(np.uint8)
    markers = extractor().extract(image)
    assert not sound(markers).any() and markers.reason is not None
    assert markers.stages["seeds"].cluttered
    everything = find_seeds(markers.stages["segment"])
    assert len(markers.stages["cells"].ink) < 0.2 * len(everything.ink)


def test_collinear_corners_are_no_triangle() -> None:
    """Regions one pixel wide: the determinant of their covariance is that of the pixel alone, or 0."""
    for mask in (np.eye(64, dtype=bool), np.arange(64)[:, None] == np.full(64, 31), np.zeros((64, 64), bool)):
        label = np.zeros((64, 64), np.uint8)
        label[mask] = 1
        image = np.zeros((64, 64, 3), np.uint8)
        image[mask] = (40, 40, 200)
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        segmentation = Segmentation(hsv, label, np.array([0.0, 120.0, 240.0]), np.full(3, 150.0))
        assert len(fit_triangles(image, grow(segmentation, find_seeds(segmentation))).ink) == 0


def cells_at(center_px: NDArray[np.float64], ink: NDArray[np.uint8]) -> Cells:
    return Cells(center_px, ink, np.full(len(ink), 40.0), np.full((len(ink), 3, 2), np.nan))


def test_centers_on_a_line_or_on_one_point_make_no_mesh() -> None:
    ink = (np.arange(30) % 3 + 1).astype(np.uint8)
    along = np.stack([np.arange(30.0), 0.5 * np.arange(30.0)], axis=1)
    for centers in (along, np.zeros((30, 2)), along + 1e-9 * np.random.default_rng(1).normal(size=(30, 2))):
        mesh = build_cell_mesh(cells_at(centers, ink))
        assert mesh is None or not mesh.orientation.any()


@pytest.mark.parametrize("tilt_deg", [70.0, 78.0, 84.0])
def test_gridlines_seen_nearly_parallel(tilt_deg: float) -> None:
    """From the side all gridlines run nearly along one direction, and edges across it are a pixel long."""
    seen = render(replace(scene(), camera=Camera(26.0, 7.3, tilt_deg, 20.0)), size=(360, 260))
    sound(extractor().extract(seen.image), seen)


def test_two_gridlines_on_one_line_overlap_finitely() -> None:
    for cosine in (1.0, 1.0 - 1e-15, -1.0, -1.0 + 1e-15, 1.0 + 1e-15, -1.0 - 1e-15):
        assert np.isfinite(overlap(cosine, 0.05, 0.05, 1.0)).all()


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    ("pitch_px", "blur_px"), [(18.0, 19.0), (8.0, 9.0), (8.0, 2.0), (6.0, 1.0), (4.0, 0.5)]
)
def test_edges_shorter_than_the_blur(preset: str, pitch_px: float, blur_px: float) -> None:
    shown = replace(scene(), camera=Camera(pitch_px, rotation_deg=7.3), optics=Optics(blur_px))
    seen = render(shown, size=SIZE)
    sound(extractor(preset=preset).extract(seen.image), seen)


# -- places


def refined_at(xy_px: NDArray[np.float64], cov_px2: NDArray[np.float64]) -> RefinedMarkers:
    return RefinedMarkers(
        xy_px,
        cov_px2,
        np.ones(len(xy_px), np.bool_),
        np.zeros(len(xy_px)),
        1.0,
        2.0,
        None,
        np.empty((0, 0, 3)),
    )


@pytest.mark.parametrize("shift_px", [(0.0, 0.0), (-0.49, -0.49), (0.5, 0.5), (-1.0, 3.0), (7.3, -4.1)])
def test_markers_at_the_images_border(shift_px: tuple[float, float]) -> None:
    """A frame that cuts the pattern: markers on the border's pixels, just outside and just inside."""
    at = (SIZE[0] / 4 + shift_px[0], SIZE[1] / 4 + shift_px[1])
    seen = render(replace(scene(), camera=Camera(20.0, centre_px=at)), size=(SIZE[0] // 2, SIZE[1] // 2))
    markers = extractor().extract(seen.image)
    found = sound(markers, seen)
    limit = np.array([SIZE[0] // 2, SIZE[1] // 2]) - 0.5
    assert ((markers.xy_px[found] >= -0.5) & (markers.xy_px[found] <= limit)).all()
    deep = ((seen.truth.marker_xy_px > 20) & (seen.truth.marker_xy_px < limit - 20)).all(axis=1)
    assert deep.sum() > 10 and found[deep].all()


@pytest.mark.parametrize("preset", PRESETS)
def test_single_precision_costs_nothing(preset: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawing is held in float32; held in float64 the markers stay within a hundredth of their deviation."""
    seen = render(scene(), size=SIZE)
    single = extractor(preset=preset).extract(seen.image)
    double = Extractor(extractor().layout, preset)  # type: ignore[arg-type]
    kept: dict[tuple[int, ...], DrawingBuffers] = {}

    def board(self: SynthesisSolver, shape: tuple[int, ...]) -> DrawingBuffers:
        single = allocate_drawing_buffers(shape, self._mesh)
        return kept.setdefault(shape, single._replace(synthetic_image=np.zeros(shape)))  # type: ignore[arg-type]

    monkeypatch.setattr(SynthesisSolver, "buffers", board)
    markers = double.extract(seen.image)
    away = np.linalg.norm(markers.xy_px - single.xy_px, axis=1)
    deviation = np.sqrt(np.einsum("mii->m", single.cov_px2))
    assert (away < 0.01 * deviation).all()


@pytest.mark.parametrize("pitch_mm", [0.05, 500.0])
def test_patterns_of_any_size_are_read_alike(pitch_mm: float) -> None:
    """The picture is the same; only the layout's millimetres differ."""
    options = {"layers": str(LAYERS), "pitch_mm": str(pitch_mm), "border_mm": str(pitch_mm)}
    layout = build_layout(load_design("honeycomb", options))
    usual = render(scene(), size=SIZE)
    markers = Extractor(parse_layout(layout_to_json(layout))).extract(usual.image)
    np.testing.assert_allclose(markers.xy_px, extractor().extract(usual.image).xy_px, atol=1e-5)
    image = np.asarray(usual.image).copy()
    image[100:140, 120:150] = BLACK_RGB
    repaired = Extractor(parse_layout(layout_to_json(layout))).extract(image)
    assert (sound(repaired) == sound(extractor().extract(image))).all()
    np.testing.assert_array_equal(repaired.status, extractor().extract(image).status)


def places_at(xy_px: NDArray[np.float64]) -> InitialMarkers:
    """Markers as found before refinement, with edges of 20 px; their triangles agree nowhere."""
    nowhere = np.zeros(len(xy_px), np.bool_)
    return InitialMarkers(xy_px, np.full(len(xy_px), 20.0), np.empty((0, 3), np.int32), nowhere, nowhere)


@pytest.mark.parametrize("offset_px", [1e4, 1e6])
def test_places_far_from_the_origin_are_repaired_alike(offset_px: float) -> None:
    """A window of a stitched picture: every fit is about its own middle, not about the origin."""
    lattice = lattice_of(extractor().layout)
    xy = 20.0 * lattice.marker_mm @ np.array([[0.99, 0.13], [-0.13, 0.99]]) + 0.4 * np.sin(lattice.marker_mm)
    gone = np.array([0, 8, 9, 40, 41, 42])
    results = []
    for origin in (150.0, offset_px):
        moved = xy + origin
        moved[gone] = np.nan
        cov = np.tile(1e-4 * np.eye(2), (len(xy), 1, 1))
        cov[gone] = np.nan
        refined = refined_at(moved, cov)
        side = int(origin) + 400
        results.append(repair_markers(refined, places_at(moved), lattice, (side, side)))
    near, far = results
    np.testing.assert_array_equal(near.status, far.status)
    assert (near.status[gone] != Status.LOST).any()
    np.testing.assert_allclose(near.xy_px - 150.0, far.xy_px - offset_px, atol=1e-6)
    np.testing.assert_allclose(near.cov_px2, far.cov_px2, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("offset_px", [1e4, 1e6])
def test_a_mesh_far_from_the_origin_is_the_same(offset_px: float) -> None:
    cells = extractor().extract(render(scene(), size=SIZE).image).stages["cells"]
    near = build_cell_mesh(cells)
    moved = replace(cells, center_px=cells.center_px + offset_px, corner_px=cells.corner_px + offset_px)
    far = build_cell_mesh(moved)
    assert near is not None and far is not None

    def faces(mesh: object) -> set[tuple[int, ...]]:
        return {tuple(row) for row in mesh.faces[mesh.orientation != 0].tolist()}  # type: ignore[attr-defined]

    assert faces(near) == faces(far)


# -- systems of equations


def test_singular_systems_are_solved_where_they_tell_something() -> None:
    """No information at all; one gridline alone; two markers that only know their difference."""
    mesh = topology_of(extractor().layout)
    count, edges = len(mesh.spokes), np.asarray(mesh.edges)
    weak, every = 1e-2, np.ones(count, np.bool_)
    diagonal, beside = np.zeros((count, 3)), np.zeros((len(edges), 4))
    assert np.isnan(covariances(diagonal, beside, mesh.edges, mesh.spokes, 4 * weak, every)).all()
    diagonal[:, [0, 2]] = weak
    right = np.zeros((count, 2))
    assert not solve_shifts(diagonal, beside, mesh.edges, right).any()
    a, b = edges[0]
    for value in (1.0, 1e4, 1e8):
        diagonal[:, [0, 2]] = weak
        diagonal[[a, b], 0] += value  # along x only: of y nothing is known
        beside[0, 0] = -value
        right[a, 0], right[b, 0] = value, -value
        shift = solve_shifts(diagonal, beside, mesh.edges, right)
        assert np.isfinite(shift).all() and shift[a, 0] - shift[b, 0] == pytest.approx(1.0, rel=0.02)
        assert not shift[:, 1].any()
        cov = covariances(diagonal, beside, mesh.edges, mesh.spokes, 4 * weak, every)
        known = np.isfinite(cov[:, 0, 0])
        assert (np.linalg.eigvalsh(cov[known]) > 0).all()


def test_quadratics_through_too_few_or_repeated_points_are_refused() -> None:
    """Neighbours in any number, on one line, and all on one point."""
    lattice = lattice_of(extractor().layout)
    table, mm = lattice.neighbours, lattice.marker_mm
    wanted = np.zeros(len(mm), np.bool_)
    wanted[0] = True
    for known in range(19):
        xy = np.full_like(mm, np.nan)
        xy[table[0, :known]] = 20.0 * mm[table[0, :known]]
        place = predict_markers(xy, wanted, mm, table)[0][0]
        assert np.isnan(place).all() or np.abs(place - 20.0 * mm[0]).max() < 1e-6
        assert known >= 4 or np.isnan(place).all()
    line = np.abs(mm[table[0], 1]) < 1e-9
    xy = np.full_like(mm, np.nan)
    xy[table[0][line]] = mm[table[0][line]]
    assert np.isnan(predict_markers(xy, wanted, mm, table)[0]).all()
    repeated = np.repeat(table[:, :1], table.shape[1], axis=1)
    assert np.isnan(predict_markers(20.0 * mm, wanted, mm, repeated)[0]).all()
    assert np.isfinite(predict_markers(np.full_like(mm, 7.0), wanted, mm, table)[0][0]).all()


def test_a_layer_with_few_markers_left_is_not_invented() -> None:
    """Of a sextant's line 0 to all markers are known; what is fitted between them lies where it must."""
    lattice = lattice_of(extractor("honeycomb").layout)
    xy = 20.0 * lattice.marker_mm + 150.0
    outer = np.flatnonzero(lattice.layer == LAYERS)[: LAYERS + 1]
    for left in range(LAYERS + 2):
        some = xy.copy()
        some[outer[left:]] = np.nan
        some[lattice.layer == LAYERS - 1] = np.nan
        cov = np.where(np.isfinite(some)[:, :, None], 1e-4 * np.eye(2), np.nan)
        refined = refined_at(some, cov)
        repaired = repair_markers(refined, places_at(some), lattice, (400, 400))
        assert not (np.linalg.norm(repaired.xy_px - xy, axis=1) > 0.5).any()
        np.testing.assert_array_equal(repaired.status == Status.LOST, np.isnan(repaired.xy_px[:, 0]))


# -- dirt


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@pytest.mark.parametrize("seed", range(6))
def test_a_marker_put_back_beside_dirt_spreads_no_nan(seed: int, preset: str) -> None:
    """Large dark blots: markers leave the solution and come back, and their cells' levels were never seen."""
    rng = np.random.default_rng(200 + seed)
    blots = tuple(Blob((float(x), float(y)), 1.6, BLACK_RGB) for x, y in rng.uniform(-3.5, 3.5, (2, 2)))
    shown = replace(scene(), damage=Damage(blobs=blots), surface=composed(Press(3.0, 0.4)), seed=seed)
    seen = render(shown, size=SIZE)
    markers = extractor(preset=preset).extract(seen.image)
    sound(markers, seen)
    if markers.reason is None:
        assert 1.0 < markers.stages["refine"].noise < 6.0  # 2 in truth; blots are not all of the misfit


# -- the table


def test_every_hard_case_of_the_table_names_a_test() -> None:
    page = (ROOT / "docs" / "hard-cases.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("|")][2:]
    assert len(rows) >= 15
    for row in rows:
        named = NAMED_TEST.findall(row)
        assert named, f"no test is named in {row!r}"
        for module, name in named:
            text = (ROOT / "tests" / f"{module}.py").read_text(encoding="utf-8")
            assert f"\ndef {name}(" in text, (module, name)
    listed = {name for _, name in NAMED_TEST.findall(page)}
    mine = {name for name in globals() if name.startswith("test_") and "table" not in name}
    assert mine <= listed, mine - listed
