"""Stages 6 and 7: cells become a mesh that the inks agree with, and every cell gets the layout's place, or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene import (
    Camera,
    Damage,
    Optics,
    Press,
    Scene,
    Scratch,
    Sensor,
    Shear,
    Twist,
    composed,
    render,
)
from extractor import Markers, Status, parse_layout
from extractor.cells.cell_mesh import build_cell_mesh
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import lattice_of
from extractor.numbering.lattice_walk import number_cells
from tests.support.layouts import small_layout, small_text
from tests.support.pictures import extractor, picture, recolored, scene_of

TRIANGULAR = ("honeycomb", "round", "elliptical")


def cells_of(corners: NDArray[np.float64], ink: NDArray[np.uint8]) -> Cells:
    """Ideal cells (N, 3, 2) px, as if recognised."""
    side = np.diff(corners, axis=1)
    area = 0.5 * np.abs(side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0])
    return Cells(corners.mean(axis=1), ink, area, corners)


def shown_cells(pattern: str, layers: int, xy_px: NDArray[np.float64]) -> tuple[Cells, NDArray[np.intp]]:
    """The colored cells of a layout whose markers are at (M, 2) px, and which cells they are."""
    layout = small_layout(pattern, layers)
    colored = np.flatnonzero(layout.cell_color < BLACK)
    return cells_of(xy_px[layout.cell_corners[colored]], layout.cell_color[colored] + np.uint8(1)), colored


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_the_mesh_is_the_markers_and_the_black_cells(pattern: str, mirrored: bool) -> None:
    """Faces of one turn are the markers with three inks around them, those of the other the black and white cells."""
    layout, seen = small_layout(pattern, 4), picture(pattern, mirrored=mirrored)
    cells, colored = shown_cells(pattern, 4, seen.truth.marker_xy_px)
    mesh = build_cell_mesh(cells)
    assert mesh is not None
    faces = mesh.faces[mesh.orientation != 0]
    np.testing.assert_array_equal(cells.ink[faces], np.tile((1, 2, 3), (len(faces), 1)))
    shared = [
        set.intersection(*(set(layout.cell_corners[colored[i]].tolist()) for i in face)) for face in faces
    ]
    front = -1 if mirrored else 1
    markers = [
        corners
        for corners, turn in zip(shared, mesh.orientation[mesh.orientation != 0], strict=True)
        if turn == front
    ]
    assert all(len(corners) == 1 for corners in markers)
    touching = np.bincount(layout.cell_corners[colored].ravel(), minlength=len(layout.marker_xy_mm))
    assert {corner for corners in markers for corner in corners} == set(
        np.flatnonzero(touching == 3).tolist()
    )
    inner = [
        turn
        for corners, turn in zip(shared, mesh.orientation[mesh.orientation != 0], strict=True)
        if not corners
    ]
    assert inner and set(inner) == {-front}


def test_every_cell_pair_has_at_most_one_neighbour_of_each_ink() -> None:
    """Around a marker there are one red, one green, one blue cell and never two of an ink."""
    seen = picture()
    markers = extractor().extract(seen.image)
    mesh, cells = markers.stages["mesh"], markers.stages["cells"]
    faces = mesh.faces[mesh.orientation > 0]
    assert (np.sort(cells.ink[faces], axis=1) == (1, 2, 3)).all()
    for ink in range(3):
        at = faces[:, ink]
        assert np.bincount(at).max() <= 3  # a cell has three corners


def test_fewer_than_three_cells_and_cells_in_a_row_make_no_mesh() -> None:
    corners = np.array([[[0, 0], [10, 0], [5, 8]]], float) + np.arange(6)[:, None, None] * (14.0, 0.0)
    ink = np.array([1, 2, 3, 1, 2, 3], np.uint8)
    for count in range(7):
        mesh = build_cell_mesh(cells_of(corners[:count], ink[:count]))
        assert mesh is None or not (mesh.orientation != 0).any()


def assert_numbered_as_the_layout(markers: Markers, truth_xy_px: NDArray[np.float64], least: float) -> None:
    """Brute force: the nearest true marker of each measured one is the marker itself."""
    found = np.flatnonzero(markers.status == Status.MEASURED)
    away = np.linalg.norm(markers.xy_px[found, None] - truth_xy_px[None], axis=2)
    np.testing.assert_array_equal(away.argmin(axis=1), found)
    assert len(found) >= least * len(truth_xy_px)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("rotation_deg", range(0, 360, 30))
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_numbers_at_every_rotation(pattern: str, rotation_deg: int, mirrored: bool) -> None:
    seen = picture(pattern, rotation_deg=rotation_deg, mirrored=mirrored)
    markers = extractor(pattern).extract(seen.image)
    assert markers.mirrored is mirrored and markers.reason is None
    assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 1.0)


@pytest.mark.parametrize("layers", [1, 2, 3, 9])
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_numbers_of_few_and_of_many_layers(pattern: str, layers: int) -> None:
    pitch_px = 26.0 if layers < 5 else 14.0
    seen = picture(pattern, layers, pitch_px=pitch_px)
    markers = extractor(pattern, layers).extract(seen.image)
    assert markers.reason is None
    assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 1.0)


SURFACES = {
    "pressed": composed(Press(3.0, 0.8)),
    "twisted": composed(Twist(4.0, 25.0)),
    "sheared": composed(Shear(3.0, (0.9, 0.5), (1.0, -1.0))),
}


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_numbers_of_a_deformed_surface(pattern: str, surface: str) -> None:
    scene = Scene(
        small_layout(pattern, 5), camera=Camera(22, 40), surface=SURFACES[surface], optics=Optics(1.0),
        sensor=Sensor(noise=2.0),
    )  # fmt: skip
    seen = render(scene, size=(360, 300))
    assert_numbered_as_the_layout(extractor(pattern, 5).extract(seen.image), seen.truth.marker_xy_px, 0.97)


@pytest.mark.parametrize("share", [0.05, 0.15])
@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_missing_cells_shift_no_number(pattern: str, share: float) -> None:
    layout = small_layout(pattern, 5)
    colored = np.flatnonzero(layout.cell_color < BLACK)
    for seed in range(4):
        gone = np.random.default_rng(seed).choice(colored, int(share * len(colored)), replace=False)
        seen = scene_of(recolored(layout, dict.fromkeys(gone.tolist(), BLACK)), pitch_px=22)
        markers = extractor(pattern, 5).extract(seen.image)
        assert_numbered_as_the_layout(markers, seen.truth.marker_xy_px, 0.0)


@pytest.mark.parametrize("offset_mm", [-4.0, -1.5, 1.5, 4.0])
def test_a_scratch_across_shifts_no_number(offset_mm: float) -> None:
    scratch = Scratch((-20.0, offset_mm), (20.0, offset_mm + 2.0), 0.7)
    scene = Scene(
        small_layout("honeycomb", 5), camera=Camera(22, 10), optics=Optics(1.0), sensor=Sensor(noise=2.0),
        damage=Damage(scratches=(scratch,)),
    )  # fmt: skip
    seen = render(scene, size=(360, 300))
    assert_numbered_as_the_layout(extractor("honeycomb", 5).extract(seen.image), seen.truth.marker_xy_px, 0.4)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(TRIANGULAR), st.booleans())
def test_any_order_of_the_cells_is_numbered_alike(seed: int, pattern: str, mirrored: bool) -> None:
    """Ideal cells shuffled, jittered, some left out, some of a wrong ink: every number given is the layout's own."""
    rng = np.random.default_rng(seed)
    seen = picture(pattern, mirrored=mirrored)
    cells, colored = shown_cells(pattern, 4, seen.truth.marker_xy_px)
    order = rng.permutation(len(colored))[: len(colored) - int(rng.integers(0, 9))]
    jitter = rng.normal(0, 0.5, (len(order), 1, 2))
    ink = cells.ink[order]
    wrong = rng.random(len(order)) < 0.02
    ink = np.where(wrong, ink % 3 + 1, ink).astype(np.uint8)
    shuffled = replace(cells_of(cells.corner_px[order] + jitter, ink), area_px=cells.area_px[order])
    lattice = lattice_of(parse_layout(small_text(pattern, 4)))
    mesh = build_cell_mesh(shuffled)
    assert mesh is not None
    numbering = number_cells(seen.image, shuffled, mesh, lattice)
    if numbering is None or numbering.ambiguous:
        return
    assert numbering.mirrored is mirrored
    given_ = np.flatnonzero(numbering.cell >= 0)
    layout = small_layout(pattern, 4)
    for i in given_:
        own = set(layout.cell_corners[colored[order[i]]].tolist())
        assert set(lattice.corner_ids[numbering.cell[i]].tolist()) == own
    assert len(np.unique(numbering.cell[given_])) == len(given_)
