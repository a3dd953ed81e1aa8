"""Readers and their results can be pickled and deep-copied: a copy is as read-only and reads the same bytes."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extractor import (
    Extractor,
    Field,
    FrameStatus,
    Markers,
    Reconstructor,
    Reference,
    Shape,
    ShapeTracker,
    StartKind,
    Tracker,
    ViewExtractor,
)
from extractor.draw import draw_stages
from tests.support.tracking.scenes import moving, reference, shot
from tests.support.view_scenes import SMALL, binocular, binocular_shot, contact, pair, pressed, rig_of

ROOT = Path(__file__).parent.parent.parent

Copy = Callable[[Any], Any]

# In another process: an extractor and an image come in, its markers go out.
EXTRACT = """
import pickle, sys
extractor, image = pickle.load(sys.stdin.buffer)
before = set(sys.modules)
markers = extractor.extract(image)
pickle.dump((markers, set(sys.modules) - before), sys.stdout.buffer)
"""


def pickled(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))


copies = pytest.mark.parametrize("duplicate", [pickled, copy.deepcopy, copy.copy])
deep_copies = pytest.mark.parametrize("duplicate", [pickled, copy.deepcopy])


@cache
def extracted(preset: str = "balanced") -> Markers:
    return Extractor(reference(), preset).extract(shot().image)


def assert_same(
    found: Any, expected: Any, but: tuple[str, ...] = ("timings_ms", "stages", "elapsed_ms")
) -> None:
    """Equal to the last byte in all fields of a result, except those that hold times or internal values."""
    if is_dataclass(expected):
        assert type(found) is type(expected)
        for field in fields(expected):
            if field.name not in but:
                assert_same(getattr(found, field.name), getattr(expected, field.name), but)
    elif isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype and found.shape == expected.shape
        assert found.tobytes() == expected.tobytes()
    elif isinstance(expected, tuple):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert_same(one, other, but)
    else:
        assert type(found) is type(expected)
        assert found == expected or (found != found and expected != expected)


def assert_read_only(mapping: Mapping[str, Any]) -> None:
    with pytest.raises(TypeError):
        mapping["new"] = 0  # type: ignore[index]
    with pytest.raises((TypeError, AttributeError)):
        mapping.clear()  # type: ignore[attr-defined]


@copies
def test_markers_keep_every_byte_and_stay_read_only(duplicate: Copy) -> None:
    markers = extracted()
    found = duplicate(markers)
    assert_same(found, markers)
    assert dict(found.timings_ms) == dict(markers.timings_ms)
    assert list(found.stages) == list(markers.stages)
    assert_read_only(found.timings_ms)
    assert_read_only(found.stages)
    with pytest.raises(AttributeError):
        found.reason = None


@deep_copies
def test_the_stages_of_a_copy_are_drawn_alike(duplicate: Copy) -> None:
    markers, image = extracted(), shot().image
    drawn, expected = (draw_stages(image, reference(), m) for m in (duplicate(markers), markers))
    assert list(drawn) == list(expected)
    for name in expected:
        np.testing.assert_array_equal(drawn[name], expected[name])


@deep_copies
def test_a_deep_copy_shares_no_array(duplicate: Copy) -> None:
    markers = extracted()
    found = duplicate(markers)
    for field in fields(markers):
        if isinstance(getattr(markers, field.name), np.ndarray):
            assert not np.shares_memory(getattr(found, field.name), getattr(markers, field.name))


@copies
def test_a_layout_keeps_every_byte_and_stays_read_only(duplicate: Copy) -> None:
    layout = reference()
    found = duplicate(layout)
    assert isinstance(found, Reference)
    for field in fields(layout):
        value, expected = getattr(found, field.name), getattr(layout, field.name)
        if isinstance(expected, Mapping):
            assert dict(value) == dict(expected)
            assert_read_only(value)
        else:
            assert_same(value, expected)
        if isinstance(expected, np.ndarray):
            assert not value.flags.writeable
    assert not found.present.flags.writeable


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
@copies
def test_a_copy_of_an_extractor_reads_the_same_bytes(duplicate: Copy, preset: str) -> None:
    extractor = Extractor(reference(), preset)
    assert_same(duplicate(extractor).extract(shot().image), extracted(preset))
    extractor.extract(shot(seed=1).image)
    used = duplicate(extractor)
    assert_same(used.extract(shot().image), extracted(preset))
    nothing = used.extract(np.zeros((64, 64, 3), np.uint8))
    assert_same(pickled(nothing), nothing)


def test_another_process_reads_the_same_bytes() -> None:
    """Its first image loads no module: numpy's masked arrays, which some of its functions ask for, take 60 ms."""
    large = np.repeat(np.repeat(shot().image, 2, axis=0), 2, axis=1)  # recognised at a reduced scale
    sent = pickle.dumps((Extractor(reference()), large))
    run = subprocess.run(
        [sys.executable, "-c", EXTRACT], input=sent, capture_output=True, cwd=ROOT, check=True
    )
    found, loaded = pickle.loads(run.stdout)
    assert loaded == set()
    assert_same(found, Extractor(reference()).extract(large))
    assert_read_only(found.timings_ms)
    assert_read_only(found.stages)


@pytest.mark.parametrize("warm", [True, False])
@deep_copies
def test_a_tracker_that_is_copied_in_mid_sequence_goes_on_alike(duplicate: Copy, warm: bool) -> None:
    images: list[np.ndarray | None] = [rendered.image for rendered in moving(6)]
    images[4] = np.zeros_like(images[0])  # lost: velocities are forgotten
    images.insert(2, None)
    for start in (0, 2, 3, 6):
        tracker = Tracker(reference(), warm=warm)
        for image in images[:start]:
            tracker.track(image, time_s=0.1)
        other = duplicate(tracker)
        assert_same(other.rest, tracker.rest)
        frames = [(tracker.track(image), other.track(image)) for image in images[start:]]
        for expected, found in frames:
            assert_same(found, expected)
            assert_same(pickled(found), expected)
        assert frames[-1][1].status is FrameStatus.TRACKED
        if warm and start in (2, 3):
            assert frames[1][1].start is StartKind.WARM


@deep_copies
def test_what_a_copied_tracker_reads_does_not_move_the_original(duplicate: Copy) -> None:
    images = [rendered.image for rendered in moving(4)]
    tracker, alone = Tracker(reference()), Tracker(reference())
    for image in images[:2]:
        tracker.track(image)
        alone.track(image)
    other = duplicate(tracker)
    for image in reversed(images):
        other.track(image)
    assert_same(tracker.track(images[3]), alone.track(images[3]))


@copies
def test_views_and_fields_are_the_same(duplicate: Copy) -> None:
    layout, rig = reference(), rig_of(binocular())
    found = duplicate(rig)
    assert_same(found, rig)
    for view in pair():
        other = duplicate(view)
        assert_same(other, view)
        xyz = pressed(layout.xy_mm)
        assert other.project(xyz).tobytes() == view.project(xyz).tobytes()
    field = Field(layout)
    values = pressed(layout.xy_mm)
    gradients = field.gradients(values).tobytes()
    places = np.random.default_rng(0).uniform(-4, 4, (200, 2))
    other_field = duplicate(field)
    assert other_field.gradients(values).tobytes() == gradients
    assert other_field.at(values, places).tobytes() == field.at(values, places).tobytes()


@deep_copies
def test_reconstruction_goes_on_alike(duplicate: Copy) -> None:
    layout = reference(layers=SMALL)
    views = ViewExtractor(layout, rig_of(binocular()), side="back")
    rest, image = views.extract(binocular_shot().image), binocular_shot(contact, 1).image
    markers = views.extract(image)
    other_views = duplicate(views)
    assert_same(other_views.extract(image), markers)
    reconstructor = Reconstructor(layout, views.rig, rest)
    shape = reconstructor.reconstruct(markers)
    other = duplicate(reconstructor)
    assert_same(other.reconstruct(markers), shape)
    assert isinstance(duplicate(shape), Shape)
    assert_same(duplicate(shape), shape)
    tracker = ShapeTracker(reconstructor)
    tracker.track(binocular_shot().image)
    other_tracker = duplicate(tracker)
    frame = tracker.track(image)
    assert_same(other_tracker.track(image), frame)
    assert_same(duplicate(frame), frame)
