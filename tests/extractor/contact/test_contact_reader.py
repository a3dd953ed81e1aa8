"""Force, torque and regions from displacement, against loads that are known."""

from __future__ import annotations

import os
import pickle
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import griddata

from cmpdesign import build_layout
from cmpdesign.contact import Elastomer
from cmpdesign.contact.finite_block import make_gel
from cmpdesign.design.design import load_design
from extractor import (
    ContactForce,
    ContactReader,
    ContactReason,
    ForceModel,
    Gel,
    GelError,
    Reference,
    View,
    load_gel,
)

Array = NDArray[np.float64]
YOUNG_MPA = 0.3
PAD = {"layers": "6", "pitch_mm": "1.5"}
SIGMA_MM = np.array([0.001, 0.001, 0.003])
LINEAR = ForceModel(strain_factor=0.0)
EXACT = ForceModel(
    strain_factor=0.0, strain_sigma=0.0, normal_error=0.0, shear_error=0.0, torque_error=0.0, shear_by_press=0.0,
    centre_error=0.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def layout() -> Reference:
    return build_layout(load_design("honeycomb", PAD)).reference()


@pytest.fixture(scope="module")
def gel(layout: Reference) -> Gel:
    return make_gel(layout, Elastomer(4.0, 1.0, 0.5, 0.5))


class Press:
    """A known traction on the touched face, and the markers that it moves; its torque has the arms of moved places."""

    def __init__(
        self, gel: Gel, *balls: tuple[float, float, float], shear: float = 0.0, twist: float = 0.0
    ) -> None:
        markers_mm = build_layout(load_design("honeycomb", PAD)).marker_xy_mm
        traction = np.zeros((len(gel.loads_mm), 3))
        for x, y, radius in balls:
            offset = gel.loads_mm - (x, y)
            pressure = 0.06 * np.sqrt(np.maximum(1 - (offset**2).sum(axis=1) / radius**2, 0))
            traction[:, 2] -= pressure
            traction[:, 0] += shear * pressure - twist * offset[:, 1] * pressure
            traction[:, 1] += twist * offset[:, 0] * pressure
        force = traction * gel.area_mm2[:, None]
        self.moved = (gel.matrix.astype(float) @ traction.ravel() / YOUNG_MPA).reshape(-1, 3)
        pressed = np.abs(traction[:, 2]) > 0
        arm = np.pad(gel.loads_mm[pressed], [(0, 0), (0, 1)])
        arm += griddata(markers_mm, self.moved, gel.loads_mm[pressed], "cubic")
        self.force_n, self.torque_nmm = force.sum(axis=0), np.cross(arm, force[pressed]).sum(axis=0)

    def seen(self, seed: int = 0) -> Array:
        return self.moved + np.random.default_rng(seed).normal(size=self.moved.shape) * SIGMA_MM


def cov(layout: Reference) -> Array:
    return np.tile(np.diag(SIGMA_MM**2), (len(layout.xy_mm), 1, 1))


def read(layout: Reference, gel: Gel, moved: Array) -> ContactForce:
    return ContactReader(layout, gel, YOUNG_MPA, friction=0.5, model=LINEAR).read(moved, cov(layout))


@pytest.mark.parametrize(
    "balls", [((0.0, 0.0, 2.5),), ((2.0, -1.5, 2.0),), ((-3.0, 1.0, 1.6), (2.5, 1.0, 1.6))]
)
def test_force_torque_and_utilisation_of_a_sheared_and_twisted_ball(
    layout: Reference, gel: Gel, balls: tuple[tuple[float, float, float], ...]
) -> None:
    press = Press(gel, *balls, shear=0.2, twist=0.08)
    found = read(layout, gel, press.seen())
    assert found.reason is ContactReason.NONE
    size = np.linalg.norm(press.force_n)
    np.testing.assert_allclose(found.force_n, press.force_n, atol=0.03 * size)
    np.testing.assert_allclose(
        found.torque_nmm, press.torque_nmm, atol=0.03 * size + 0.05 * np.abs(press.torque_nmm).max()
    )
    assert len(found.regions) == len(balls)
    utilisation = np.hypot(*press.force_n[:2]) / (0.5 * -press.force_n[2])
    assert found.utilisation == pytest.approx(utilisation, abs=0.05)
    np.testing.assert_allclose(sum(region.force_n for region in found.regions), found.force_n, atol=1e-9)


def processor_ms_of_other_threads() -> float:
    """Of all threads of this process but the caller's, so far."""
    others = [one for one in Path("/proc/self/task").iterdir() if int(one.name) != threading.get_native_id()]
    ticks = [(one / "stat").read_text().rpartition(")")[2].split()[11:13] for one in others]
    return 1e3 * sum(int(each) for both in ticks for each in both) / os.sysconf("SC_CLK_TCK")


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="times of threads are those of Linux")
def test_frames_wake_no_threads_of_linear_algebra(layout: Reference, gel: Gel) -> None:
    """They would wait for their next product by computing, for 30 ms or more, on a core that others need."""
    press, reader = Press(gel, (0.0, 0.0, 4.0)), ContactReader(layout, gel, YOUNG_MPA, model=LINEAR)
    time.sleep(0.15)  # such threads wait since the reader was made
    before_ms = processor_ms_of_other_threads()
    for seed in range(3):
        assert reader.read(press.seen(seed), cov(layout)).reason is ContactReason.NONE
        time.sleep(0.03)
    assert processor_ms_of_other_threads() - before_ms < 20


def test_a_large_strain_needs_more_force(layout: Reference, gel: Gel) -> None:
    """The strain factor grows with the square of force over area and modulus, and the radius, region by region."""
    press = Press(gel, (-3.0, 1.0, 2.0), (2.5, -1.0, 2.0))
    linear = read(layout, gel, press.seen())
    stiff = ContactReader(layout, gel, YOUNG_MPA, model=ForceModel(strain_factor=2.0)).read(
        press.seen(), cov(layout)
    )
    for one, other in zip(linear.regions, stiff.regions, strict=True):
        load = -one.force_n[2] / (one.area_mm2 * YOUNG_MPA)
        radius = np.sqrt(one.area_mm2 / np.pi) / gel.thickness_mm
        assert other.force_n[2] == pytest.approx(one.force_n[2] * (1 + 2.0 * radius * load**2), rel=1e-6)
        assert other.force_cov_n2[2, 2] > one.force_cov_n2[2, 2]
    beyond = 20 * Press(gel, (0.0, 0.0, 2.0)).moved
    largest = (
        ContactReader(layout, gel, YOUNG_MPA).read(beyond, cov(layout)).force_n[2]
        / read(layout, gel, beyond).force_n[2]
    )
    assert 1.0 < largest < 1.2


def test_regions_have_the_place_and_the_area_of_two_balls(layout: Reference, gel: Gel) -> None:
    press = Press(gel, (-3.0, 1.0, 2.0), (2.5, -1.0, 2.0))
    found = read(layout, gel, press.seen())
    centres = sorted(tuple(region.centre_mm) for region in found.regions)
    np.testing.assert_allclose(centres, [(-3.0, 1.0), (2.5, -1.0)], atol=0.15)
    for region in found.regions:
        assert np.sqrt(region.area_mm2 / np.pi) == pytest.approx(2.0, rel=0.2)
        x, y = region.outline_mm.T
        assert 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0
        assert (np.abs(region.outline_mm - region.centre_mm) < 3.0).all()


def test_stated_deviations_of_the_noise_are_true(layout: Reference, gel: Gel) -> None:
    # the loads are those of the model, so its own error is left out
    press = Press(gel, (0.5, 0.3, 2.4), shear=0.1)
    z = []
    reader = ContactReader(layout, gel, YOUNG_MPA, model=EXACT)
    for seed in range(20):
        reader.reset()
        found = reader.read(press.seen(seed), cov(layout))
        z.append((found.force_n - press.force_n) / np.sqrt(np.diag(found.force_cov_n2)))
    spread = np.sqrt((np.array(z) ** 2).mean())
    assert 0.2 < spread < 1.5


def test_no_force_at_rest_and_none_that_is_not_a_number(layout: Reference, gel: Gel) -> None:
    reader = ContactReader(layout, gel, YOUNG_MPA)
    random = np.random.default_rng(3)
    for _ in range(200):
        found = reader.read(random.normal(size=(len(layout.xy_mm), 3)) * SIGMA_MM, cov(layout))
        assert found.reason is ContactReason.NOTHING_TOUCHED
        assert (found.force_n == 0).all()
        assert (found.traction_mpa == 0).all()


def test_a_tenth_of_the_markers_may_be_lost(layout: Reference, gel: Gel) -> None:
    press = Press(gel, (0.0, 0.0, 2.5), shear=0.2)
    moved = press.seen()
    moved[np.random.default_rng(5).permutation(len(moved))[: len(moved) // 10]] = np.nan
    found = read(layout, gel, moved)
    assert np.isfinite(found.force_n).all()
    assert np.isfinite(found.force_cov_n2).all()
    assert len(found.regions) == 1
    np.testing.assert_allclose(found.force_n, press.force_n, atol=0.05 * np.linalg.norm(press.force_n))


def test_one_view_gives_the_force_through_its_projection(layout: Reference, gel: Gel) -> None:
    """A camera 60 mm below the pad, 14 px a mm."""
    view = View(
        "below",
        (840.0, 840.0),
        (320.0, 240.0),
        R_camera_from_layout=np.eye(3),
        t_camera_from_layout_mm=(0, 0, 60.0),
    )
    flat = np.pad(layout.xy_mm, [(0, 0), (0, 1)])
    press = Press(gel, (0.5, -0.5, 2.5), shear=0.2)
    random = np.random.default_rng(2)
    moved_px = (
        view.project(flat + press.moved) - view.project(flat) + 0.02 * random.normal(size=(len(flat), 2))
    )
    reader = ContactReader(layout, gel, YOUNG_MPA, model=LINEAR).seen(view.linearised(flat).by_point)
    found = reader.read(moved_px, np.tile(0.02**2 * np.eye(2), (len(flat), 1, 1)))
    np.testing.assert_allclose(found.force_n, press.force_n, atol=0.05 * np.linalg.norm(press.force_n))
    assert len(found.regions) == 1
    with pytest.raises(ValueError, match="2, 2"):
        reader.read(press.moved, cov(layout))


def test_a_warm_frame_finds_the_force_of_a_cold_one(layout: Reference, gel: Gel) -> None:
    reader = ContactReader(layout, gel, YOUNG_MPA, model=LINEAR)
    reader.read(Press(gel, (-1.0, 0.0, 1.8)).seen(), cov(layout))
    press = Press(gel, (0.5, 0.5, 2.5), shear=0.1)
    warm = reader.read(press.seen(), cov(layout))
    reader.reset()
    cold = reader.read(press.seen(), cov(layout))
    np.testing.assert_allclose(warm.force_n, cold.force_n, atol=0.02 * np.linalg.norm(press.force_n))


def test_force_is_proportional_to_the_modulus_and_its_deviation_is_stated(
    layout: Reference, gel: Gel
) -> None:
    moved = Press(gel, (0.0, 0.0, 2.5)).seen()
    soft = ContactReader(layout, gel, 0.1).read(moved, cov(layout))
    stiff = ContactReader(layout, gel, 0.3, young_sigma_mpa=0.06).read(moved, cov(layout))
    np.testing.assert_allclose(stiff.force_n, 3 * soft.force_n, rtol=1e-9)
    assert np.sqrt(stiff.force_cov_n2[2, 2]) >= 0.2 * -stiff.force_n[2]


def test_reasons(layout: Reference, gel: Gel) -> None:
    few = np.full((len(layout.xy_mm), 3), np.nan)
    found = read(layout, gel, few)
    assert found.reason is ContactReason.TOO_FEW_MARKERS
    assert np.isnan(found.force_n).all()
    assert read(layout, gel, Press(gel, (8.0, 0.0, 2.0)).seen()).reason is ContactReason.AT_RIM
    assert read(layout, gel, 20 * Press(gel, (0.0, 0.0, 2.0)).moved).reason is ContactReason.BEYOND_STRAIN
    assert all(reason.text or reason is ContactReason.NONE for reason in ContactReason)


def test_a_file_gives_the_same_gel_and_another_pad_is_refused(
    layout: Reference, gel: Gel, tmp_path: Path
) -> None:
    gel.write(tmp_path / "gel.npz")
    gel.write(tmp_path / "again.npz")
    assert (tmp_path / "gel.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()
    again = load_gel(tmp_path / "gel.npz")
    assert again.digest == gel.digest
    np.testing.assert_array_equal(again.matrix, gel.matrix)
    other = build_layout(load_design("honeycomb", {"layers": "5", "pitch_mm": "1.5"}))
    with pytest.raises(GelError, match="was made for the layout"):
        ContactReader(other, gel, YOUNG_MPA)
    (tmp_path / "broken.npz").write_bytes((tmp_path / "gel.npz").read_bytes()[:5000])
    for name in ("broken.npz", "missing.npz"):
        with pytest.raises(GelError, match="calibrate gel"):
            load_gel(tmp_path / name)


def test_bad_input(layout: Reference, gel: Gel) -> None:
    for young in (0.0, -1.0, float("nan")):
        with pytest.raises(GelError, match="Young's modulus"):
            ContactReader(layout, gel, young)
    reader = ContactReader(layout, gel, YOUNG_MPA)
    moved = Press(gel, (0.0, 0.0, 2.5)).seen()
    with pytest.raises(ValueError, match="covariance for every marker"):
        reader.read(moved, np.zeros(3))
    with pytest.raises(ValueError, match="positive definite"):
        reader.read(moved, 0 * cov(layout))


def test_a_reader_can_be_pickled_and_goes_on(layout: Reference, gel: Gel) -> None:
    reader = ContactReader(layout, gel, YOUNG_MPA)
    moved = Press(gel, (0.0, 0.0, 2.5)).seen()
    reader.read(moved, cov(layout))
    copy = pickle.loads(pickle.dumps(reader))
    np.testing.assert_array_equal(
        copy.read(moved, cov(layout)).force_n, reader.read(moved, cov(layout)).force_n
    )
