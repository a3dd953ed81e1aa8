"""The benchmarks that figures are quoted from run, and their arithmetic is right."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.extraction import fit_exponent, image_size_px
from benchmarks.frame.published import replace_blocks
from benchmarks.suites.article.corners import fit_plain_triangles
from benchmarks.suites.article.regions import InkRegions
from benchmarks.suites.comparison.measure import (
    CASES,
    measure_case,
    measure_pooled,
    point_errors,
    pooled_cases,
)
from benchmarks.suites.comparison.methods import METHODS, REFERENCE_METHOD
from benchmarks.suites.comparison.report import (
    MARKS,
    comparison_picture,
    methods_table,
    pooled_table,
)
from benchmarks.suites.scenes import SceneCase, checkerboard_layout, inner_markers
from cmpdesign.patterns.colors import BLACK, RED, WHITE
from cmpdesign.scene import Rendered, Sensor, Truth, standard_layout

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("startup", set()),
        ("interrupts", set()),
        ("rendering", set()),
        ("contact", set()),
        ("latency", {"seconds"}),
        ("medium", set()),
        ("datasets", {"rates", "bytes", "overheads"}),
        ("extraction", {"over_pixels", "over_markers", "growth"}),
    ],
)
def test_a_quick_run_prints_and_writes(name: str, keys: set[str], tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", f"benchmarks.{name}", "--quick", "--json", str(out)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr
    assert f"python -m benchmarks.{name} --quick" in result.stdout
    figures = json.loads(out.read_text(encoding="utf-8"))
    assert set(figures) == keys | {"command", "conditions", "tables"} and figures["conditions"]["cpu"]
    tables = figures["tables"]
    for error in tables.get("the renderer's own error, linear pictures", []):
        assert error["edge RMS px"] < 3e-4 and error["largest edge px"] < 1e-3 and error["gridlines"] > 50
    short = {row["assumption"]: row["short %"] for row in tables.get("what the reader assumes", [])}
    if short:
        assert abs(short["true constants"]) < 1 < 15 < short["no medium"] < 35


@pytest.mark.slow
def test_the_benchmark_of_molds_runs(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", "benchmarks.molds", "--quick", "--json", str(out)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert result.returncode == 0, result.stderr
    tables = json.loads(out.read_text(encoding="utf-8"))["tables"]
    assert [row["bosses"] for row in tables["boss plates, seconds of one core"]] == ["9", "36", "exponent"]
    assert [row[""] for row in tables["booleans, 36 bosses"]] == ["boolean", "direct", "ratio"]
    first, second = tables["whole processes: cmpdesign build honeycomb --only mold"]
    # Two processes, the same bytes.
    assert first["digest"] == second["digest"] and first["GB"] < 1.5


def test_exponents_are_slopes_in_the_logarithm() -> None:
    assert fit_exponent([1, 2, 4, 8], [3 * v**1.5 for v in (1, 2, 4, 8)]) == pytest.approx(1.5)
    assert image_size_px(12.0) == (4000, 3000)


def test_a_block_of_a_page_is_written_anew() -> None:
    page = "# A\n\n<!-- one: written by make bench -->\nold\n<!-- end of one -->\n\nprose\n"
    once = replace_blocks(page, {"one": "| new |", "other": "never"})
    assert once == "# A\n\n<!-- one: written by make bench -->\n\n| new |\n\n<!-- end of one -->\n\nprose\n"
    assert replace_blocks(once, {"one": "| new |"}) == once
    for broken in (page.replace("<!-- end of one -->", ""), page + page):
        with pytest.raises(ValueError, match="the block one"):
            replace_blocks(broken, {"one": "| new |"})


def rendered_at(true: np.ndarray) -> Rendered:
    flat = np.pad(true, ((0, 0), (0, 1)))
    nothing = np.empty((0, 0, 2))
    truth = Truth(true, np.ones(len(true), bool), nothing, np.ones(0, bool), False, None, flat, nothing)
    return Rendered(np.zeros((1, 1, 3), np.uint8), truth)


def test_errors_are_the_markers_and_wrong_ones_are_counted() -> None:
    layout = standard_layout("honeycomb", 2)
    true = 20.0 * layout.marker_xy_mm
    shifted = true + (0.1, -0.2)
    errors, wrong = point_errors(shifted, True, layout, rendered_at(true))
    np.testing.assert_allclose(errors, np.broadcast_to((0.1, -0.2), true.shape))
    assert wrong == 0
    shifted[[3, 4]] = shifted[[4, 3]]
    shifted[5] = np.nan
    errors, wrong = point_errors(shifted, True, layout, rendered_at(true))
    assert wrong == 2 and list(np.flatnonzero(np.isnan(errors[:, 0]))) == [3, 4, 5]
    # without numbers a swap is none; what lies between markers, and the second at one marker, is invented
    listed = np.concatenate([shifted[np.arange(len(true)) != 5], true[:2] + 9.9, true[:1] + 0.3])
    errors, wrong = point_errors(listed, False, layout, rendered_at(true))
    assert wrong == 3 and list(np.flatnonzero(np.isnan(errors[:, 0]))) == [5]
    np.testing.assert_allclose(np.nanmean(errors, axis=0), (0.1, -0.2))
    errors, wrong = point_errors(np.empty((0, 2)), False, layout, rendered_at(true))
    assert wrong == 0 and np.isnan(errors).all()


def test_the_articles_corners_are_those_of_the_triangles() -> None:
    """Regions drawn from known triangles: corners within a pixel, clockwise, and no triangle for a disc."""
    owner = np.zeros((80, 160), np.int32)
    corner = np.array([[10, 60], [40, 12], [68, 64]])
    cv2.fillConvexPoly(owner, corner[:, None], 1)
    cv2.circle(owner, (110, 40), 22, 2, -1)
    found = fit_plain_triangles(InkRegions(owner, np.array([2, 3], np.uint8)))
    assert list(found.region) == [0] and list(found.ink) == [2]
    away = np.linalg.norm(found.corner_px[0][:, None] - corner[None], axis=2)
    assert away.min(axis=0).max() < 1.0
    (ax, ay), (bx, by) = found.corner_px[0, 1:] - found.corner_px[0, 0]
    assert ax * by - ay * bx > 0


def test_the_checkerboard_is_one() -> None:
    """Squares alternate, the red cell gone, and nothing black is outside."""
    board = checkerboard_layout(plain=True)
    assert len(board.cell_color) == 441 and set(board.cell_color) == {BLACK, WHITE}
    side = board.cell_color.reshape(21, 21)
    assert (side[1:] != side[:-1]).all() and (side[:, 1:] != side[:, :-1]).all()
    assert inner_markers(board).sum() == 400
    assert (checkerboard_layout(plain=False).cell_color == RED).sum() == 1


def test_the_comparisons_scenes_are_named_apart() -> None:
    for response in ("srgb", "linear"):
        pooled = pooled_cases(response)
        assert len(set(pooled)) == 30 and {case.response for case in pooled} == {response}
        assert all(
            case.scene().sensor == Sensor(2.0, response) == case.board().sensor for case in pooled[::9]
        )
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names) and set(names) == set(MARKS)
    assert {"blur 1.6 px", "pitch 13 px"} < set(names) and SceneCase("round", blur_px=1.6).name == "round"


@pytest.mark.slow
def test_pooled_figures_are_those_of_one_scene() -> None:
    """On one linear picture the pooled error is the scene's, and its bound is the exact one of the same markers."""
    case = SceneCase(response="linear")
    pooled = {result.method: result for result in measure_pooled([case], 1)}
    assert [result.scenes for result in pooled.values()] == [1] * len(pooled)
    alone = {result.method: result for result in measure_case(case, 1)}
    for name, result in pooled.items():
        assert (
            result.rms_px == pytest.approx(alone[name].all_px, rel=1e-6) and result.wrong == alone[name].wrong
        )
        assert result.bound_px == pytest.approx(alone[name].all_bound_px, rel=0.02)
        assert result.inner_px == pytest.approx(alone[name].inner_px, rel=1e-6)
        assert result.inner_bound_px == pytest.approx(alone[name].bound_px, rel=0.02)
        assert (result.z is not None) == name.startswith("cmpdesign")
    rows = pooled_table(list(pooled.values())).markdown().split("\n")
    assert len(rows) == len(pooled) + 2 and len({row.count("|") for row in rows}) == 1


@pytest.mark.slow
def test_the_comparison_runs_on_one_scene() -> None:
    """All methods read the flat scene; ours are numbered without a mistake, and the first of the bound."""
    results = {result.method: result for result in measure_case(SceneCase(), 2)}
    assert set(results) == {method.name for method in METHODS}
    for name, limit in (("balanced", 1.5), ("accurate", 1.1)):
        mine = results[f"cmpdesign, {name}"]
        assert mine.found_share == 1 and mine.wrong == 0 and mine.inner_px < limit * mine.bound_px
    best = min(results.values(), key=lambda r: r.inner_px / r.bound_px)
    assert best.method.startswith("cmpdesign") and results[REFERENCE_METHOD].ratio == 1
    assert comparison_picture(list(results.values())).startswith(b"\x89PNG")
    assert len(methods_table(list(results.values())).rows) == len(METHODS)
