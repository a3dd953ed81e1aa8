"""Steps by synthesis: what is drawn anew, what is kept, when it ends, and what it says of what it left."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.scene import Blob, Damage, Press, Rendered, Sensor, composed
from cmpdesign.scene.standard import BLACK_RGB, INKS, standard_layout
from extractor import Extractor, Status
from extractor.layout.topology import topology_of
from extractor.presets import SCHEDULES
from extractor.refine import refiner as refine
from extractor.refine.drawn_pattern import Synthesis, merged_rows
from extractor.refine.refinement_step import with_pattern_moved
from extractor.refine.solve.convergence import add_neighbours, convergence_covariance, unconverged_markers
from extractor.refine.solve.fisher_information import covariances
from extractor.refine.synthesis.blur_bleed import adapt_levels_to_blur, bleed_shares, remove_bleed
from extractor.refine.synthesis.ink_levels import InkLevels
from extractor.refine.synthesis.pattern_drawing import (
    RUN_COUNT,
    allocate_coverage_runs,
    draw_cells,
    update_erasing_cells,
)
from extractor.refine.synthesis_steps import LEVEL_TOLERANCE, SynthesisSolver
from tests.support.standard_views import LAYERS, extractor, shown


def dirty(*places_mm: tuple[float, float]) -> Rendered:
    """Dark blobs: markers beside them take several steps."""
    blobs = tuple(Blob(at, 0.5, BLACK_RGB) for at in places_mm)
    return shown("honeycomb", damage=Damage(blobs=blobs))


@pytest.mark.parametrize("pattern", ["round", "elliptical", "dirty honeycomb"])
def test_what_is_drawn_in_part_is_what_would_be_drawn_anew(
    pattern: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cells taken out and drawn elsewhere leave no trace, and gridlines that did not move keep what was read."""
    plain, parts = SynthesisSolver._partial_step, []

    def checked(
        self: SynthesisSolver, view: Any, fit: Any, before: Synthesis, anew: NDArray[np.bool_], *how: bool
    ) -> Any:
        fit, drawing = plain(self, view, fit, before, anew, *how)
        mesh, levels = self._mesh, drawing.levels
        fresh = np.zeros(view.image.shape, np.float32)
        every, sides = np.ones(len(mesh.cells), np.bool_), (mesh.cells, mesh.cell_edges, mesh.edges)
        how = drawing.lines, levels.cell, levels.slope, drawing.sigma, drawing.box
        draw_cells(every, 1.0, drawing.xy, *sides, *how, fresh, allocate_coverage_runs(len(every)))
        x0, y0, x1, y1 = drawing.box
        picture = self.buffers(view.image.shape).synthetic_image[y0:y1, x0:x1]
        np.testing.assert_allclose(picture, fresh[y0:y1, x0:x1], atol=2e-3)  # grey levels
        kept = ~anew[mesh.edges].any(axis=1)
        np.testing.assert_array_equal(drawing.sums[kept], before.sums[kept])
        np.testing.assert_array_equal(drawing.lines[kept], before.lines[kept])
        np.testing.assert_array_equal(drawing.xy[~anew], before.xy[~anew])
        parts.append(int(anew.sum()))
        return fit, drawing

    monkeypatch.setattr(SynthesisSolver, "_partial_step", checked)
    if pattern == "dirty honeycomb":
        extractor("honeycomb").extract(dirty((-2.0, 1.5)).image)
    else:
        extractor(pattern).extract(shown(pattern, surface=composed(Press(4.0, 0.6))).image)
    assert parts and min(parts) > 0


def test_steps_in_part_end_where_steps_from_everything_do(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = shown("round", surface=composed(Press(4.0, 0.6)))
    preset = SCHEDULES["accurate"]
    part = extractor("round", "accurate").extract(seen.image)
    monkeypatch.setattr("extractor.refine.synthesis_steps.MAX_PARTIAL_SHARE", -1.0)
    whole = extractor("round", "accurate").extract(seen.image)
    deviation = np.sqrt(np.einsum("mii->m", whole.cov_px2))
    away = np.linalg.norm(part.xy_px - whole.xy_px, axis=1)
    assert (away < preset.converged_deviations * deviation).all() and np.median(away / deviation) < 0.1


@pytest.mark.parametrize("preset", ["fast", "balanced", "accurate"])
def test_no_image_takes_more_than_its_preset_allows(preset: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise, damage and wide blur end after the effort of the preset, or two steps."""
    taken: list[str] = []
    for name in ("_first", "_again"):
        plain = getattr(SynthesisSolver, name)

        def counted(self: SynthesisSolver, *given: Any, _plain: Any = plain, _name: str = name) -> Any:
            taken.append(_name)
            return _plain(self, *given)

        monkeypatch.setattr(SynthesisSolver, name, counted)
    for seen, balanced in (
        (dirty((1.5, 0.4), (-2.0, 1.5), (0.3, -2.4)), 3),
        (shown("honeycomb", blur=2.5), 2),
        (shown("honeycomb"), 2),
    ):
        most = {"fast": 0, "balanced": balanced, "accurate": 10}[preset]
        taken.clear()
        markers = extractor("honeycomb", preset).extract(seen.image)
        assert (markers.status == Status.MEASURED).any()
        assert len(taken) <= max(most, 2)


@pytest.mark.parametrize(("share", "dirty", "steps"), [(0.4, True, 2), (0.5, True, 1), (0.5, False, 2)])
def test_once_dirt_has_moved_markers_no_step_is_taken_around_many(
    share: float, dirty: bool, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though the gridlines at those that move are trusted at the next look."""
    looks, taken, plain = [0.1, share, 0.0], [], SynthesisSolver._partial_step

    def look(measured: NDArray[np.float64], *rest: Any) -> tuple[NDArray[np.bool_], int, bool]:
        anew = np.arange(len(measured)) < looks[0] * len(measured)
        first = len(looks) == 3
        looks.pop(0)
        return anew, int(anew.sum()), dirty and first

    def counted(self: SynthesisSolver, *given: Any) -> Any:
        taken.append(given)
        return plain(self, *given)

    monkeypatch.setattr("extractor.refine.synthesis_steps.unconverged_markers", look)
    monkeypatch.setattr("extractor.refine.synthesis_steps.step_effort", lambda *_: 0.1)
    monkeypatch.setattr(SynthesisSolver, "_partial_step", counted)
    monkeypatch.setitem(SCHEDULES, "balanced", SCHEDULES["balanced"]._replace(patience=5))
    Extractor(extractor("round").layout).extract(shown("round").image)
    assert len(taken) == steps


def test_where_much_moves_what_is_beside_it_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer markers are drawn anew, in fewer steps, and the error hardly grows."""
    taken: list[int] = []
    plain = SynthesisSolver._partial_step

    def counted(
        self: SynthesisSolver, view: Any, fit: Any, before: Synthesis, anew: NDArray[np.bool_], *how: bool
    ) -> Any:
        taken.append(int(anew.sum()))
        return plain(self, view, fit, before, anew, *how)

    def error(many: float, most: float) -> float:
        taken.clear()
        monkeypatch.setitem(
            SCHEDULES,
            "balanced",
            SCHEDULES["balanced"]._replace(max_partial_share=many, max_partial_share_in_dirt=most),
        )
        found = Extractor(extractor("round").layout).extract(seen.image)
        return float(np.sqrt(np.nanmean((found.xy_px - seen.truth.marker_xy_px) ** 2)))

    monkeypatch.setattr(SynthesisSolver, "_partial_step", counted)
    seen = shown("round", surface=composed(Press(4.0, 0.6)))
    whole = error(1.0, 1.0)
    beside = list(taken)
    alone = error(0.1, 0.1)
    assert 0 < taken[0] < 0.5 * beside[0] and len(taken) <= len(beside)
    assert alone < 1.2 * whole


@given(
    share=st.floats(0.0, 3.0),
    angle=st.floats(0.0, 6.3),
    sigma=st.floats(0.4, 3.0),
)
def test_what_a_step_left_grows_with_it(share: float, angle: float, sigma: float) -> None:
    """A tenth of the blur leaves a hundredth; never more than half of the step; along it, and symmetric."""
    along = np.array([np.cos(angle), np.sin(angle)])
    left = convergence_covariance((share * sigma * along)[None], sigma, 0.0)[0]
    expected = min(share, 0.5) * share * sigma
    np.testing.assert_allclose(left, expected**2 * np.outer(along, along), atol=1e-12)


def test_where_blur_is_wide_a_share_of_a_usual_step_is_left_everywhere() -> None:
    rng = np.random.default_rng(0)
    shift = 0.01 * rng.normal(size=(4000, 2))
    shift[0] = np.nan  # of a marker that is not known
    more = convergence_covariance(shift, 1.0, 0.5) - convergence_covariance(shift, 1.0, 0.0)
    np.testing.assert_allclose(
        more[1:], np.broadcast_to((0.5 * 0.01) ** 2 * np.eye(2), (3999, 2, 2)), rtol=0.1
    )
    assert (convergence_covariance(shift, 1.0, 3.0)[1:] == convergence_covariance(shift, 1.0, 1.0)[1:]).all()


def dirty_at(edges: NDArray[np.int32], trust: float = 0.2, explained: bool = True) -> tuple[Any, ...]:
    """The last four arguments of ``unconverged_markers``: gridlines so far trusted, the first two around each
    marker."""
    spokes = np.full((edges.max() + 1, 6), -1, np.int32)
    for m in range(len(spokes)):
        own = np.flatnonzero((edges == m).any(axis=1))[:2]
        spokes[m, : len(own)] = own
    return explained, np.full(len(edges), trust), spokes, edges


def test_moving_markers_bring_their_neighbours() -> None:
    edges = np.array([[0, 1], [1, 2], [2, 3]], np.int32)
    drawn = np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 0.0], [60.0, 0.0]])
    measured = drawn + [[0.2, 0.0], [0.05, 0.0], [0.2, 0.0], [np.nan, np.nan]]
    strides = np.array([6.0, 60.0, 4.0, 9.0])  # only the first is both far and sure
    moving = measured, drawn, strides
    far, much = (0.1, 1.0, np.inf, 5.0), (0.3, 1.0, np.inf, 5.0)
    anew, count, dirty = unconverged_markers(*moving, *far, 0.0, 1.0, 1.0, *dirty_at(edges))
    np.testing.assert_array_equal(anew, [True, True, False, False])
    assert count == 2 and dirty
    assert not unconverged_markers(*moving, *far, 0.0, 1.0, 1.0, *dirty_at(edges, 0.5))[
        2
    ]  # nothing is hidden
    anew, count, _ = unconverged_markers(*moving, *far, 0.25, 1.0, 1.0, *dirty_at(edges))
    assert count == 0 and not anew.any()  # one of four is few
    anew, count, _ = unconverged_markers(*moving, *far, 0.0, 0.5, 0.25, *dirty_at(edges))
    np.testing.assert_array_equal(anew, [True, True, False, False])
    between = np.array([[0, 1], [0, 2], [0, 3]], np.int32)
    anew, count, dirty = unconverged_markers(*moving, *far, 0.0, 0.5, 0.75, *dirty_at(between))
    np.testing.assert_array_equal(anew, [True, False, False, False])
    assert count == 4 and dirty  # with those beside it, all are
    anew, count, dirty = unconverged_markers(*moving, *far, 0.0, 0.4, 0.75, *dirty_at(between))
    assert count == 0 and not anew.any() and dirty  # all is dirty
    unexplained = dirty_at(between, explained=False)
    anew, count, _ = unconverged_markers(*moving, *far, 0.0, 0.4, 0.75, *unexplained)
    assert count == 4 and anew.all()
    anew, _, dirty = unconverged_markers(*moving, *far, 0.0, 0.5, 0.75, *dirty_at(between, 1.0))
    assert anew.all() and not dirty
    anew, _, _ = unconverged_markers(*moving, *far, 0.0, 0.3, 0.75, *dirty_at(between, 1.0))
    np.testing.assert_array_equal(anew, [True, False, False, False])
    anew, count, _ = unconverged_markers(*moving, *much, 0.0, 1.0, 1.0, *dirty_at(edges))
    assert count == 0 and not anew.any()
    out = np.zeros(4, np.bool_)
    add_neighbours(np.array([False, False, False, True]), edges, out)
    np.testing.assert_array_equal(out, [False, False, True, False])
    np.testing.assert_array_equal(merged_rows(out, np.ones((4, 2)), np.zeros((4, 2)))[:, 0], [0, 0, 1, 0])


def test_how_far_a_marker_must_move_is_told_by_the_shortest_gridline_there() -> None:
    """Of markers that move alike, those between short gridlines go, and not those where blur is all that is seen."""
    edges = np.array([[0, 1], [2, 3], [4, 5]], np.int32)
    drawn = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 50.0], [10.0, 50.0], [0.0, 90.0], [6.0, 90.0]])
    moving = drawn + [0.0, 0.05], drawn, np.full(6, 9.0)
    usual = 0.0, 1.0, 1.0, *dirty_at(edges, 1.0)
    assert unconverged_markers(*moving, 0.0, 1.0, np.inf, 5.0, *usual)[0].all()
    # a tenth of the blur is too far; of the share that short gridlines answer with, 0.36 and 0.13, it is not
    anew = unconverged_markers(*moving, 0.1, 1.0, np.inf, 5.0, *usual)[0]
    np.testing.assert_array_equal(anew, [False, False, True, True, True, True])
    anew = unconverged_markers(*moving, 0.1, 1.0, 0.12, 5.0, *usual)[0]
    np.testing.assert_array_equal(anew, [False, False, True, True, False, False])


@given(
    far=st.lists(st.floats(0.0, 1.0), min_size=12, max_size=40, unique=True),
    most=st.floats(0.05, 0.95),
    many=st.floats(0.0, 1.0),
)
def test_where_many_move_the_farthest_are_drawn_anew(far: list[float], most: float, many: float) -> None:
    """Each marker has one beside it that does not move: with these, they are twice as many."""
    half, near = len(far), 0.2
    edges = np.stack([np.arange(half), half + np.arange(half)], axis=1).astype(np.int32)
    shift = np.concatenate([far, np.zeros(half)])[:, None] * np.array([0.6, 0.8])
    drawn = np.stack([np.repeat([0.0, 30.0], half), np.tile(50.0 * np.arange(half), 2)], axis=1)
    away = np.linalg.norm(shift, axis=1)
    assume(np.abs(away - near).min() > 1e-9 and np.diff(np.sort(away[:half])).min() > 1e-9)
    about = drawn + shift, drawn, np.full(2 * half, 9.0), near, 1.0, np.inf, 5.0, 0.0
    anew, touched, dirty = unconverged_markers(*about, many, most, *dirty_at(edges))
    moving = np.count_nonzero(away > near)
    assert dirty == (moving > 0)
    if 2 * moving <= many * 2 * half:
        assert touched == 2 * moving
        np.testing.assert_array_equal(anew[:half], away[:half] > near)
        np.testing.assert_array_equal(anew[half:], anew[:half])
    elif 2 * moving <= 2 * many * 2 * half:
        assert touched == 2 * moving
        assert np.count_nonzero(anew) == min(moving, int(most * 2 * half))
        assert away[anew].min(initial=1.0) > away[~anew & (away > 0)].max(initial=0.0)
        assert (away[anew] > near).all()
    else:
        assert touched == 0 and not anew.any()


@pytest.mark.parametrize("share", [0.0, 0.01, 0.03])
def test_what_neighbours_bleed_into_means_is_taken_out(share: float) -> None:
    """Means of cells and black that were mixed by hand come apart again."""
    true = np.array([[10.0, 20.0, 140.0], [20.0, 120.0, 10.0], [150.0, 30.0, 20.0], [90.0, 100.0, 95.0]])
    color, black = np.array([0, 1, 2, 4], np.int32), np.array([16.0, 15.0, 14.0])
    total = true[:3].sum(axis=0)
    field = np.zeros((3, 10))
    field[:, 0] = black + share * total
    seen = (1 - 3 * share) * true - share * total
    levels = InkLevels(seen, np.zeros((4, 3, 2)), field, np.zeros(4, np.bool_))
    found = remove_bleed(levels, color, np.full(4, share), share)
    np.testing.assert_allclose(found.cell, true, rtol=1e-9)
    np.testing.assert_allclose(found.black[:, 0], black, rtol=1e-9)


def test_bleeding_grows_with_blur_and_ends_with_unknown_corners() -> None:
    xy = np.array([[0.0, 0.0], [20.0, 0.0], [10.0, 17.3], [np.nan, np.nan]])
    cells = np.array([[0, 1, 2], [0, 1, 3]], np.int32)
    shares = [bleed_shares(xy, cells, sigma, 1.5)[0] for sigma in (1.0, 2.0, 4.0)]
    assert all(np.isnan(share[1]) for share in shares)
    assert shares[0][0] < 1e-3 < shares[1][0] < shares[2][0] < 0.15


@pytest.mark.parametrize("blur", [0.6, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_the_first_estimate_of_the_blur_is_close(
    pattern: str, blur: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Optics and pixel together, before anything is drawn; wide blur is taken for less, never for much more."""
    ratios: list[float] = []
    plain = refine.cleared

    def noted(view: Any, *rest: Any) -> Any:
        fit, across = plain(view, *rest)
        true = np.sqrt(blur**2 + view.scale**2 / 12) / view.scale
        ratios.append(fit.sigma / true)
        return fit, across

    monkeypatch.setattr(refine, "update_blur_and_bleed", noted)
    extractor(pattern).extract(shown(pattern, blur).image)
    assert 0.75 < ratios[-1] < 1.1
    if blur <= 1.0:
        assert 0.95 < ratios[-1] < 1.06


def test_maps_are_laid_anew_around_some_markers_only(monkeypatch: pytest.MonkeyPatch) -> None:
    fits: list[Any] = []
    plain = refine.Draughtsman.steps

    def kept(self: SynthesisSolver, view: Any, fit: Any, *given: Any) -> Any:
        fits.append((self._mesh, fit))
        return plain(self, view, fit, *given)

    monkeypatch.setattr(SynthesisSolver, "steps", kept)
    extractor("honeycomb").extract(shown("honeycomb").image)
    mesh, fit = fits[0]
    moved = fit.reliable + np.random.default_rng(1).normal(0.0, 0.3, fit.reliable.shape)
    moved[3] = np.nan
    fit, which = fit._replace(reliable=moved), np.zeros(len(moved), np.bool_)
    which[[5, 20]] = True
    near, whole = with_pattern_moved(mesh, fit, which), with_pattern_moved(mesh, fit)
    np.testing.assert_array_equal(near.beyond, whole.beyond)
    ends = np.unique(mesh.edges[which[mesh.edges].any(axis=1)])
    np.testing.assert_array_equal(near.maps[ends], whole.maps[ends])
    others = np.setdiff1d(np.flatnonzero(np.isfinite(moved[:, 0])), ends)
    np.testing.assert_array_equal(near.maps[others], fit.maps[others])
    assert (near.maps[others] != whole.maps[others]).any() and np.isnan(near.maps[3]).all()


def test_covariances_of_some_markers_are_those_among_all() -> None:
    mesh = topology_of(extractor("honeycomb").layout)
    count, rng = len(mesh.spokes), np.random.default_rng(2)
    diagonal = np.tile([900.0, 0.0, 900.0], (count, 1)) + rng.uniform(0.0, 200.0, (count, 3))
    beside = rng.uniform(0.0, 60.0, (len(mesh.edges), 4))
    some = rng.random(count) < 0.3
    tables = mesh.edges, mesh.spokes, 4e-2
    every = covariances(diagonal, beside, *tables, np.ones(count, np.bool_))
    chosen = covariances(diagonal, beside, *tables, some)
    assert np.isfinite(every).all() and np.isnan(chosen[~some]).all()
    np.testing.assert_allclose(chosen[some], every[some], rtol=1e-12)


def one_cell(bow: float, sigma: float, picture: NDArray[np.float32], size: float = 1.0) -> tuple[Any, ...]:
    """A cell with a side that is bowed, as ``draw_cells`` takes it."""
    corners = size * np.array([[18.0, 70.0], [78.0, 70.0], [48.0, 18.0]])
    cells = np.array([[0, 1, 2]], np.int32)
    edges, cell_edges = np.array([[0, 1], [1, 2], [0, 2]], np.int32), np.array([[0, 1, 2]], np.int32)
    chords = corners[edges[:, 1]] - corners[edges[:, 0]]
    lengths = np.linalg.norm(chords, axis=1)
    lines = np.zeros((3, 8))
    lines[:, :2], lines[:, 2:4] = corners[edges[:, 0]], chords / lengths[:, None]
    lines[:, 4], lines[:, 7] = lengths, 1.0
    lines[0, 5:7] = bow, -bow  # a parabola
    box, slope = np.array([0, 0, *picture.shape[1::-1]]), np.zeros((1, 3, 2))
    slope[0, 1] = 0.2, -0.1
    return corners, cells, cell_edges, edges, lines, np.full((1, 3), 100.0), slope, sigma, box


@pytest.mark.parametrize("shares", [1 << 18, 4000, 0])
def test_what_is_taken_out_leaves_nothing(shares: int) -> None:
    """Whether its strokes were kept, did not fit all, or were not kept at all; larger than a chunk of pixels, too."""
    picture, which = np.full((96, 96, 3), 50.0, np.float32), np.ones(1, np.bool_)
    for size in (0.5, 1.0):  # 700 pixels and 2,400
        strokes = allocate_coverage_runs(1, shares)
        cell = one_cell(0.2, 1.0, picture, size)
        draw_cells(which, 1.0, *cell, picture, strokes)
        assert picture.max() > 120.0 and bool(strokes.cell[0, RUN_COUNT]) == (size < 1.0 and shares >= 4000)
        update_erasing_cells(which, *cell, picture, strokes)
        np.testing.assert_allclose(picture, 50.0, atol=1e-4)


@pytest.mark.parametrize("bow", [-0.3, -0.1, 0.1, 0.3])
def test_a_curved_edge_is_blurred_as_it_should(bow: float) -> None:
    """One cell with a curved side against the same, finely sampled and filtered: blur moves curved edges."""
    fine, sigma, size = 16, 3.0, 96
    picture = np.zeros((size, size, 3), np.float32)
    which, strokes = np.ones(1, np.bool_), allocate_coverage_runs(1)
    draw_cells(which, 1.0, *one_cell(bow, sigma, picture), picture, strokes)
    y, x = np.mgrid[0 : size * fine, 0 : size * fine].astype(np.float32)
    x, y = (x + 0.5) / fine - 0.5, (y + 0.5) / fine - 0.5
    t = np.clip((x - 18.0) / 60.0, 0.0, 1.0)
    below, apart = y - 18.0, np.abs(x - 48.0) / 30.0 * 52.0
    mask = ((y < 70.0 + 60.0 * bow * t * (1 - t)) & (apart < below)).astype(np.float32)
    mask = cv2.GaussianBlur(mask, (0, 0), sigma * fine)
    true = 100.0 * cv2.resize(mask, (size, size), interpolation=cv2.INTER_AREA)
    middle = slice(56, 84), slice(38, 59)  # about the curved side, away from the corners
    assert (
        np.abs(picture[..., 0] - true)[middle].max() < 0.25
    )  # 0.8 where blur is taken to leave edges in place


@pytest.mark.parametrize("blur", [2.0, 3.0, 3.5])
@pytest.mark.parametrize("pattern", ["honeycomb", "round"])
def test_two_steps_find_wide_blur_and_the_levels_that_it_hides(
    pattern: str, blur: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a blur known to a tenth, with levels as the middles of the cells show them under it."""
    seen: list[tuple[float, float, float]] = []
    plain = SynthesisSolver._full_step

    def noted(self: SynthesisSolver, view: Any, fit: Any) -> Any:
        stepped, drawing = plain(self, view, fit)
        true = np.sqrt(blur**2 + view.scale**2 / 12) / view.scale
        level = np.median(np.abs(stepped.levels.cell).sum(axis=1))
        seen.append((drawing.sigma / true, stepped.sigma / true, level))
        return stepped, drawing

    monkeypatch.setattr(SynthesisSolver, "_full_step", noted)
    extractor(pattern, "accurate").extract(shown(pattern, blur, sensor=Sensor(noise=0.5)).image)
    sharp = np.median([np.abs(np.array(INKS[ink]) - BLACK_RGB).sum() for ink in ("red", "green", "blue")])
    assert abs(seen[1][1] - 1) < 0.03
    assert abs(seen[1][2] / sharp - 1) < 0.03


def test_levels_follow_the_blur_there_and_back() -> None:
    """What a wider blur would have shown of levels, seen with the narrower one again, is as before."""
    own = extractor("honeycomb")._mesh
    mm = standard_layout("honeycomb", LAYERS).marker_xy_mm
    xy = 10.0 * mm / np.linalg.norm(mm[1] - mm[0])
    count = len(own.cells)
    cell = np.tile([120.0, 40.0, 20.0], (count, 1))
    field = np.zeros((3, 10))
    field[:, 0] = 20.0
    levels = InkLevels(cell, np.zeros((count, 3, 2)), field, np.zeros(4, np.bool_))
    wider = adapt_levels_to_blur(levels, xy, own, 1.2, 1.5)
    assert (wider.cell[:, 0] > 1.02 * cell[:, 0]).all() and (wider.black[:, 0] < 20.0).all()
    back = adapt_levels_to_blur(wider, xy, own, 1.5, 1.2)
    np.testing.assert_allclose(back.cell, cell, rtol=0.02)
    assert adapt_levels_to_blur(levels, xy, own, 0.5, 0.6) is levels
    # a little more blur than drawn is left alone only where it makes no difference: half of what makes levels others
    assert adapt_levels_to_blur(levels, xy, own, 1.2, 1.2005) is levels
    kept = [
        sigma
        for sigma in np.linspace(1.2, 1.3, 41)
        if adapt_levels_to_blur(levels, xy, own, 1.2, sigma) is levels
    ]
    first = adapt_levels_to_blur(levels, xy, own, 1.2, kept[-1] + 0.0025)
    assert first is not levels and np.abs(first.cell / cell - 1.0).max() < 0.5 * LEVEL_TOLERANCE
