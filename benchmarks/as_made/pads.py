"""Pads whose markers are scattered around their nominal places, their pictures, and the readings of these."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.calibration.plain import scattered_layout
from benchmarks.suites.scoring.calibration import squared_distances
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import (
    STANDARD_SIZE,
    Camera,
    Press,
    Rendered,
    Scene,
    Twist,
    composed,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.bounds.exact_bound import exact_bound
from extractor import Extractor, LearntLayout, Markers, Reference, Status, learn_layout, parse_layout
from extractor.presets import Preset

LAYERS = 9  # all markers lie within the picture in every pose
PITCH_PX = (18.0, 21.0)
MAX_TILT_DEG = 25.0
PRESS_MM, TWIST_DEG, RADIUS_MM, REACH_MM = (0.2, 1.0), (-12.0, 12.0), (3.0, 6.0), 4.0
Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pad:
    """A pad with its nominal layout, the layout as made, and pictures of the pad at rest."""

    nominal: Layout
    made: Layout
    pictures: tuple[Rendered, ...]


class BoundedPicture(NamedTuple):
    """A picture, and the exact bounds of its markers: (M,) mean variance per axis, px^2."""

    shot: Rendered
    bound_px2: Points


class ContactPictures(NamedTuple):
    """A pad at rest and in contact. The camera does not move."""

    rest: BoundedPicture
    pressed: BoundedPicture


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of M markers and their stated covariances; NaN rows are of markers that are not measured.

    Attributes:
        error: (M, 2).
        squared: (M,) d2 of the errors by their stated covariances.
        bound: (M,) mean variance per axis by the exact bound; NaN without a bound.
    """

    error: Points
    squared: Points
    bound: Points


def sample_camera(rng: np.random.Generator) -> Camera:
    """A camera at any turn, tilted by up to ``MAX_TILT_DEG``; ``rng`` is advanced."""
    turn_deg, axis_deg = rng.uniform(0, 360, 2)
    pitch_px, tilt_deg = rng.uniform(*PITCH_PX), rng.uniform(0, MAX_TILT_DEG)
    return Camera(float(pitch_px), float(turn_deg), float(tilt_deg), float(axis_deg))


def sample_scene(layout: Layout, rng: np.random.Generator) -> Scene:
    """The pad at rest in a random pose, with random noise; ``rng`` is advanced."""
    return replace(standard_scene(layout, seed=int(rng.integers(2**31))), camera=sample_camera(rng))


def sample_pad(pattern: str, scatter_px: float, pictures: int, rng: np.random.Generator) -> Pad:
    """A pad with a scatter in px per axis at edges of 20 px, and pictures of it at rest; ``rng`` is advanced."""
    nominal = standard_layout(pattern, LAYERS)
    deviation_mm = scatter_px * float(nominal.parameters["pitch_mm"]) / 20.0
    made = scattered_layout(nominal, deviation_mm, rng)
    shots = (render(sample_scene(made, rng), size=STANDARD_SIZE) for _ in range(pictures))
    return Pad(nominal, made, tuple(shots))


def sample_contacts(layout: Layout, count: int, rng: np.random.Generator) -> Iterator[ContactPictures]:
    """Contacts that press and twist at a random place; ``rng`` is advanced."""
    for _ in range(count):
        rest = sample_scene(layout, rng)
        x, y = rng.uniform(-REACH_MM, REACH_MM, 2)
        place, radius = (float(x), float(y)), float(rng.uniform(*RADIUS_MM))
        surface = composed(
            Press(radius, float(rng.uniform(*PRESS_MM)), place),
            Twist(radius, float(rng.uniform(*TWIST_DEG)), place),
        )
        pressed = replace(rest, surface=surface, seed=int(rng.integers(2**31)))
        yield ContactPictures(_shoot(rest), _shoot(pressed))


def _shoot(scene: Scene) -> BoundedPicture:
    bound_px2 = np.einsum("mii->m", exact_bound(scene, size=STANDARD_SIZE)) / 2
    return BoundedPicture(render(scene, size=STANDARD_SIZE), bound_px2)


def reference_of(layout: Layout) -> Reference:
    """The reader's value of a layout."""
    return parse_layout(layout_to_json(layout))


def learn_pad(pad: Pad) -> LearntLayout:
    """The layout learnt from the pad's pictures and its nominal layout."""
    return learn_layout(reference_of(pad.nominal), [shot.image for shot in pad.pictures])


def place_errors(pad: Pad, learnt: LearntLayout) -> Errors:
    """Errors of the learnt places, mm: the true places are mapped nearest to the nominal places, too."""
    seen, as_made = learnt.measured, learnt.layout.as_made
    assert as_made is not None and as_made.covariance_mm2 is not None
    common, _ = cv2.findHomography(pad.made.marker_xy_mm[seen], pad.nominal.marker_xy_mm[seen])
    true_mm = cv2.perspectiveTransform(pad.made.marker_xy_mm[None], common)[0]
    error = np.where(seen[:, None], learnt.layout.xy_mm - true_mm, np.nan)
    nothing = np.full(len(error), np.nan)
    return Errors(error, squared_distances(error, as_made.covariance_mm2), nothing)


def contact_errors(layout: Reference, preset: Preset, pictures: ContactPictures) -> dict[str, Errors]:
    """Errors, px, of the markers in the picture of the contact ("position"), and of their displacements from the
    picture at rest. The two pictures are independent: covariances add up.
    """
    extractor = Extractor(layout, preset)
    rest, pressed = (extractor.extract(picture.shot.image) for picture in pictures)
    at_rest, position = (_errors(*pair) for pair in zip((rest, pressed), pictures, strict=True))
    error = position.error - at_rest.error
    squared = squared_distances(error, rest.cov_px2 + pressed.cov_px2)
    bound = np.where(np.isfinite(error[:, 0]), at_rest.bound + position.bound, np.nan)
    return {"position": position, "displacement": Errors(error, squared, bound)}


def _errors(markers: Markers, picture: BoundedPicture) -> Errors:
    """Errors of the measured markers of a picture."""
    truth = picture.shot.truth
    measured = (markers.status == Status.MEASURED) & truth.visible
    error = np.where(measured[:, None], markers.xy_px - truth.marker_xy_px, np.nan)
    bound = np.where(measured, picture.bound_px2, np.nan)
    return Errors(error, squared_distances(error, markers.cov_px2), bound)
