"""The input of a contact: shapes of objects, height maps from files, the table of a scene, and impossible values."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cmpdesign.contact import (
    Ball,
    ContactError,
    ContactSetup,
    Cube,
    Cylinder,
    Elastomer,
    HeightMap,
    Motion,
    Punch,
    Rib,
    Ring,
    Wedge,
    contact_from,
    solve,
    solve_path,
)

LAYER = Elastomer(4.0, 0.3)
SMALL: dict[str, Any] = {"size_mm": (16.0, 16.0), "grid": 48}


def at(thing: Any, *places: tuple[float, float]) -> list[float]:
    x, y = np.array(places, dtype=np.float64).T
    return [float(value) for value in thing.height_mm(x, y)]


def test_heights_of_the_objects() -> None:
    assert at(Ball(5.0), (0, 0), (3, 4), (4, 0), (5, 1)) == pytest.approx([0, 5, 2, math.inf])
    lying = Cylinder(5.0, 8.0, 90.0)
    assert at(lying, (0, 3.9), (4, 0), (0, 4.1)) == pytest.approx([0, 2, math.inf])
    assert at(Punch(2.0, 0.5), (1.5, 0), (2.0, 0), (2.1, 0)) == pytest.approx([0, 0.5, math.inf])
    assert at(Punch(2.0), (1.99, 0), (2.01, 0)) == [0, math.inf]
    assert at(Ring(4.0, 1.0), (4, 0), (0, -4.6), (0, 0)) == pytest.approx([0, 0.2, math.inf])
    assert at(Rib(2.0, 8.0, 0.5), (3.5, 0.5), (0, 0.9), (4.1, 0)) == pytest.approx([0, 0.2, math.inf])
    assert at(Wedge(90.0, 8.0, 0.0), (0, 0), (1, 1.5), (5, 0)) == pytest.approx([0, 1.5, math.inf])
    assert at(Cube(6.0, 0.0), (2.9, -2.9), (3.1, 0)) == [0, math.inf]


def test_wedges_tip_is_round_and_joins_its_faces() -> None:
    wedge = Wedge(60.0, 8.0, 0.5)
    y = np.linspace(-2, 2, 4001)
    height = wedge.height_mm(0 * y, y)
    slope = np.gradient(height, y)
    assert np.abs(np.diff(slope)).max() < 0.02 and height.min() == 0
    assert slope[-2] == pytest.approx(1 / math.tan(math.radians(30)))
    curved = np.gradient(slope, y)[np.abs(y) < 0.05]
    np.testing.assert_allclose(curved, 1 / 0.5, rtol=0.02)


def test_objects_are_placed_and_turned() -> None:
    rib = Rib(2.0, 8.0, 0.0, centre_mm=(3.0, 1.0), turn_deg=30.0)
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    assert at(rib, (3 + 3.9 * c, 1 + 3.9 * s), (3 + 3.9 * c, 1 - 3.9 * s)) == [0, math.inf]


def test_height_map_is_read_as_it_lies(tmp_path: Path) -> None:
    """First row at the largest y, bright sticks out."""
    pixels = np.zeros((6, 8), np.uint8)
    pixels[0, 7] = 255
    cv2.imwrite(str(tmp_path / "stamp.png"), pixels)
    stamp = HeightMap.read(tmp_path / "stamp.png", 0.5, 2.0, centre_mm=(1.0, 0.0))
    assert at(stamp, (1 + 1.75, 1.25), (1 - 1.75, -1.25), (1 + 1.75, 1.0), (4, 0)) == pytest.approx(
        [0, 2, 1, math.inf]
    )
    deep = (pixels.astype(np.uint16) * 257)[..., None].repeat(3, axis=2)
    cv2.imwrite(str(tmp_path / "deep.png"), deep)
    np.testing.assert_array_equal(
        HeightMap.read(tmp_path / "deep.png", 0.5, 2.0).heights_mm, stamp.heights_mm
    )
    np.save(tmp_path / "stamp.npy", pixels / 127.5)
    np.testing.assert_allclose(HeightMap.read(tmp_path / "stamp.npy", 0.5).heights_mm, stamp.heights_mm)


def test_height_map_of_a_ball_is_the_ball() -> None:
    ball = Ball(6.0)
    axis = 0.1 * (np.arange(121) - 60)
    x, y = np.meshgrid(axis, -axis)
    face = np.where(np.hypot(x, y) <= 6.0, -ball.height_mm(x, y), np.nan)
    one, other = (
        solve(LAYER, thing, Motion(0.5), friction=0, **SMALL) for thing in (ball, HeightMap(face, 0.1))
    )
    np.testing.assert_allclose(one.displacement_mm, other.displacement_mm, atol=2e-3)


def test_height_maps_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "text.npy").write_text("no array")
    np.save(tmp_path / "words.npy", np.array(["a"]))
    cv2.imwrite(str(tmp_path / "color.png"), np.arange(300, dtype=np.uint8).reshape(10, 10, 3))
    cv2.imwrite(str(tmp_path / "gray.png"), np.zeros((4, 4), np.uint8))
    for name, depth, words in (
        ("text.png", 1.0, "is not an image"),
        ("none.png", 1.0, "cannot be read"),
        ("color.png", 1.0, "color image"),
        ("gray.png", None, "depth_mm is None; it must be above 0"),
        ("text.npy", None, "cannot be read"),
        ("words.npy", None, "no array of numbers"),
        ("words.npy", 1.0, "depth_mm is 1.0; it must be left out"),
    ):
        with pytest.raises(ContactError, match=words):
            HeightMap.read(tmp_path / name, 0.1, depth)
    for heights in (np.zeros(4), np.full((3, 3), np.nan), np.full((3, 3), np.inf)):
        with pytest.raises(ContactError, match="heights_mm is"):
            HeightMap(heights, 0.1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Ball(0.0), "radius_mm is 0; it must be above 0"),
        (lambda: Ball(math.nan), "radius_mm is nan; it must be finite"),
        (lambda: Ball(1.0, centre_mm=(0.0, math.inf)), "centre_mm"),
        (lambda: Cylinder(1.0, -1.0), "length_mm is -1"),
        (lambda: Cube(2.0, 1.1), "edge_radius_mm is 1.1; it must be from 0 to 1 mm"),
        (lambda: Rib(2.0, 5.0, -0.1), "edge_radius_mm is -0.1"),
        (lambda: Ring(1.0, 2.0), "tube_mm is 2"),
        (lambda: Wedge(180.0, 1.0), "angle_deg is 180"),
        (lambda: Motion(-1.0), "press_mm is -1; it must be 0 or more"),
        (lambda: Motion(1.0, (math.nan, 0.0)), "shear_mm"),
        (lambda: Motion(1.0, twist_deg=181.0), "twist_deg is 181"),
        (lambda: solve(LAYER, Ball(5.0), Motion(1.0), friction=-0.1), "friction is -0.1"),
        (lambda: solve(LAYER, Ball(5.0), Motion(1.0), friction=math.nan), "friction is nan"),
        (lambda: solve(LAYER, Ball(5.0), Motion(1.0), grid=4), "grid is 4; it must be a whole number"),
        (lambda: solve(LAYER, Ball(5.0), Motion(1.0), size_mm=(0.0, 1.0)), "size_mm"),
        (lambda: solve(LAYER, Ball(5.0), Motion(1.0), size_mm=(30.0, 0.5)), "at least 8 cells"),
        (lambda: solve(LAYER, Ball(5.0), Motion(1.0), steps=0), "steps is 0"),
        (lambda: solve(LAYER, Ball(5.0, centre_mm=(50, 0)), Motion(1.0), **SMALL), "covers no cell of the solved"),
        (lambda: solve(LAYER, Rib(0.01, 9.0, 0.0), Motion(1.0), **SMALL), "covers no cell"),
    ],
)  # fmt: skip
def test_impossible_values(make: Any, words: str) -> None:
    with pytest.raises(ContactError, match=words):
        make()


@pytest.mark.parametrize("friction", [0.0, 0.5, math.inf])
def test_no_press_is_no_contact(friction: float) -> None:
    found = solve(LAYER, Cube(5.0), Motion(0.0, (1.0, 0.0), 5.0), friction=friction, **SMALL)
    assert not found.displacement_mm.any() and not found.traction_mpa.any() and not found.in_contact.any()
    assert found.warnings == () and found.largest_strain == 0 and not found.force_n.any()


def test_object_that_misses_by_its_height() -> None:
    """Above the solved area there is only the ball's upper flank."""
    found = solve(LAYER, Ball(12.0, centre_mm=(17.0, 0.0)), Motion(0.1), **SMALL)
    assert not found.in_contact.any() and "does not touch the solved area" in found.warnings[0]


def test_lifting_off_leaves_nothing() -> None:
    way = [Motion(0.5, (0.2, 0.0)), Motion(0.0), Motion(0.5)]
    *_, up, again = solve_path(LAYER, Ball(8.0), way, **SMALL)
    once = next(iter(solve_path(LAYER, Ball(8.0), [Motion(0.5)], **SMALL)))
    assert not up.displacement_mm.any()
    np.testing.assert_array_equal(again.displacement_mm, once.displacement_mm)


def test_without_friction_shear_only_moves_the_object() -> None:
    step = 16 / 48
    one = solve(LAYER, Ball(8.0), Motion(0.5, (3 * step, 0.0)), friction=0, **SMALL)
    other = solve(LAYER, Ball(8.0, centre_mm=(3 * step, 0.0)), Motion(0.5), friction=0, **SMALL)
    np.testing.assert_allclose(one.displacement_mm, other.displacement_mm, atol=5e-4)
    assert not one.force_n[:2].any()


def test_warnings_name_value_limit_and_remedy() -> None:
    def warned(*given: Any, **options: Any) -> str:
        return " | ".join(solve(*given, **{"friction": 0, **SMALL, **options}).warnings)

    assert warned(LAYER, Ball(8.0), Motion(0.05)) == ""
    assert "largest strain is 0.3, above 0.1: linear theory is an estimate" in warned(
        LAYER, Ball(8.0), Motion(1.2)
    )
    assert "radius of 0 mm, below the grid's step of 0.333 mm" in warned(LAYER, Cube(5.0, 0.0), Motion(0.05))
    assert "covers 4 cells" in warned(LAYER, Ball(1.0), Motion(0.05))
    assert "reaches the edge of the solved area in 188 cells" in warned(LAYER, Cube(40.0), Motion(0.05))
    assert "take grid above 80" in warned(Elastomer(0.2, 1.0), Ball(50.0), Motion(0.01))
    assert "folds over itself" in warned(LAYER, Ball(8.0), Motion(2.0, (6.0, 0)), friction=math.inf)


def test_answer_is_the_same_twice_and_cannot_be_changed() -> None:
    one, other = (solve(LAYER, Ball(8.0), Motion(0.4, (0.2, 0.1)), **SMALL) for _ in range(2))
    assert one.displacement_mm.tobytes() == other.displacement_mm.tobytes() and one.warnings == other.warnings
    with pytest.raises(ValueError, match="read-only"):
        one.displacement_mm[0, 0, 0] = 1.0


def test_modulus_scales_forces_alone() -> None:
    soft, hard = (solve(Elastomer(4.0, e), Ball(8.0), Motion(0.4, (0.2, 0)), **SMALL) for e in (0.1, 10.0))
    np.testing.assert_allclose(hard.force_n, 100 * soft.force_n, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(hard.displacement_mm, soft.displacement_mm, atol=1e-4)
    # Far beyond what single precision holds.
    for young in (1e-30, 1e30):
        found = solve(Elastomer(4.0, young), Ball(8.0), Motion(0.4, (0.2, 0)), **SMALL)
        np.testing.assert_allclose(found.force_n / young, soft.force_n / 0.1, rtol=1e-4, atol=1e-6)


TABLE = """
friction = 0.4
size_mm = [16, "16mm"]
grid = 48
elastomer = { thickness_mm = 4, young_mpa = 0.3 }
indenter = { kind = "ball", radius_mm = "8mm", centre_mm = [1, -0.5], turn_deg = "0.1turn" }
motion = { press_mm = 0.4, shear_mm = [0.1, 0], twist_deg = 5 }
"""


def test_table_is_what_python_would_say() -> None:
    read = contact_from(tomllib.loads(TABLE))
    assert read == ContactSetup(
        elastomer=LAYER,
        indenter=Ball(8.0, centre_mm=(1.0, -0.5), turn_deg=36.0),
        motion=Motion(0.4, (0.1, 0.0), 5.0),
        friction=0.4,
        size_mm=(16.0, 16.0),
        grid=48,
        steps=4,
    )
    assert read.solve().force_n[2] < 0
    assert replace(read, motion=Motion(0.0)).solve().force_n[2] == 0
    assert contact_from(tomllib.loads(TABLE.replace("0.4\ns", "inf\ns"))).friction == math.inf


def test_every_kind_of_object_can_be_written(tmp_path: Path) -> None:
    np.save(tmp_path / "relief.npy", np.eye(5))
    for text, wanted in (
        ('kind = "cylinder", radius_mm = 5, length_mm = 8, axis_deg = 30', Cylinder(5.0, 8.0, 30.0)),
        ('kind = "punch", radius_mm = 5', Punch(5.0)),
        ('kind = "ring", radius_mm = 5, tube_mm = 1', Ring(5.0, 1.0)),
        ('kind = "rib", width_mm = 1, length_mm = 8', Rib(1.0, 8.0)),
        ('kind = "wedge", angle_deg = 90, length_mm = 8, tip_radius_mm = 0', Wedge(90.0, 8.0, 0.0)),
        ('kind = "cube", side_mm = 15, edge_radius_mm = "500um"', Cube(15.0, 0.5)),
    ):
        table = tomllib.loads(TABLE) | {"indenter": tomllib.loads(f"a = {{{text}}}")["a"]}
        assert contact_from(table).indenter == wanted
    stamp = {"kind": "heightmap", "path": "relief.npy", "pixel_mm": 0.5, "turn_deg": 10}
    read = contact_from(tomllib.loads(TABLE) | {"indenter": stamp}, tmp_path).indenter
    assert isinstance(read, HeightMap) and read.turn_deg == 10 and read.heights_mm.shape == (5, 5)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("friction = 0.4", "frction = 0.4", r"contact.frction is unknown \(did you mean friction\?\)"),
        ("friction = 0.4", "friction = -1", "contact.friction = -1: greater than or equal to 0"),
        ("thickness_mm = 4, ", "", "contact.elastomer.thickness_mm is missing"),
        ("thickness_mm = 4", "thickness_mm = 0", "contact.elastomer: thickness_mm is 0"),
        ("radius_mm", "radius", r"radius is unknown \(did you mean radius_mm\?\)"),
        ('"8mm"', '"8 furlongs"', "contact.indenter.radius_mm = '8 furlongs'"),
        ('"ball"', '"bal"', r"contact.indenter.kind is 'bal' \(did you mean ball\?\)"),
        ("centre_mm = [1, -0.5]", "centre_mm = 1", "contact.indenter.centre_mm"),
        ("press_mm = 0.4", "press_mm = nan", "contact.motion.press_mm"),
        ("grid = 48", 'grid = "many"', "contact.grid = 'many'"),
    ],
)
def test_tables_that_are_wrong(old: str, new: str, words: str) -> None:
    assert old in TABLE
    with pytest.raises(ContactError, match=words):
        contact_from(tomllib.loads(TABLE.replace(old, new)))
