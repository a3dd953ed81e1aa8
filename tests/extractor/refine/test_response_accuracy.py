"""Pictures of any response, read with that response: as near to the exact bound as sRGB, and 16 bits are linear."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign import layout_to_json
from cmpdesign.scene import Optics, Press, Rendered, Scene, Sensor, composed, render
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.standard import standard_layout, standard_scene
from extractor import Extractor, Markers, parse_layout
from tests.support.pictures import srgb_light

LAYERS, SIZE, NOISE, SEEDS = 5, (300, 260), 2.0, 4
LAYOUT = standard_layout("honeycomb", LAYERS)
REFERENCE = parse_layout(layout_to_json(LAYOUT))
INNER = LAYOUT.marker_layer < LAYERS
SHARE = np.linspace(0, 1, 256)
# a camera's curve: sRGB with more contrast in the middle of the values
S_CURVE = tuple(srgb_light(255 * (0.7 * SHARE + 0.3 * SHARE**2 * (3 - 2 * SHARE))).tolist())
RESPONSES: dict[str, Any] = {"srgb": "srgb", "linear": "linear", "1.8": 1.8, "2.6": 2.6, "S-curve": S_CURVE}


def extractor(preset: str = "balanced", response: Any = None) -> Extractor:
    return Extractor(REFERENCE, preset, response)  # type: ignore[arg-type]


def scene(response: str = "srgb", bits: int = 8, bent: bool = False) -> Scene:
    sensor = Sensor(noise=NOISE, bits=bits, response=RESPONSES[response])
    surface = composed(Press(radius_mm=5.0, depth_mm=1.2)) if bent else None
    return replace(standard_scene(LAYOUT), surface=surface, optics=Optics(1.0), sensor=sensor)


@cache
def seen(response: str, bent: bool = False, seed: int = 0, bits: int = 8) -> Rendered:
    return render(replace(scene(response, bits, bent), seed=seed), size=SIZE)


@cache
def bound_px2(response: str, bent: bool) -> float:
    """The mean of the markers with all their gridlines, per axis."""
    bound = exact_bound(scene(response, bent=bent), size=SIZE)[INNER]
    return float(np.einsum("mii->m", bound).mean() / 2)


@cache
def ratio(preset: str, response: str, bent: bool = False) -> float:
    """RMS error over the exact bound of the encoded picture, of the markers with all their gridlines."""
    by, errors = extractor(preset, RESPONSES[response]), []
    for seed in range(SEEDS):
        shown = seen(response, bent, seed)
        errors.append((by.extract(shown.image).xy_px - shown.truth.marker_xy_px)[INNER])
    return float(np.sqrt(np.mean(np.square(errors)) / bound_px2(response, bent)))


@pytest.mark.parametrize("response", ["1.8", "2.6", "S-curve"])
@pytest.mark.parametrize(("preset", "bent"), [("balanced", False), ("accurate", False), ("accurate", True)])
def test_any_response_is_read_as_well_as_srgb(preset: str, bent: bool, response: str) -> None:
    assert ratio(preset, response, bent) < 1.1 * ratio(preset, "srgb", bent)


@pytest.mark.parametrize("bent", [False, True])
def test_linear_pictures_are_read_as_before_there_were_responses(bent: bool) -> None:
    """Then the error was 1.06 times the bound."""
    assert ratio("accurate", "linear", bent) < 1.05 * 1.06


def mean_outward_px(preset: str, shown: str, read_as: str) -> float:
    """The mean outward error of the markers of the rim."""
    shifts, by = [], extractor(preset, RESPONSES[read_as])
    for seed in range(SEEDS):
        picture = seen(shown, seed=seed)
        markers = by.extract(picture.image)
        true = picture.truth.marker_xy_px
        outward = true - true.mean(axis=0)
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        shifts.append(((markers.xy_px - true) * outward).sum(axis=1)[~INNER])
    return float(np.mean(shifts))


@pytest.mark.parametrize(("preset", "limit_px"), [("balanced", 0.01), ("accurate", 0.007)])
def test_cells_that_the_encoding_makes_larger_do_not_move_the_rim(preset: str, limit_px: float) -> None:
    """Read as if it were linear, the rim moves by 0.041, 0.016 and 0.039 px."""
    assert abs(mean_outward_px(preset, "srgb", "srgb")) < limit_px
    assert abs(mean_outward_px(preset, "linear", "linear")) < limit_px
    assert abs(mean_outward_px(preset, "srgb", "linear")) > 1.5 * limit_px


def assert_same(found: Markers, expected: Markers) -> None:
    for name in ("xy_px", "cov_px2", "status", "virtual_xy_px"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_eight_bits_are_srgb_and_sixteen_linear_unless_told_otherwise() -> None:
    linear = seen("linear", bits=16).image
    encoded = seen("srgb").image
    by = extractor()
    assert_same(by.extract(linear), extractor(response="linear").extract(linear))
    assert_same(by.extract(encoded), extractor(response="srgb").extract(encoded))
    assert_same(by.extract(linear), by.extract(linear))  # after an image of the other depth


@pytest.mark.parametrize("response", RESPONSES)
def test_a_stated_response_holds_for_both_depths(response: str) -> None:
    eight: NDArray[Any] = seen(response).image
    sixteen, by = eight.astype(np.uint16) * 257, extractor(response=RESPONSES[response])
    assert_same(by.extract(sixteen), by.extract(eight))
    true = seen(response).truth.marker_xy_px
    assert np.sqrt(np.mean((by.extract(sixteen).xy_px - true)[INNER] ** 2)) < 0.02


@pytest.mark.parametrize("duplicate", [lambda by: pickle.loads(pickle.dumps(by)), copy.deepcopy, copy.copy])
@pytest.mark.parametrize("response", [None, "linear", 1.8, S_CURVE, np.array(S_CURVE)])
def test_a_copy_keeps_the_response(response: Any, duplicate: Callable[[Extractor], Extractor]) -> None:
    image = seen("S-curve").image
    by = extractor(response=response)
    found = duplicate(by).extract(image)
    assert_same(found, by.extract(image))
    assert found.xy_px.tobytes() != read_otherwise().xy_px.tobytes()


@cache
def read_otherwise() -> Markers:
    return extractor(response=2.6).extract(seen("S-curve").image)
