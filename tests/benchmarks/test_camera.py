"""The camera suite: its pictures, their truth, its counts; and no wrong id in a turn of all effects."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.camera.__main__ import main
from benchmarks.camera.page import IMAGE, page, shown_record, shown_results
from benchmarks.camera.report import (
    ALL_SEPARABLE,
    COLORS_SEPARABLE,
    COLUMNS,
    effects_table,
    failure_lines,
)
from benchmarks.frame.conditions import commit_seed, seed_of_hash
from benchmarks.suites.camera.cases import (
    COMBINED,
    KINDS,
    STRENGTHS,
    TURN,
    CameraCase,
    make_cases,
    sample_chain,
)
from benchmarks.suites.camera.development import compressed, develop
from benchmarks.suites.camera.effects import EFFECTS
from benchmarks.suites.camera.lamps import blackbody_rgb, led_rgb
from benchmarks.suites.camera.lens import CORNER_PX, disc_kernel, line_kernel
from benchmarks.suites.camera.pad import color_shifts, rounded_polygons
from benchmarks.suites.camera.parts import SIZE_PX, Chain, Demosaicing, Development, Inks, Lens, Pad, Pose
from benchmarks.suites.camera.reading import (
    WRONG_ID,
    WRONG_PLACE,
    cached_extractor,
    marker_outcomes,
    raised_result,
    score_picture,
)
from benchmarks.suites.camera.sensor import demosaic, mosaic_channels
from benchmarks.suites.camera.shoot import radiance, shoot
from benchmarks.suites.scenes import standard_layout
from benchmarks.suites.scoring.contrast import neighbour_contrast
from cmpdesign.patterns.colors import BLUE, COLORS, GREEN, RED
from cmpdesign.scene import Camera, Optics, Plain, Scene, Sensor, render

SEED = 3


def test_an_undisturbed_picture_is_the_scenes() -> None:
    """The light of the neutral chain is that of the scene's linear image; so is the truth."""
    inks = {name: tuple(255 * np.array(getattr(Inks(), name))) for name in COLORS}
    scene = Scene(
        layout=standard_layout("honeycomb", 9),
        camera=Camera(20.0, 7.3),
        background=Plain(inks["black"]),
        optics=Optics(0.8),
        sensor=Sensor(response="linear", bits=16),
        inks=inks,
    )
    plain = render(scene, size=SIZE_PX)
    light = radiance(Chain()).transpose(1, 2, 0)
    np.testing.assert_allclose(65535 * light, plain.image, atol=0.6)
    picture = shoot(Chain())
    np.testing.assert_allclose(picture.marker_xy_px, plain.truth.marker_xy_px, atol=1e-9)
    np.testing.assert_array_equal(picture.visible, plain.truth.visible)


TILTED = Chain(pose=Pose(tilt_deg=20.0), seed=5)


@cache
def tilted_picture() -> np.ndarray:
    return shoot(TILTED).image.astype(int)


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_changes_the_picture_by_its_strength(name: str) -> None:
    chain, plain = TILTED, tilted_picture()
    nothing = shoot(EFFECTS[name](chain, 0.0, np.random.default_rng(1))).image
    assert np.abs(nothing - plain).max() <= 1
    mild, hard = (shoot(EFFECTS[name](chain, s, np.random.default_rng(1))).image for s in (0.3, 1.0))
    assert np.abs(mild - plain).mean() > 0
    # a stronger mosaic lies behind a sharper lens
    assert name == "mosaic" or np.abs(mild - plain).mean() < np.abs(hard - plain).mean()


def test_distortion_moves_the_truth_and_the_picture_alike() -> None:
    """A drawn marker has its true position: the reader finds this position in a picture with much distortion."""
    pose = Pose(pitch_px=22.0)
    straight = shoot(Chain(pose=pose)).marker_xy_px
    middle = np.array([(SIZE_PX[0] - 1) / 2, (SIZE_PX[1] - 1) / 2])
    for distortion in (-0.15, 0.15):
        picture = shoot(Chain(pose=pose, lens=Lens(distortion=distortion)))
        offset = straight - middle
        squared = (offset**2).sum(axis=1, keepdims=True) / CORNER_PX**2
        np.testing.assert_allclose(
            picture.marker_xy_px, middle + offset * (1 + distortion * squared), atol=1e-9
        )
        markers = cached_extractor(pose.pattern, pose.layers, "balanced").extract(picture.image)
        error_px = (markers.xy_px - picture.marker_xy_px)[picture.visible]
        assert np.sqrt(np.nanmean(error_px**2)) < 0.1 < np.abs(picture.marker_xy_px - straight).max()


def test_chromatic_aberration_magnifies_red_and_shrinks_blue() -> None:
    """Second moments of light about the image's centre are those of the magnified pattern; green stays."""
    plain = radiance(Chain()) - 0.007
    moved = radiance(Chain(lens=Lens(aberration_px=2.0))) - 0.007
    x = np.arange(SIZE_PX[0])[None, :] - (SIZE_PX[0] - 1) / 2
    y = np.arange(SIZE_PX[1])[:, None] - (SIZE_PX[1] - 1) / 2

    def extent(plane: np.ndarray) -> float:
        return float(np.sqrt(((x**2 + y**2) * plane).sum(dtype=float) / plane.sum(dtype=float)))

    for channel, outward in enumerate((-1, 0, 1)):
        ratio = extent(moved[channel]) / extent(plain[channel])
        assert ratio == pytest.approx(1 + outward * 2.0 / CORNER_PX, abs=2e-4)


def test_kernels_move_no_edge() -> None:
    """Kernels are centred, have the sum 1 and the stated width; pixels that share a point add a sixth of a square
    pixel.
    """
    for kernel, variance in (
        (line_kernel(9.0, 30.0), 81 / 12 + 1 / 3),
        (disc_kernel(3.0), 9 / 2 + 1 / 3),
    ):
        reach = kernel.shape[0] // 2
        y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        assert kernel.sum() == pytest.approx(1, abs=1e-5)
        assert (kernel * x).sum() == pytest.approx(0, abs=1e-4)
        assert (kernel * y).sum() == pytest.approx(0, abs=1e-4)
        assert (kernel * (x**2 + y**2)).sum() == pytest.approx(variance, rel=0.05)


def test_colors_are_shifted_about_the_truth_and_corners_rounded_by_their_radius() -> None:
    shift = color_shifts(0.1, np.random.default_rng(2))
    np.testing.assert_allclose(shift[[RED, GREEN, BLUE]].mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(shift[[RED, GREEN, BLUE]], axis=1).max() == pytest.approx(0.1)
    angle = np.radians([90, 210, 330])
    triangle = np.stack([np.cos(angle), np.sin(angle)], axis=1)[None]
    x, y = rounded_polygons(triangle, 0.2)[0].T
    area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    # three corners of 60 degrees lose (3 sqrt 3 - pi) r^2
    assert area == pytest.approx(0.75 * np.sqrt(3) - (3 * np.sqrt(3) - np.pi) * 0.04, abs=2e-3)


@pytest.mark.parametrize("method", ["edge-aware", "bilinear"])
@pytest.mark.parametrize("phase", range(4))
def test_demosaicing_keeps_flat_colors(method: Demosaicing, phase: int) -> None:
    flat = np.array([0.1, 0.5, 0.8], dtype=np.float32)
    mosaic = flat[mosaic_channels((24, 32), phase)]
    np.testing.assert_allclose(
        demosaic(mosaic, method, phase), flat[:, None, None] * np.ones((24, 32)), atol=3e-5
    )


def test_jpeg_halves_the_colors_where_it_says_so() -> None:
    """Fine lines of red and blue of one luminance: full resolution preserves the lines, half resolution mixes their
    colors.
    """
    image = np.zeros((64, 64, 3), np.uint8)
    image[:, ::2], image[:, 1::2] = (0, 0, 150), (255, 35, 0)
    full, half = (compressed(image, 95, chroma_420=chroma).astype(int) - image for chroma in (False, True))
    assert np.abs(full).mean() < 6 < 40 < np.abs(half).mean()
    flat = np.full((64, 64, 3), (40, 90, 160), np.uint8)
    assert np.abs(compressed(flat, 95, chroma_420=True).astype(int) - flat).max() <= 3


def test_lamps_have_the_colors_of_their_temperatures() -> None:
    np.testing.assert_allclose(blackbody_rgb(6500.0), 1.0, atol=0.06)
    red, green, blue = blackbody_rgb(2500.0)
    assert red == 1 and 0.2 < green < 0.6 and blue < 0.15
    red, green, blue = blackbody_rgb(15000.0)
    assert blue == 1 and red < green < 0.9
    np.testing.assert_allclose(led_rgb(120.0, 0.8), (0.2, 1, 0.2))


def test_an_exposed_grey_is_encoded_as_srgb() -> None:
    light = np.full((3, 8, 8), 0.2140, np.float32)
    assert (develop(light, Development()) == 127).all() or (develop(light, Development()) == 128).all()


def test_runs_have_every_effect_in_every_strength_and_repeat() -> None:
    cases = make_cases(4 * len(TURN), SEED)
    drawn = {(case.kind, case.strength) for case in cases}
    assert drawn == {(kind, s) for kind in KINDS[1:] for s in STRENGTHS} | {("none", 0.0)}
    assert ("none", *EFFECTS, COMBINED) == KINDS
    case = next(case for case in cases if case.kind == COMBINED)
    np.testing.assert_array_equal(shoot(sample_chain(case)).image, shoot(sample_chain(case)).image)
    assert sample_chain(case) != sample_chain(CameraCase(SEED + 1, case.number))


def test_seeds_come_from_the_commit(tmp_path: Path) -> None:
    assert seed_of_hash("a" * 40) != seed_of_hash("b" * 40)
    assert 0 <= seed_of_hash("a" * 40) < 2**32
    with pytest.raises(ValueError, match="give a seed with --seed"):
        commit_seed(tmp_path)


def test_wrong_ids_wrong_positions_and_exceptions_are_counted_apart(tmp_path: Path) -> None:
    case, chain = CameraCase(SEED, 0), Chain(pose=Pose(layers=4))
    picture = shoot(chain)
    found = cached_extractor("honeycomb", 4, "balanced").extract(picture.image)
    exact = replace(found, xy_px=picture.marker_xy_px.copy())
    good = score_picture(case, picture, exact, 1.0)
    assert good.measured == good.right == good.visible == len(good.d2) and good.rms_px == 0
    moved = picture.marker_xy_px.copy()
    moved[[7, 8]] = moved[[8, 7]]
    moved[5] += (8.0, 0.0)
    moved[6] += (0.3, 0.4)
    bad = replace(exact, xy_px=moved)
    outcome = marker_outcomes(picture, bad)
    assert list(np.flatnonzero(outcome == WRONG_ID)) == [7, 8]
    assert list(np.flatnonzero(outcome == WRONG_PLACE)) == [5]
    result = score_picture(case, picture, bad, 2.0)
    assert (result.wrong_ids, result.wrong_places, result.right) == (2, 1, good.right - 3)
    assert result.rms_px == pytest.approx(np.sqrt(0.25 / (2 * result.right)))
    table = effects_table([good, result, raised_result(CameraCase(SEED, 1), picture, "Oops()")])
    row = table.records()[-1]
    assert [row[name] for name in ("pictures", "unread", "raised", "ids")] == [3, 1, 1, 2]
    assert row["reasons"] == "Oops() 1" and row["p99 ms"] == pytest.approx(2.0, abs=0.02)
    lines = failure_lines([good, result, raised_result(case, picture, "Oops()")])
    assert [line.split()[0] for line in lines] == ["RAISED", "WRONG"]

    shown = shown_results([good, result])
    assert shown == [result]
    measured = {
        "seed": SEED,
        "command": "python -m benchmarks.camera",
        "shown": [{**shown_record(result), "outcomes": "m" * len(sample_picture_markers(case))}],
        "table": str(table),
    }
    found = page(measured)
    assert "`python -m benchmarks.camera --publish`" in found.blocks["camera"]
    sheet = cv2.imdecode(np.frombuffer(found.pictures[IMAGE], np.uint8), cv2.IMREAD_COLOR)
    assert sheet.shape[2] == 3 and sheet.std() > 20


def sample_picture_markers(case: CameraCase) -> np.ndarray:
    return shoot(sample_chain(case)).marker_xy_px


def test_a_pad_with_errors_has_the_designs_truth() -> None:
    pad = Pad(color_shift=0.1, corner_scatter_px=0.5, rounding=0.2, bleed=0.1)
    plain, changed = shoot(Chain()), shoot(Chain(pad=pad))
    np.testing.assert_array_equal(plain.marker_xy_px, changed.marker_xy_px)
    assert (plain.image != changed.image).any()


def test_a_run_has_no_wrong_id_and_prints_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rows.json"
    command = ["--seed", str(SEED), "--pictures", str(len(TURN)), "--processes", "1", "--json", str(out)]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert f"--pictures {len(TURN)} --seed {SEED}" in printed
    assert all(column in printed for column in COLUMNS)
    figures = json.loads(out.read_text(encoding="utf-8"))
    rows = {row["effect"]: row for row in figures["effects"]}
    assert list(rows) == [*KINDS, COLORS_SEPARABLE, ALL_SEPARABLE, "together"] and figures["seed"] == SEED
    assert rows["together"]["ids"] == 0 and rows["together"]["raised"] == 0
    assert rows["none"]["measured"] > 0.98 and rows[COLORS_SEPARABLE]["measured"] > 0.98
    assert rows["together"]["measured"] > 0.8
    for bad in (["--pictures", "0"], ["--seed", "-2"]):
        with pytest.raises(SystemExit):
            main(bad)


def test_the_contrast_is_that_of_the_neighbours_that_differ_least() -> None:
    """Of flat colors drawn over the cells; a pair of inks that become alike counts, as does black."""
    picture = shoot(Chain(lens=Lens(blur_px=0.5)))
    layout, xy = picture.layout, picture.marker_xy_px
    bgr = np.array([(30, 20, 200), (40, 150, 30), (200, 40, 20), (20, 20, 20), (240, 240, 240)], np.uint8)

    def contrast(colors: np.ndarray) -> float:
        image = np.zeros_like(picture.image)
        for corners, color in zip(layout.cell_corners, layout.cell_color, strict=True):
            cv2.fillConvexPoly(image, np.rint(xy[corners]).astype(int), colors[color].tolist())
        return neighbour_contrast(image, layout, xy)

    lab = cv2.cvtColor(bgr[None].astype(np.float32) / 255, cv2.COLOR_BGR2Lab)[0]
    distance = np.linalg.norm(lab[:4, None] - lab[None, :4], axis=2) + 999 * np.eye(4)
    assert contrast(bgr) == pytest.approx(distance.min(), abs=0.5)
    alike = bgr.copy()
    alike[RED] = alike[GREEN]
    assert contrast(alike) == pytest.approx(0.0, abs=0.5)
