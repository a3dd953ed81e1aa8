"""The mold and the pad as build123d objects, and the example that changes these objects."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmpdesign import build_layout, load
from cmpdesign.products.mold.cad import mold_parts, pad_parts
from cmpdesign.products.mold.parts import make_parts
from cmpdesign.products.mold.stack.stack import make_stack

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
EXAMPLE = Path(__file__).parents[4] / "examples" / "sensor_housing.py"


def by_label(compound: Any) -> dict[str, Any]:
    return {child.label: child for child in compound.children}


def test_the_mold_is_one_compound_of_labelled_colored_located_parts(tmp_path: Path) -> None:
    from build123d import export_step, import_step

    design = load("honeycomb", {"layers": "2"})
    stack = make_stack(design, build_layout(design))
    mold = mold_parts(design)
    parts = {part.name: part for part in make_parts(stack)}
    children = by_label(mold)
    pins = [f"pin-{number}" for number in range(1, 5)]
    assert list(children) == [name for name in parts if name != "pin"] + pins
    for name, child in children.items():
        part = parts[name.split("-")[0] if name in pins else name]
        assert child.is_valid and child.volume == pytest.approx(part.volume_mm3, rel=1e-9)
        expected = [int(part.color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        np.testing.assert_allclose(tuple(child.color)[:3], expected, atol=5e-3)
    # Bosses point down into the black layer, which lies between the base and the cover.
    low, high = heights_mm(children["boss-red"])
    assert low == pytest.approx(stack.z_base_mm) and high > stack.z_cover_mm
    for name, place in zip(pins, stack.pins_mm, strict=True):
        centre = children[name].bounding_box().center()
        np.testing.assert_allclose((centre.X, centre.Y), place, atol=1e-6)
    assert not overlap(children["base"], children["frame"])
    export_step(mold, tmp_path / "mold.step")
    again = by_label(import_step(tmp_path / "mold.step"))
    assert list(again) == list(children)
    for name, child in again.items():
        assert child.volume == pytest.approx(children[name].volume, rel=1e-6)
        np.testing.assert_allclose(
            tuple(child.bounding_box().center()), tuple(children[name].bounding_box().center()), atol=1e-5
        )


def heights_mm(shape: Any) -> tuple[float, float]:
    """The lowest and the highest z."""
    box = shape.bounding_box()
    return box.min.Z, box.max.Z


def overlap(first: Any, second: Any) -> bool:
    """The two share a volume."""
    common = first.intersect(second)
    shapes = [] if common is None else common if isinstance(common, list) else [common]
    return sum(abs(shape.volume) for shape in shapes) > 1e-6


@pytest.mark.parametrize("crown", ["flat", "sphere"])
def test_the_pad_is_its_silicone_layers_on_each_other(crown: str) -> None:
    values = {"mold.crown": crown, "mold.crown_radius_mm": "20"} if crown != "flat" else {}
    design = load("honeycomb", {"layers": "2", **values})
    layers = by_label(pad_parts(design))
    assert list(layers) == ["base", "marker", "cover"]
    option = design.mold
    below = 0.0
    for child, thickness in zip(
        layers.values(), (option.base_mm, option.marker_mm, option.cover_mm), strict=True
    ):
        low, high = heights_mm(child)
        assert child.is_valid
        assert low == pytest.approx(below, abs=1e-6)
        if crown == "flat":
            assert high - low == pytest.approx(thickness, abs=1e-6)
        below += thickness


def test_the_example_makes_a_housing_around_a_pad(tmp_path: Path) -> None:
    """Files written by build123d and read back: the pad lies in its seat, with clearance, in the camera's view."""
    from build123d import Axis, export_step, import_step

    sensor = runpy.run_path(str(EXAMPLE))["sensor"]("gelsight-mini")
    export_step(sensor, tmp_path / "sensor.step")
    again = import_step(tmp_path / "sensor.step")
    assert again.label == "sensor"
    housing, pad = again.children
    assert housing.label == "housing" and [child.label for child in pad.children] == [
        "base",
        "marker",
        "cover",
    ]
    assert housing.is_valid and len(housing.solids()) == 1
    assert housing.volume == pytest.approx(sensor.children[0].volume, rel=1e-6)
    assert heights_mm(housing)[1] == pytest.approx(heights_mm(pad)[1], abs=1e-6)
    assert heights_mm(pad)[0] == pytest.approx(0, abs=1e-6)
    assert not any(overlap(housing.solids()[0], layer.solids()[0]) for layer in pad.children)
    # Four screw holes, each a cylinder through the flange, and nothing between the pad and the camera.
    assert len([face for face in housing.faces() if face.geom_type.name == "CYLINDER"]) == 4
    below = housing.solids()[0].find_intersection_points(Axis((0, 0, -100), (0, 0, 1)))
    assert not below
