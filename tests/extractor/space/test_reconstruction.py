"""Points and surfaces in space: covariances against Monte Carlo, refused input with reasons, results of a lost view."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from extractor import (
    Markers,
    PointReason,
    PoseError,
    Reason,
    Reconstructor,
    Rig,
    RigError,
    Status,
    VirtualStatus,
    triangulate,
)
from tests.support.view_scenes import flat, looking, noisy, opencv_px, pair, pressed, reference, unplaced

LAYOUT = reference()
TRUE = pressed(LAYOUT.xy_mm)


def normalised(error: np.ndarray, cov: np.ndarray) -> np.ndarray:
    """(N,) squared errors per axis in units of their covariance."""
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error) / error.shape[1]


def rows(seen: list[Markers]) -> tuple[np.ndarray, np.ndarray]:
    return np.stack([m.xy_px for m in seen]), np.stack([m.cov_px2 for m in seen])


def lost(markers: Markers, ids: object) -> Markers:
    xy, status = markers.xy_px.copy(), markers.status.copy()
    xy[ids], status[ids] = np.nan, Status.LOST
    return replace(markers, xy_px=xy, status=status)


def nothing(markers: Markers) -> Markers:
    return replace(lost(markers, slice(None)), reason=Reason.NO_PATTERN, mirrored=None)


def reconstructor(**options: object) -> Reconstructor:
    views, rng = pair(mirrored=(True, False)), np.random.default_rng(1)
    rest = [noisy(LAYOUT, view, flat(LAYOUT), rng) for view in views]
    return Reconstructor(LAYOUT, unplaced(views), rest, **options)  # type: ignore[arg-type]


def frame(seed: int, true: np.ndarray = TRUE, sigma_px: float = 0.02) -> list[Markers]:
    rng = np.random.default_rng(seed)
    return [noisy(LAYOUT, view, true, rng, sigma_px) for view in pair(mirrored=(True, False))]


def test_a_point_is_where_the_pixels_are_most_likely() -> None:
    """By OpenCV's projection with derivatives by differences, which share nothing with the loop."""
    rng = np.random.default_rng(5)
    views = (*pair(), looking("above", tilt_deg=25, azimuth_deg=90))
    half = rng.normal(size=(3, 4, 2, 2)) * 0.02
    cov = half @ np.swapaxes(half, 2, 3) + 1e-4 * np.eye(2)
    true = TRUE[[0, 7, 30, 60]]
    xy = np.stack([opencv_px(view, true) for view in views]) + rng.normal(size=(3, 4, 2)) * 0.01
    points = triangulate(views, xy, cov)
    step = 1e-4 * np.eye(3)
    for k, found in enumerate(points.xyz_mm):
        information, gradient = np.zeros((3, 3)), np.zeros(3)
        for v, view in enumerate(views):
            moved = opencv_px(view, np.concatenate([found + step, found - step, found[None]]))
            slopes = (moved[:3] - moved[3:6]).T / 2e-4
            weight = np.linalg.inv(cov[v, k])
            information += slopes.T @ weight @ slopes
            gradient += slopes.T @ weight @ (xy[v, k] - moved[6])
        expected = np.linalg.inv(information)
        assert np.sqrt(gradient @ expected @ gradient) < 1e-3  # standard deviations from the top
        np.testing.assert_allclose(points.cov_mm2[k], expected, rtol=1e-5, atol=1e-7 * expected.max())


@pytest.mark.parametrize("count", [2, 3])
def test_the_covariance_is_what_errors_are(count: int) -> None:
    """Normalised RMS near 1 means two things: errors reach the bound of these pixels, and the covariance says so."""
    third = looking("third", tilt_deg=30, azimuth_deg=80, distance_mm=35, mirrored=True)
    views, rng = (*pair(mirrored=(False, True)), third)[:count], np.random.default_rng(2)
    squares, misfits = [], []
    for _ in range(40):
        points = triangulate(views, *rows([noisy(LAYOUT, view, TRUE, rng) for view in views]))
        assert not points.reason.any()
        squares.append(normalised(points.xyz_mm - TRUE, points.cov_mm2))
        misfits.append(points.misfit**2)
    assert 0.97 < np.sqrt(np.mean(squares)) < 1.03
    assert 0.96 < np.sqrt(np.mean(misfits)) < 1.04


def test_the_weights_matter() -> None:
    """One view ten times as noisy: the plain middle between the rays is worse than the mean weighted by the
    covariances.
    """
    views, rng = pair(), np.random.default_rng(3)
    best, plain = [], []
    for _ in range(10):
        xy, cov = rows([noisy(LAYOUT, v, TRUE, rng, s) for v, s in zip(views, (0.02, 0.2), strict=True)])
        best.append(triangulate(views, xy, cov).xyz_mm - TRUE)
        plain.append(triangulate(views, xy, np.tile(np.eye(2), (2, len(TRUE), 1, 1))).xyz_mm - TRUE)
    assert np.sqrt(np.mean(np.square(best))) < 0.95 * np.sqrt(np.mean(np.square(plain)))


def test_the_whole_reconstruction_is_calibrated() -> None:
    """Poses from a noisy rest frame each time, so that their part of the covariance is counted, too."""
    views, rng = pair(mirrored=(True, False)), np.random.default_rng(4)
    position, moved, virtual = [], [], []
    exact = [noisy(LAYOUT, view, TRUE, rng, 1e-9) for view in views]
    on_edge = Reconstructor(LAYOUT, Rig(views), None).reconstruct(exact).virtual_xyz_mm
    for _ in range(25):
        rest, now = ([noisy(LAYOUT, v, xyz, rng) for v in views] for xyz in (flat(LAYOUT), TRUE))
        shape = Reconstructor(LAYOUT, unplaced(views), rest, model_px=0.0).reconstruct(now)
        assert (shape.status == Status.MEASURED).all() and not shape.problem
        position.append(normalised(shape.xyz_mm - TRUE, shape.cov_mm2))
        moved.append(normalised(shape.displacement_mm - (TRUE - flat(LAYOUT)), shape.displacement_cov_mm2))
        error = (shape.virtual_xyz_mm - on_edge).reshape(-1, 3)
        virtual.append(normalised(error, shape.virtual_cov_mm2.reshape(-1, 3, 3)))
    assert 0.9 < np.sqrt(np.mean(position)) < 1.1
    assert 0.9 < np.sqrt(np.mean(moved)) < 1.1
    assert 0.9 < np.sqrt(np.mean(virtual)) < 1.1


def test_a_marker_whose_views_disagree_is_not_reported() -> None:
    rebuilt, (left, right) = reconstructor(), frame(5)
    moved = right.xy_px.copy()
    moved[[7, 30]] += (0.0, 1.5)  # across the epipolar lines, which run along x here
    shape = rebuilt.reconstruct([left, replace(right, xy_px=moved)])
    assert np.flatnonzero(shape.reason).tolist() == [7, 30]
    assert (shape.reason[[7, 30]] == PointReason.DISAGREE).all() and (shape.misfit[[7, 30]] > 6).all()
    assert not shape.status[[7, 30]].any() and np.isnan(shape.xyz_mm[[7, 30]]).all()
    assert np.isnan(shape.displacement_mm[7]).all() and np.isnan(shape.normals[7]).all()
    around = (LAYOUT.edges == 7).any(axis=1)
    assert (shape.virtual_status[around] == VirtualStatus.LOST).all()
    assert np.isnan(shape.virtual_xyz_mm[around]).all()
    assert (
        shape.virtual_status[~(around | (LAYOUT.edges == 30).any(axis=1))] == VirtualStatus.INTERPOLATED
    ).all()


def test_swapped_ids_disagree() -> None:
    rebuilt, (left, right) = reconstructor(), frame(6)
    order = np.roll(np.arange(len(TRUE)), 1)
    shape = rebuilt.reconstruct([left, replace(right, xy_px=right.xy_px[order])])
    wrong = shape.reason == PointReason.NONE
    assert wrong.mean() < 0.1  # those whose neighbour lies along the epipolar line cannot be told


def test_a_marker_in_one_view_only_says_so() -> None:
    rebuilt, (left, right) = reconstructor(), frame(7)
    shape = rebuilt.reconstruct([lost(left, [4, 5]), lost(right, [5, 6])])
    assert shape.reason[[4, 5, 6]].tolist() == [
        PointReason.ONE_VIEW,
        PointReason.UNSEEN,
        PointReason.ONE_VIEW,
    ]
    assert not shape.status[[4, 5, 6]].any() and shape.status.sum() == len(TRUE) - 3


def test_a_lost_view_leaves_no_point_and_a_reason() -> None:
    rebuilt, (left, right) = reconstructor(), frame(8)
    for second, said in (
        (nothing(right), "right: no_pattern"),
        (None, "right: no picture"),
        (replace(right, mirrored=not right.mirrored), "right: shows the pattern's other side"),
    ):
        shape = rebuilt.reconstruct([left, second])
        assert shape.problem == said and (shape.reason == PointReason.ONE_VIEW).all()
        assert (
            not shape.status.any() and np.isnan(shape.virtual_xyz_mm).all() and np.isnan(shape.normals).all()
        )
    shape = rebuilt.reconstruct([None, nothing(right)])
    assert (
        shape.problem == "left: no picture; right: no_pattern" and (shape.reason == PointReason.UNSEEN).all()
    )


def test_repaired_markers_stay_repaired() -> None:
    rebuilt, (left, right) = reconstructor(), frame(9)
    status = left.status.copy()
    status[3] = Status.REPAIRED
    assert rebuilt.reconstruct([replace(left, status=status), right]).status[[3, 4]].tolist() == [2, 1]


def test_nearly_parallel_rays_are_refused_where_depth_is_not_told() -> None:
    views = (looking("a", tilt_deg=0.0), looking("b", tilt_deg=0.05))
    rng = np.random.default_rng(10)
    xy, cov = rows([noisy(LAYOUT, view, TRUE, rng, 0.001) for view in views])
    points = triangulate(views, xy, cov)
    assert 0.9 < np.sqrt(np.mean(normalised(points.xyz_mm - TRUE, points.cov_mm2))) < 1.1
    depth_sigma = np.sqrt(points.cov_mm2[:, 2, 2])
    assert depth_sigma.min() > 0.02
    strict = triangulate(views, xy, cov, max_sigma_mm=float(np.median(depth_sigma)))
    refused = strict.reason == PointReason.PARALLEL
    assert 0.4 < refused.mean() < 0.6 and np.isnan(strict.xyz_mm[refused]).all()


def test_one_and_the_same_view_twice_tells_no_depth() -> None:
    view = looking("a", tilt_deg=10)
    points = triangulate(
        (view, view), *rows([noisy(LAYOUT, view, TRUE, np.random.default_rng(s)) for s in (1, 1)])
    )
    assert (points.reason == PointReason.PARALLEL).all() and np.isnan(points.xyz_mm).all()


@pytest.mark.parametrize("apart_deg", [0.0, 1e-6, 0.02])
def test_a_tiny_baseline_is_refused_at_the_start(apart_deg: float) -> None:
    views = (looking("a", tilt_deg=20.0), looking("b", tilt_deg=20.0 + apart_deg))
    rng = np.random.default_rng(11)
    rest = [noisy(LAYOUT, view, flat(LAYOUT), rng) for view in views]
    with pytest.raises(PoseError, match="views 'a' and 'b' stand too near to each other to measure depth"):
        Reconstructor(LAYOUT, unplaced(views), rest)


def test_a_small_baseline_is_calibrated() -> None:
    views = (looking("a", tilt_deg=20.0), looking("b", tilt_deg=22.0))
    rng, squares = np.random.default_rng(12), []
    for _ in range(20):
        rest, now = ([noisy(LAYOUT, v, xyz, rng, 0.005) for v in views] for xyz in (flat(LAYOUT), TRUE))
        shape = Reconstructor(LAYOUT, unplaced(views), rest, model_px=0.0).reconstruct(now)
        squares.append(normalised(shape.xyz_mm - TRUE, shape.cov_mm2))
    assert 0.8 < np.sqrt(np.mean(squares)) < 1.2


def test_pixels_without_a_ray_say_so() -> None:
    views = tuple(
        looking(n, tilt_deg=t, distortion=(-0.4, 0, 0, 0, 0)) for n, t in (("a", -15.0), ("b", 15.0))
    )
    xy = np.stack([opencv_px(view, TRUE) for view in views])
    xy[0, 8] = (900.0, 240.0)
    points = triangulate(views, xy, np.tile(np.eye(2) * 1e-4, (2, len(TRUE), 1, 1)))
    assert np.flatnonzero(points.reason).tolist() == [8] and points.reason[8] == PointReason.NO_RAY


def test_wrong_intrinsics_widen_the_covariance_instead_of_losing_markers() -> None:
    views, rng = pair(), np.random.default_rng(13)
    rest = [noisy(LAYOUT, view, flat(LAYOUT), rng, 0.003) for view in views]
    off = Rig(
        tuple(replace(v, centre_px=(v.centre_px[0] + 10, v.centre_px[1] - 12)) for v in unplaced(views).views)
    )
    now = [noisy(LAYOUT, view, TRUE, rng, 0.003) for view in views]
    honest, blind = (Reconstructor(LAYOUT, off, rest, model_px=m) for m in (None, 0.0))
    assert honest.model_px > 0.003
    exact = Reconstructor(LAYOUT, unplaced(views), rest)
    shapes = [r.reconstruct(now) for r in (honest, exact, blind)]
    sigmas = [np.sqrt(np.nanmedian(shape.cov_mm2[:, 2, 2])) for shape in shapes]
    assert np.isfinite(shapes[0].xyz_mm).all() and sigmas[0] > 1.5 * sigmas[1]
    assert (shapes[2].reason == PointReason.DISAGREE).any()
    assert exact.model_px < 0.003


def test_without_a_rest_frame_displacement_counts_from_the_layout() -> None:
    views = pair()
    shape = Reconstructor(LAYOUT, Rig(views), None).reconstruct(
        [noisy(LAYOUT, view, TRUE, np.random.default_rng(14), 1e-6) for view in views]
    )
    np.testing.assert_allclose(shape.xyz_mm, TRUE, atol=1e-5)
    np.testing.assert_allclose(shape.displacement_mm, TRUE - flat(LAYOUT), atol=1e-5)


def test_normals_and_virtual_markers_lie_on_the_surface() -> None:
    views, layout = pair(), reference(layers=8)
    true = pressed(layout.xy_mm)
    shape = Reconstructor(layout, Rig(views), None).reconstruct(
        [noisy(layout, view, true, np.random.default_rng(15), 1e-7) for view in views]
    )
    step = 1e-5
    by_x, by_y = ((pressed(layout.xy_mm + s) - pressed(layout.xy_mm - s)) / 2e-5 for s in np.eye(2) * step)
    normal = np.cross(by_x, by_y)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inner = layout.layer < 7
    assert np.degrees(np.arccos(np.clip((normal * shape.normals).sum(axis=1)[inner], -1, 1))).max() < 2.5
    fraction = (np.arange(layout.virtual_per_edge) + 1) / (layout.virtual_per_edge + 1)
    start, end = layout.xy_mm[layout.edges[:, 0]], layout.xy_mm[layout.edges[:, 1]]
    places = start[:, None] + fraction[:, None] * (end - start)[:, None]
    virtual = pressed(places.reshape(-1, 2)).reshape(shape.virtual_xyz_mm.shape)
    chord = (
        true[layout.edges[:, 0], None] * (1 - fraction[:, None])
        + true[layout.edges[:, 1], None] * fraction[:, None]
    )
    off, straight = (np.sqrt(np.mean((x - virtual) ** 2)) for x in (shape.virtual_xyz_mm, chord))
    assert off < 0.002 and off < 0.15 * straight
    np.testing.assert_allclose(np.linalg.norm(shape.virtual_normals, axis=2), 1, atol=1e-12)


def test_tac3d_names_and_order() -> None:
    shape = reconstructor().reconstruct(frame(16))
    named = shape.tac3d
    count = len(LAYOUT.xy_mm) + shape.virtual_status.size
    assert list(named) == ["3D_Positions", "3D_Displacements", "3D_Normals"]
    assert all(values.shape == (count, 3) for values in named.values())
    np.testing.assert_array_equal(named["3D_Positions"][: len(LAYOUT.xy_mm)], shape.xyz_mm)
    np.testing.assert_array_equal(
        named["3D_Displacements"][len(LAYOUT.xy_mm)], shape.virtual_displacement_mm[0, 0]
    )


def test_mistakes_are_refused_by_name() -> None:
    views, rng = pair(), np.random.default_rng(17)
    rest = [noisy(LAYOUT, view, flat(LAYOUT), rng) for view in views]
    for rig, seen, said in (
        (unplaced(views[:1]), rest[:1], "the rig has 1 view; depth needs two or more"),
        (unplaced(views), None, "view 'left' has no pose"),
        (
            unplaced(views),
            [nothing(rest[0]), rest[1]],
            r"view 'left' shows no pattern at rest \(no_pattern\)",
        ),
        (
            Rig(views),
            [replace(rest[0], mirrored=not rest[0].mirrored), rest[1]],
            "view 'left': its pose faces the other side",
        ),
        (
            Rig(views),
            [lost(rest[0], slice(0, 50)), lost(rest[1], slice(50, None))],
            "show no marker in common",
        ),
    ):
        with pytest.raises(PoseError, match=said):
            Reconstructor(LAYOUT, rig, seen)
    as_made = SimpleNamespace(of=LAYOUT.digest, outlines_mm=None, covariance_mm2=None, cell_height_mm=0.0)
    made = replace(LAYOUT, digest="2" * 64, as_made=cast(Any, as_made))
    Rig(views, layout_digest=LAYOUT.digest).require_layout(made)
    with pytest.raises(
        RigError, match=r"made with the layout 222222222222, .* repeat cmpdesign calibrate rig"
    ):
        Reconstructor(LAYOUT, Rig(views, layout_digest=made.digest), rest)
    with pytest.raises(ValueError, match="markers of 1 views; the rig has 2"):
        Reconstructor(LAYOUT, Rig(views), rest).reconstruct(rest[:1])


def test_a_square_pattern_is_reconstructed_too() -> None:
    layout, views = reference("square"), pair()
    true, rng = pressed(layout.xy_mm), np.random.default_rng(18)
    rest, now = ([noisy(layout, v, xyz, rng) for v in views] for xyz in (flat(layout), true))
    shape = Reconstructor(layout, unplaced(views), rest).reconstruct(now)
    assert np.sqrt(np.mean(normalised(shape.xyz_mm - true, shape.cov_mm2))) < 1.3
    assert np.isfinite(shape.virtual_xyz_mm).all() and (shape.normals[:, 2] > 0.5).all()


def test_small_misses_beyond_the_noise_widen_the_covariance() -> None:
    """Under a sharp contact, errors of hundredths of a pixel come atop the noise: no wrong id makes so little."""
    views, sigma = pair(), 0.002
    seen = frame(19, sigma_px=sigma)
    xy, cov = rows([noisy(LAYOUT, view, TRUE, np.random.default_rng(19), sigma) for view in views])
    xy[1, 7] += (0.0, 0.05)
    points = triangulate(views, xy, cov)
    assert points.reason[7] == PointReason.NONE and points.misfit[7] > 6
    assert points.cov_mm2[7, 1, 1] > 20 * np.median(points.cov_mm2[:, 1, 1])
    assert triangulate(views, xy, cov, tolerance_px=0.01).reason[7] == PointReason.DISAGREE
    rebuilt, rng = reconstructor(model_px=0.0), np.random.default_rng(20)
    near = np.linalg.norm(LAYOUT.xy_mm - (3.0, 0.0), axis=1) < 4.0
    bent = [replace(m, xy_px=m.xy_px + near[:, None] * rng.normal(0, 0.012, m.xy_px.shape)) for m in seen]
    calm, rough = rebuilt.reconstruct(seen), rebuilt.reconstruct(bent)
    growth = rough.cov_mm2[:, 2, 2] / calm.cov_mm2[:, 2, 2]
    assert np.median(growth[near]) > 3 and np.median(growth[LAYOUT.xy_mm[:, 0] < -5]) == pytest.approx(1)
    assert (rough.reason == PointReason.NONE).all()
    units = [
        np.sqrt(np.mean(normalised(rough.xyz_mm - TRUE, shape.cov_mm2)[near])) for shape in (rough, calm)
    ]
    assert units[0] < 1.8 and units[1] > 2.2


def test_errors_of_the_poses_are_counted_once() -> None:
    """A rest frame 25 times as noisy as the others: rays miss each other by the poses' errors, which are allowed."""
    views, rng, misfits, squares = pair(), np.random.default_rng(21), [], []
    for _ in range(20):
        rest = [noisy(LAYOUT, view, flat(LAYOUT), rng, 0.05) for view in views]
        coarse = Reconstructor(LAYOUT, unplaced(views), rest, model_px=0.0)
        shape = coarse.reconstruct([noisy(LAYOUT, view, TRUE, rng, 0.002) for view in views])
        assert not shape.reason.any()
        misfits.append(shape.misfit**2)
        squares.append(normalised(shape.xyz_mm - TRUE, shape.cov_mm2))
    assert 0.7 < np.sqrt(np.mean(misfits)) < 1.3 and 0.7 < np.sqrt(np.mean(squares)) < 1.3
    again = coarse.reconstruct(rest)
    noise = triangulate(coarse.poses.views, *rows(rest)).cov_mm2
    np.testing.assert_allclose(again.displacement_cov_mm2, 2 * noise, rtol=1e-6)
    assert (again.cov_mm2[:, 2, 2] > noise[:, 2, 2]).all() and not again.displacement_mm.any()


def damaged(markers: Markers, rng: np.random.Generator) -> Markers:
    """Anything but markers: places from anywhere, lost ones, covariances of any size, zero or unknown."""
    xy, cov, count = markers.xy_px.copy(), markers.cov_px2.copy(), len(markers.xy_px)

    def some(*shares: float) -> np.ndarray:
        return rng.random(count) < rng.choice(shares)

    wild = some(0, 0.1, 0.9)
    xy[wild] = rng.uniform(-3000, 3000, (wild.sum(), 2))
    xy[some(0, 0, 0.1, 0.95)] = np.nan
    xy[some(0, 0, 0.05)] *= 1e9
    cov[some(0, 0.3)] *= 10 ** rng.uniform(-8, 8)
    cov[some(0, 0.1)] = 0
    cov[some(0, 0.1)] = np.nan
    return replace(markers, xy_px=xy, cov_px2=cov)


def test_whatever_the_views_say_there_is_a_shape_or_a_reason() -> None:
    rng, strict = np.random.default_rng(22), reconstructor()
    lax = reconstructor(gate_sigmas=np.inf, max_sigma_mm=np.inf)
    for seed in range(30):
        seen = [damaged(markers, rng) for markers in frame(seed)]
        for rebuilt in (strict, lax):
            shape = rebuilt.reconstruct(seen)
            known = np.isfinite(shape.xyz_mm).all(axis=1)
            np.testing.assert_array_equal(known, shape.reason == PointReason.NONE)
            np.testing.assert_array_equal(known, shape.status != Status.LOST)
            assert (np.linalg.eigvalsh(shape.cov_mm2[known]) > 0).all()


def test_a_rest_frame_that_is_none_is_refused() -> None:
    views, rng = pair(mirrored=(True, False)), np.random.default_rng(23)
    refused = 0
    for k in range(10):
        rest = [noisy(LAYOUT, view, flat(LAYOUT), rng) for view in views]
        some = rng.random(len(TRUE)) < 0.4
        rest = [damaged(markers, rng) if k % 2 else lost(markers, some) for markers in rest]
        for flatness_mm in (0.0, 0.1):
            try:
                found = Reconstructor(LAYOUT, unplaced(views), rest, flatness_mm=flatness_mm)
            except PoseError as error:
                refused += 1
                assert "\n" not in str(error)
                continue
            for view, true in zip(found.poses.views, views, strict=True):
                np.testing.assert_allclose(view.R_camera_from_layout, true.R_camera_from_layout, atol=0.2)
    assert 4 <= refused <= 10
