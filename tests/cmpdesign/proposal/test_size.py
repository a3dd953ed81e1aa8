"""``size``: the proposed design fits, is read at that camera, and has the error that was predicted."""

from __future__ import annotations

import json
import shlex
import tomllib
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import cmpdesign
from cmpdesign.products.registry import pads_as_made
from extractor import Extractor
from tests.support.command import refused, run


@pytest.mark.parametrize(
    ("camera", "view", "error"),
    [("640x480", "40x30mm", None), ("640x480", "30x40mm", None), ("640x480", "40x30mm", "0.5um")],
)
def test_the_design_fits_the_view_and_has_no_finding(camera: str, view: str, error: str | None) -> None:
    proposal = cmpdesign.size(camera, view, error)
    size_mm = proposal.design.layout.size_mm
    assert size_mm[0] <= proposal.view_mm[0] and size_mm[1] <= proposal.view_mm[1]
    assert max(size_mm[0] / proposal.view_mm[0], size_mm[1] / proposal.view_mm[1]) > 0.995
    assert proposal.design.check(proposal.camera_px).findings == ()


@pytest.mark.parametrize(
    ("camera", "view", "noise"),
    [
        pytest.param((640, 480), (40.0, 30.0), 2.0, marks=pytest.mark.slow),
        ((480, 360), (60.0, 40.0), 4.0),
    ],
)
def test_the_error_that_is_measured_is_the_predicted_one(
    camera: tuple[int, int], view: tuple[float, float], noise: float
) -> None:
    """In 12 turned pictures, the estimate is within 12 % for the inner markers, and within 25 % in the outermost
    layer.
    """
    proposal = cmpdesign.size(camera, view, noise=noise)
    layout = proposal.design.layout
    # A turned pattern needs a larger picture; the scale stays that of the view.
    size = (int(1.25 * camera[0]), int(1.7 * camera[1]))
    extractor = Extractor(layout, preset="balanced")
    inner, rim = [], []
    for seed in range(12):
        picture = cmpdesign.render(
            layout, size=size, seed=seed, pitch_px=proposal.pitch_px, rotation_deg=7 * seed + 3, noise=noise
        )
        markers = extractor.extract(picture.image)
        assert (markers.status[layout.present] == 1).all()
        squares = ((markers.xy_px - picture.truth.marker_xy_px) ** 2).mean(axis=1)
        outermost = layout.marker_layer == layout.marker_layer.max()
        inner.append(squares[layout.marker_layer < layout.marker_layer.max() - 1])
        rim.append(squares[outermost & layout.present])
    measured_px = np.sqrt(np.concatenate(inner).mean())
    assert measured_px == pytest.approx(proposal.error_px, rel=0.12)
    rim_px = proposal.rim_error_um * proposal.scale_px_per_mm / 1000
    assert np.sqrt(np.concatenate(rim).mean()) == pytest.approx(rim_px, rel=0.25)
    assert proposal.error_um == pytest.approx(1000 * proposal.error_px / proposal.scale_px_per_mm)


def test_a_wanted_error_is_met_by_the_finest_such_design() -> None:
    finest, wanted_um = cmpdesign.size("640x480", "40x30mm"), 0.5
    proposal = cmpdesign.size("640x480", "40x30mm", f"{wanted_um}um")
    assert finest.error_um > wanted_um >= proposal.error_um
    assert proposal.limit == "error" and proposal.told_apart_mm > finest.told_apart_mm
    # One layer more would have a pitch smaller by a tenth, and an error larger than asked for.
    assert proposal.error_um > 0.8 * wanted_um
    assert cmpdesign.size((640, 480), (40, 30), 0.0005).design == proposal.design


def test_a_period_above_the_stated_distance_is_resolved_in_every_direction() -> None:
    """No other wave of the same samples is longer, so that the markers determine the wave."""
    proposal = cmpdesign.size("640x480", "40x30mm")
    layout, limit_mm = proposal.design.layout, proposal.told_apart_mm
    around = layout.marker_xy_mm[1:7]  # of marker 0; two of them span the lattice
    basis = np.stack([around[0], around[1]])
    reciprocal = np.linalg.inv(basis).T
    steps = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]
    for angle in np.radians(np.arange(0, 180, 5)):
        direction = np.array([np.cos(angle), np.sin(angle)])
        longer = direction / (1.001 * limit_mm)
        assert all(
            np.linalg.norm(longer - np.array(step) @ reciprocal) > np.linalg.norm(longer) for step in steps
        )
    nearest = min((reciprocal[0], reciprocal[1]), key=lambda wave: float(np.linalg.norm(wave)))
    shorter = nearest / np.linalg.norm(nearest) / (0.99 * limit_mm)
    assert any(
        np.linalg.norm(shorter - np.array(step) @ reciprocal) < np.linalg.norm(shorter) for step in steps
    )


@pytest.mark.parametrize("make", ["mold", "print"])
def test_the_product_makes_what_is_proposed_for_it(make: Literal["mold", "print"]) -> None:
    """On this view the finest pattern that the camera reads has stencil holes that no mold can have."""
    proposal = cmpdesign.size("640x480", "12x12mm", make=make)
    design = proposal.design
    assert make not in pads_as_made(design, design.layout)[1]
    assert design.mirrored == (make == "mold")
    if make == "mold":
        assert "stencil" in proposal.refusal and proposal.limit == "make"
        finest = cmpdesign.size("640x480", "12x12mm").design
        assert finest.layers is not None and design.layers is not None and finest.layers > design.layers
        assert "stencil" in pads_as_made(finest, finest.layout)[1]["mold"]


def test_the_field_that_all_pixels_see_is_stated() -> None:
    """24 px a mm by the shorter side, so that 640 px see 26.67 mm."""
    result = run("size", "--camera", "640x480", "--view", "20x20mm")
    assert "26.67 x 20 mm" in result.stdout
    assert cmpdesign.size("640x480", "20x20mm").seen_mm == pytest.approx((640 / 24, 20))


def test_the_next_command_builds_the_design(tmp_path: Path) -> None:
    path = tmp_path / "my pad.toml"
    words = ("--camera", "320x240", "--view", "30x30mm", "--make", "print", "-o", path)
    said = run("size", *words).stdout.replace("\n", " ").partition("next: cmpdesign ")[2]
    command = [tmp_path / "made" if word == "made" else word for word in shlex.split(said)]
    assert run(*command).exit_code == 0
    assert (tmp_path / "made" / "print").is_dir()


def test_build_takes_what_size_writes(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    result = run("size", "--camera", "640x480", "--view", "40x30mm", "-o", path)
    assert result.exit_code == 0 and f"wrote {path}" in result.stdout.replace("\n", "")
    design = cmpdesign.load(path)
    assert design.layout.digest == cmpdesign.size("640x480", "40x30mm").design.layout.digest
    printed = run("size", "--camera", "640x480", "--view", "40x30mm").stdout
    assert tomllib.loads(printed.partition("\n\n")[2])["layers"] == design.layers
    figures = json.loads(run("size", "--camera", "640x480", "--view", "40x30mm", "--json").stdout)
    assert figures["design"]["pitch_mm"] == design.pitch_mm and figures["error_um"] > 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--camera", "40x30", "--view", "24x18mm"], ("6.7", "12 px", "use a camera of")),
        (["--camera", "1280x960", "--view", "1x1mm"], ("0.112 mm", "limit 0.3 mm", "times as large")),
        (
            ["--camera", "320x240", "--view", "24x18mm", "--error", "1e-6mm"],
            ("0.001 um", "no less than", "larger"),
        ),
        (["--camera", "1280", "--view", "24x18mm"], ("1280", "WIDTHxHEIGHT")),
        (["--camera", "1280x960", "--view", "24x18kg"], ("24x18kg", "24x18mm")),
        (["--camera", "1280x960", "--view", "0x18mm"], ("0 mm", "0.01")),
        (["--camera", "1280x960", "--view", "24x18mm", "--error", "nan"], ("nan",)),
        (["--camera", "1280x960", "--view", "24x18mm", "--noise", "0"], ("noise", "0.1")),
        (["--camera", "1280x960", "--view", "24x18mm", "--blur", "nan"], ("blur_px", "10 px")),
    ],
)
def test_what_cannot_be_is_one_line(words: list[str], said: tuple[str, ...]) -> None:
    line = refused("size", *words)
    assert all(part in line for part in said), line


def test_the_camera_that_the_message_asks_for_is_enough() -> None:
    line = refused("size", "--camera", "40x30", "--view", "24x18mm")
    assert cmpdesign.size(line.split("use a camera of ")[1].split(" px")[0], "24x18mm").design.layers == 2
